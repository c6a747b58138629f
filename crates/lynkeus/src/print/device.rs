//! A study's estimator as a device, which every language prints.

use lynkeus_export::Refusal;
use lynkeus_export::curly::{Device, Entry, FirstReading, Tunable};
use lynkeus_model::{Home, Variable};
use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Level, Updates};

use crate::print::target::Target;
use crate::{Error, Study, print::tunable};
use lynkeus_experiment::course::run::at_readings;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::headers::Headers;
use lynkeus_experiment::prepare::systems::hat;
use lynkeus_study::{BetweenSamples, Late};

/// What `print` makes of an estimator, with `about` at its head, and of notes on names.
///
/// # Errors
/// What cannot run elsewhere.
pub(crate) fn printed<T>(
    prepared: &Prepared<'_>,
    design: &Design,
    made: &Blueprint,
    about: &[String],
    print: impl FnOnce(&Device<'_>, Vec<String>) -> Result<T, Refusal>,
) -> Result<T, Error> {
    let delays = delays(prepared);
    let told = Told::of(prepared, design, made);
    let first: Vec<FirstReading> = at_readings(prepared)
        .iter()
        .map(|at| FirstReading {
            sensor: at.sensor,
            state: at.state,
            slope: at.slope,
            offset: at.offset,
        })
        .collect();
    let study = prepared.study();
    let declared = prepared.declared();
    let measured = design.observer.measured.iter();
    let noises = measured.map(|signal| declared.noise.of(&signal.name).map(|n| Level::from(*n)));
    let noises: Vec<Option<Level>> = noises.collect();
    let device = Device {
        name: &prepared.plant().name,
        blueprint: made,
        first_readings: &first,
        signals: &told.signals,
        estimates: &told.estimates,
        monitors: told.monitors,
        deviations: study.estimate.deviations,
        turns: &told.turns,
        tunables: &told.tunables,
        noises: &noises,
        words: &told.words,
        delays: &delays,
        about,
    };
    print(&device, told.notes)
        .map_err(|refusal| Error::refused(refusal.to_string()).at(&study.file))
}

/// How much later than its sample is taken a reading comes, by sensor; none where no sensor is late.
fn delays(prepared: &Prepared<'_>) -> Vec<f64> {
    let declared = &prepared.declared().late;
    if !declared.is_declared() {
        return vec![];
    }
    let outputs = prepared.augmented().outputs.iter();
    let delays = outputs.map(|output| match declared.of(&output.variable.name) {
        Some(Late::By(delay)) => *delay,
        _ => 0.0,
    });
    delays.collect()
}

/// Only in C late readings find their place, and only those of a delay that does not change.
///
/// # Errors
/// A sensor is late, and the code could not help it.
pub(crate) fn refuse_late(
    prepared: &Prepared<'_>,
    to: Target,
    is_tunable: bool,
) -> Result<(), Error> {
    let mut late = prepared.declared().late.iter();
    let finds_place = to == Target::C && !is_tunable;
    let Some((name, late)) = late.find(|(_, late)| !finds_place || !matches!(late, Late::By(_)))
    else {
        return Ok(());
    };
    let where_to = match late {
        Late::TakenAt(_) => "no exported code has a column for that".to_owned(),
        Late::By(_) if to == Target::C => "what is tunable does not go back to them".to_owned(),
        Late::By(_) => format!("only C goes back to them, and not {}", to.word()),
    };
    let message = format!(
        "`{}` of [sensors]: the readings of {name} come later than their samples are taken, and {where_to}",
        late.key()
    );
    Err(Error::refused(message).at(&prepared.study().file).hint(
        "export C with a `delay`, or leave the key out and give the device each reading with the time of its sample, before later rows; the library's estimator goes back to late readings, too",
    ))
}

/// The study without what looks ahead, which a device cannot.
pub(crate) fn causal(study: &Study, notes: &mut Vec<String>) -> Study {
    let mut study = study.clone();
    let settings = &mut study.estimate;
    if settings.between_samples == BetweenSamples::Linear {
        settings.between_samples = BetweenSamples::Hold;
        notes.push(
            "between_samples = \"linear\" of [estimate] looks ahead: here signals are held between samples"
                .to_owned(),
        );
    }
    if settings.smoothing.take().is_some() {
        notes.push("smoothing looks ahead: the estimates are those of the filter".to_owned());
    }
    study
}

/// What the code says of names.
struct Told {
    signals: Vec<Entry>,
    estimates: Vec<Entry>,
    monitors: usize,
    /// states that are told in one turn, and where it begins
    turns: Vec<(usize, f64)>,
    tunables: Vec<Tunable>,
    words: Vec<Entry>,
    notes: Vec<String>,
}

impl Told {
    fn of(prepared: &Prepared<'_>, design: &Design, made: &Blueprint) -> Self {
        let plant = prepared.plant();
        let variables = plant
            .inputs
            .iter()
            .chain(&plant.outputs)
            .chain(&plant.states);
        let words: Vec<Entry> = variables.map(entry).collect();
        let known = |name: &str| {
            let own = words.iter().find(|entry| entry.name == name);
            own.cloned().unwrap_or_else(|| Entry::named(name))
        };
        let observer = &design.observer;
        let read = observer.measured.iter().chain(&observer.inputs);
        let mut headers = Headers::beside(plant).of_variables();
        // as in the table of estimates, which has a column of time besides
        let _ = headers.time();
        headers.notes.clear();
        let has_deviations = prepared.study().estimate.deviations;
        let mut deviations = vec![];
        let mut estimates = vec![];
        for estimate in &observer.estimates {
            let name = &estimate.variable.name;
            let about = known(name).about;
            let header = headers.free(&hat(name), &format!("the estimate of {name}"));
            estimates.push(Entry {
                name: header,
                about,
            });
            // of a rotation there is one
            let own = match estimate.variable.home {
                Home::Rotation { element: 0 } => name.split('[').next().unwrap_or(name),
                Home::Rotation { .. } => continue,
                _ => name,
            };
            if has_deviations {
                let about = format!("standard deviation of {own}");
                deviations.push(Entry {
                    name: headers.free(&format!("{own}_sd"), &format!("the {about}")),
                    about,
                });
            }
        }
        let monitors: Vec<Entry> = match made.updates {
            Updates::Filter { .. } => vec![],
            Updates::Jumps { .. } => observer
                .monitors
                .iter()
                .map(|monitor| Entry {
                    name: headers.free(&monitor.name, &monitor.name),
                    about: format!("{}, where below {}", monitor.meaning, monitor.alarm_below),
                })
                .collect(),
        };
        let turns = observer.estimates.iter().enumerate();
        let turns = turns.filter_map(|(i, e)| match e.variable.home {
            Home::Circle { from } => Some((i, from?)),
            _ => None,
        });
        Self {
            signals: read.map(|signal| known(&signal.name)).collect(),
            monitors: monitors.len(),
            turns: turns.collect(),
            estimates: estimates
                .into_iter()
                .chain(deviations)
                .chain(monitors)
                .collect(),
            tunables: tunable::printed(design, made),
            words,
            notes: headers.notes,
        }
    }
}

/// A variable with its unit and what it is.
fn entry(variable: &Variable) -> Entry {
    let unit = variable.unit.as_ref().map(|unit| format!("[{unit}]"));
    let words = [unit, variable.description.clone()];
    Entry {
        name: variable.name.clone(),
        about: words.into_iter().flatten().collect::<Vec<_>>().join(" "),
    }
}
