//! Functional mock-up units: archives with sources, a description and, where a compiler is at hand, a
//! library for this machine. Here those of estimators.

mod archive;
pub(crate) mod equations;
mod library;
mod rate;

use std::collections::BTreeSet;

use lynkeus_export::Refusal;
use lynkeus_export::curly::c::{File, Precision};
use lynkeus_export::curly::fmu::{self, Base, Component, Experiment, Quantity, Unit, Version};
use lynkeus_export::curly::{Device, Entry};
use lynkeus_expr::Budget;
use lynkeus_model::{BaseUnit, Variable};
use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Updates};

use crate::Study;
use crate::print::target::Artifact;
use lynkeus_experiment::course::fixed_steps::unset;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::headers::Headers;
use lynkeus_study::SimulateSettings;

use library::Missing;

/// A study's estimator, ready to be written.
pub(crate) struct Made<'a> {
    pub device: &'a Device<'a>,
    pub prepared: &'a Prepared<'a>,
    pub design: &'a Design,
}

/// The archive of an estimator. The system's C compiler makes a library of its C; where there is none, the
/// archive has sources only, and a note says so.
///
/// # Errors
/// What cannot run elsewhere.
pub(crate) fn archive(
    made: &Made<'_>,
    version: Version,
    precision: Precision,
    notes: &mut Vec<String>,
) -> Result<Artifact, Refusal> {
    let described = Described::of(made);
    notes.extend(described.notes.iter().cloned());
    let component = described.component(made);
    let files = fmu::files(&component, version, precision)?;
    let budget = &made.prepared.study().budget;
    Ok(packed(
        &component.identifier(),
        files,
        version,
        budget,
        notes,
    ))
}

/// The archive of these texts with the library that the system's C compiler makes of them.
fn packed(
    identifier: &str,
    files: Vec<File>,
    version: Version,
    budget: &Budget,
    notes: &mut Vec<String>,
) -> Artifact {
    let mut entries: Vec<(String, Vec<u8>)> = files
        .into_iter()
        .map(|file| (file.name, file.text.into_bytes()))
        .collect();
    match library::compile(identifier, &entries, budget) {
        Ok(library) => entries.push((library::place(identifier, version), library)),
        Err(Missing::Compiler(why)) => notes.push(format!(
            "sources only, which not every tool takes: {why}. Where there is a C compiler, export again"
        )),
        Err(Missing::Refused { compiler, told }) => notes.push(format!(
            "sources only, which not every tool takes: {compiler} does not compile them: {told}"
        )),
    }
    Artifact {
        name: format!("{identifier}.fmu"),
        bytes: archive::stored(&entries),
    }
}

/// What the description says of the variables.
struct Described {
    signals: Vec<Quantity>,
    estimates: Vec<Quantity>,
    starts: Vec<Quantity>,
    tunables: Vec<Quantity>,
    units: Vec<Unit>,
    time: Quantity,
    /// on names that gave way
    notes: Vec<String>,
}

impl Described {
    fn of(made: &Made<'_>) -> Self {
        let plant = made.prepared.plant();
        let study = made.prepared.study();
        let known = |name: &str| -> Option<&Variable> {
            let all = plant.inputs.iter().chain(&plant.outputs);
            all.chain(&plant.states).find(|known| known.name == name)
        };
        let inputs = plant.inputs.iter();
        let inputs: Vec<&Variable> = inputs.collect();
        let measured = made.design.observer.measured.len();
        let signals = made
            .device
            .signals
            .iter()
            .enumerate()
            .map(|(place, entry)| {
                let variable = known(&entry.name);
                let input = inputs.iter().find(|input| input.name == entry.name);
                let start = match (place < measured, input) {
                    // nothing is measured until it is given
                    (true, _) => f64::NAN,
                    (false, input) => input.map_or(0.0, |input| unset(study, plant, input)),
                };
                quantity(entry.name.clone(), variable, start)
            });
        let signals: Vec<Quantity> = signals.collect();
        let estimates = estimates(made);
        let mut headers = Headers::beside(plant).of_variables();
        for own in signals.iter().chain(&estimates) {
            headers.take(&own.name);
        }
        let time = time(study, &mut headers);
        let starts = starts(made).into_iter().map(|start| {
            let Start { state, value, .. } = start;
            let name = headers.free(&format!("{state}_start"), &format!("the start of {state}"));
            let told = known(&state);
            let reading = match start.is_at_reading {
                true => ", unless its sensor reports at the first sample",
                false => "",
            };
            Quantity {
                description: format!("where the estimator begins with {state}{reading}"),
                ..quantity(name, told, value)
            }
        });
        let starts: Vec<Quantity> = starts.collect();
        let tunables = made.device.tunables.iter().map(|tunable| {
            let name = headers.free(&tunable.entry.name, &tunable.entry.name);
            Quantity {
                description: format!(
                    "{}; what is guaranteed holds for the value at the start only",
                    tunable.entry.about
                ),
                range: [Some(f64::from(f32::MIN_POSITIVE)), None],
                ..quantity(name, None, tunable.start)
            }
        });
        let tunables = tunables.collect();
        let with_units = signals.iter().chain(&estimates).chain(&starts);
        Self {
            units: units(with_units.chain([&time])),
            signals,
            estimates,
            starts,
            tunables,
            time,
            notes: headers.notes,
        }
    }

    fn component<'a>(&'a self, made: &Made<'a>) -> Component<'a> {
        Component {
            device: made.device,
            signals: &self.signals,
            estimates: &self.estimates,
            starts: &self.starts,
            tunables: &self.tunables,
            units: &self.units,
            time: &self.time,
            experiment: experiment(made.prepared.study(), sampled),
        }
    }
}

/// Estimates, their standard deviations where there are any, monitors.
fn estimates(made: &Made<'_>) -> Vec<Quantity> {
    let observer = &made.design.observer;
    let count = observer.estimates.len();
    let of = |place: usize| observer.estimates.get(place).map(|e| &e.variable);
    let each = |(place, entry): (usize, &Entry)| {
        let name = entry.name.clone();
        match (place < count, place < 2 * count && made.device.deviations) {
            (true, _) => quantity(name, of(place), 0.0),
            (false, true) => Quantity {
                is_difference: true,
                description: entry.about.clone(),
                ..quantity(name, of(place - count), 0.0)
            },
            (false, false) => Quantity {
                description: entry.about.clone(),
                ..quantity(name, None, 0.0)
            },
        }
    };
    made.device.estimates.iter().enumerate().map(each).collect()
}

/// Where a state starts.
struct Start {
    state: String,
    value: f64,
    /// its sensor's first reading counts instead
    is_at_reading: bool,
}

/// Where the states start; what is held of the measurements is none, and neither is what every sample draws anew.
fn starts(made: &Made<'_>) -> Vec<Start> {
    let Blueprint {
        flow,
        sensors,
        updates,
        ..
    } = made.device.blueprint;
    let held = match updates {
        Updates::Jumps { errors, .. } => {
            sensors.len() + errors.as_ref().map_or(0, |model| model.drawn())
        }
        Updates::Filter { model, .. } => model.drawn(),
    };
    let own = flow.states().len().saturating_sub(held);
    let first = made.device.first_readings;
    let pairs = flow.states().iter().zip(flow.start()).take(own).enumerate();
    let start = |(place, (state, value)): (usize, (&String, &f64))| Start {
        state: state.clone(),
        value: *value,
        is_at_reading: first.iter().any(|first| first.state == place),
    };
    pairs.map(start).collect()
}

fn quantity(name: String, variable: Option<&Variable>, start: f64) -> Quantity {
    Quantity {
        name,
        description: variable
            .and_then(|v| v.description.clone())
            .unwrap_or_default(),
        unit: variable
            .and_then(|v| v.unit.clone())
            .filter(|u| !u.trim().is_empty()),
        start,
        ..Quantity::default()
    }
}

/// The study's simulation as a run that a tool proposes, a communication point every `step`.
fn experiment(study: &Study, step: impl Fn(&SimulateSettings) -> f64) -> Option<Experiment> {
    let simulated = study.simulate.as_ref()?;
    let step = step(simulated);
    (step > 0.0 && simulated.until > simulated.start).then_some(Experiment {
        start: simulated.start,
        stop: simulated.until,
        step,
    })
}

/// From one sample to the next.
fn sampled(settings: &SimulateSettings) -> f64 {
    settings.sample_step.unwrap_or_else(|| settings.row_step())
}

/// The independent variable, in the study's unit of time.
fn time(study: &Study, headers: &mut Headers) -> Quantity {
    let unit = study.time_unit.as_ref().filter(|u| !u.trim().is_empty());
    let description = unit.map_or_else(
        || "in the model's unit of time".to_owned(),
        |unit| format!("in {unit}"),
    );
    Quantity {
        name: headers.free("time", "time"),
        description,
        unit: unit.cloned(),
        ..Quantity::default()
    }
}

/// Every unit that is named, once.
fn units<'q>(quantities: impl Iterator<Item = &'q Quantity>) -> Vec<Unit> {
    let named: BTreeSet<&String> = quantities.filter_map(|q| q.unit.as_ref()).collect();
    named.into_iter().map(|name| unit_of(name)).collect()
}

fn unit_of(name: &str) -> Unit {
    let base = BaseUnit::of(name).map(|unit| Base {
        // products of whole numbers
        powers: unit.powers.map(|power| power as i32),
        factor: unit.factor,
        offset: unit.offset,
    });
    Unit {
        name: name.to_owned(),
        base,
    }
}
