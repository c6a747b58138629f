//! A study's estimator as source code for other machines.

use std::path::Path;

use lynkeus_export::Refusal;
use lynkeus_export::curly::c::{self, File, Precision};
use lynkeus_export::curly::fmu::Version;
use lynkeus_export::curly::{Device, Entry, FirstReading, javascript};
use lynkeus_model::Variable;
use lynkeus_observers::Design;
use lynkeus_run::{Blueprint, Method, Step, needed_step};
use lynkeus_structure::short;

use crate::estimate::at_readings;
use crate::headers::Headers;
use crate::live::blueprint;
use crate::prepare::{self, Prepared};
use crate::study::BetweenSamples;
use crate::systems::hat;
use crate::{Error, Study, design, fmu};

/// How many of the steps that the fastest mode needs (|λ|h ≤ ½) are one with which the classical method
/// is stable for no mode that decays: all of its region left of the axis has |λ|h < 2.97.
const LONGEST: f64 = 5.94;

/// The language of an export.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Target {
    /// C99: a header, a source, a bench and how they are built
    #[default]
    C,
    /// a JavaScript module
    JavaScript,
    /// a functional mock-up unit for co-simulation: the same C in an archive with a description and, where
    /// a C compiler is at hand, a library for this machine; a note says where there is none
    Fmu(Version),
    /// a page that explains the estimates and moves them: [`report()`](crate::report())
    #[cfg(feature = "tune")]
    Html,
}

/// How an estimator is exported.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ExportOptions {
    /// the language
    pub to: Target,
    /// the type of numbers, in C
    pub precision: Precision,
    /// longest step of the integration, in the unit of time, instead of the study's
    pub step: Option<f64>,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Artifact {
    /// its name in the folder
    pub name: String,
    /// what it holds
    pub bytes: Vec<u8>,
}

impl From<File> for Artifact {
    fn from(File { name, text }: File) -> Self {
        Self {
            name,
            bytes: text.into_bytes(),
        }
    }
}

/// The answer of `lynkeus export`.
#[derive(Clone, Debug, PartialEq)]
pub struct Export {
    /// files of one folder
    pub files: Vec<Artifact>,
    /// what the user should know
    pub notes: Vec<String>,
}

/// The study's estimator as source code, as `[estimate]` says: with the same fixed step it gives what
/// [`estimate()`](crate::estimate()) gives. Where the study has no fixed step, one that is short
/// enough for the fastest mode at the start is taken, and told.
///
/// # Errors
/// As [`estimator`](crate::estimator()); and what cannot run elsewhere: a moving horizon, plants
/// that jump with time, loops that are searched, smoothing.
pub fn export(study: &Study, options: &ExportOptions) -> Result<Export, Error> {
    #[cfg(feature = "tune")]
    if options.to == Target::Html {
        return page(study, options.step);
    }
    let mut notes = vec![];
    let study = &causal(study, &mut notes);
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    let design = prepared.design()?;
    let made = blueprint(&prepared, &design)?;
    let made = stepped(&prepared, made, options.step, &mut notes)?;
    let hasty = hasty(&prepared, &made);
    notes.extend(hasty.clone());
    let about = about(study, &made, hasty);
    let files = printed(&prepared, &design, &made, &about, |device| {
        let files = match options.to {
            Target::C => c::files(device, options.precision)?,
            Target::Fmu(version) => {
                let of = fmu::Made {
                    device,
                    prepared: &prepared,
                    design: &design,
                };
                let archive = fmu::archive(&of, version, options.precision, &mut notes)?;
                return Ok(vec![archive]);
            }
            _ => vec![File {
                name: format!("{}.mjs", c::prefix(&plant.name)),
                text: javascript::module(device)?,
            }],
        };
        Ok(files.into_iter().map(Artifact::from).collect())
    })?;
    Ok(Export { files, notes })
}

/// The report on the study's simulation.
#[cfg(feature = "tune")]
fn page(study: &Study, step: Option<f64>) -> Result<Export, Error> {
    let watch = &mut |_| std::ops::ControlFlow::Continue(());
    let page = crate::report::page(study, None, step, watch)?;
    Ok(Export {
        files: vec![Artifact {
            name: page.name,
            bytes: page.html.into_bytes(),
        }],
        notes: page.notes,
    })
}

/// What `print` makes of an estimator, with `about` at its head.
///
/// # Errors
/// What cannot run elsewhere.
pub(crate) fn printed<T>(
    prepared: &Prepared<'_>,
    design: &Design,
    made: &Blueprint,
    about: &[String],
    print: impl FnOnce(&Device<'_>) -> Result<T, Refusal>,
) -> Result<T, Error> {
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
    let device = Device {
        name: &prepared.plant().name,
        blueprint: made,
        first_readings: &first,
        signals: &told.signals,
        estimates: &told.estimates,
        monitors: told.monitors,
        deviations: study.estimate.deviations,
        words: &told.words,
        about,
    };
    print(&device).map_err(|refusal| Error::refused(refusal.to_string()).at(&study.file))
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

/// With fixed steps: those asked for, those of the study, or such as the fastest mode needs.
pub(crate) fn stepped(
    prepared: &Prepared<'_>,
    made: Blueprint,
    step: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    if let Some(step) = step {
        if !(step > 0.0 && step.is_finite()) {
            let message = format!("--step: expected a finite number above 0, found {step}");
            return Err(Error::input(message));
        }
        return Ok(made.with_method(Method::Rk4(Step::AtMost(step))));
    }
    if let Method::Rk4(Step::AtMost(_) | Step::Substeps(_)) = made.method() {
        return Ok(made);
    }
    let Some(needed) = needed(prepared, &made) else {
        let message = "the step cannot be chosen: the equations have no slopes at the start";
        return Err(Error::input(message)
            .at(&prepared.study().file)
            .hint("write method = \"rk4\" and step = … under [estimate], or give --step"));
    };
    let step = rounded(needed);
    notes.push(format!(
        "steps of {} at most, which the fastest mode at the start needs: [estimate] has no method = \"rk4\" with `step`; `export` takes another as --step",
        short(step)
    ));
    Ok(made.with_method(Method::Rk4(Step::AtMost(step))))
}

/// A value that an input may have.
pub(crate) fn typical(input: &Variable) -> f64 {
    let middle = 0.5 * (input.min + input.max);
    let middle = if middle.is_finite() { middle } else { 0.0 };
    input.start.or(input.nominal).unwrap_or(middle)
}

/// The next shorter step of one digit: 1, 2 or 5.
fn rounded(step: f64) -> f64 {
    let unit = 10.0_f64.powf(step.log10().floor());
    let digit = match step / unit {
        d if d >= 5.0 => 5.0,
        d if d >= 2.0 => 2.0,
        _ => 1.0,
    };
    // the nearest number with these digits
    format!("{digit}e{}", step.log10().floor())
        .parse()
        .unwrap_or(digit * unit)
}

/// What the code says of names.
struct Told {
    signals: Vec<Entry>,
    estimates: Vec<Entry>,
    monitors: usize,
    words: Vec<Entry>,
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
        let mut headers = Headers::beside(plant);
        // as in the table of estimates
        let _ = headers.time();
        let has_deviations = prepared.study().estimate.deviations;
        let mut deviations = vec![];
        let mut estimates = vec![];
        for estimate in &observer.estimates {
            let name = &estimate.variable.name;
            let about = known(name).about;
            let header = headers.free(&hat(name), name);
            estimates.push(Entry {
                name: header,
                about,
            });
            if has_deviations {
                let header = headers.free(&format!("{name}_sd"), name);
                deviations.push(Entry {
                    name: header,
                    about: format!("standard deviation of {name}"),
                });
            }
        }
        let monitors: Vec<Entry> = match made {
            Blueprint::Filter { .. } => vec![],
            Blueprint::Sampled { .. } => observer
                .monitors
                .iter()
                .map(|monitor| Entry {
                    name: headers.free(&monitor.name, &monitor.name),
                    about: format!("{}, where below {}", monitor.meaning, monitor.alarm_below),
                })
                .collect(),
        };
        Self {
            signals: read.map(|signal| known(&signal.name)).collect(),
            monitors: monitors.len(),
            estimates: estimates
                .into_iter()
                .chain(deviations)
                .chain(monitors)
                .collect(),
            words,
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

/// Where fixed steps are so long that the method itself grows, if it is seen to.
fn hasty(prepared: &Prepared<'_>, made: &Blueprint) -> Option<String> {
    let Method::Rk4(Step::AtMost(step)) = made.method() else {
        return None;
    };
    let longest = LONGEST * needed(prepared, made)?;
    (step > longest).then(|| {
        format!(
            "not for these steps: they are {} at most, and beyond about {} the fastest mode at the start makes the method itself grow",
            short(step),
            short(longest)
        )
    })
}

/// The step that the fastest mode at the start needs.
fn needed(prepared: &Prepared<'_>, made: &Blueprint) -> Option<f64> {
    let known = prepared.plant().inputs.iter();
    let known: Vec<(&str, f64)> = known.map(|i| (i.name.as_str(), typical(i))).collect();
    needed_step(made, &known)
}

/// What stands at the head of the files: where they come from, what is guaranteed, and `hasty`,
/// for which steps it is not.
fn about(study: &Study, made: &Blueprint, hasty: Option<String>) -> Vec<String> {
    let file = file_name(&study.file);
    let step = steps(made.method()).unwrap_or_default();
    let mut lines = vec![
        format!(
            "Generated by lynkeus {} from {file}: change the study, not this file.",
            env!("CARGO_PKG_VERSION")
        ),
        format!("Classical Runge-Kutta method, {step}; signals are held between samples."),
    ];
    if let Ok(report) = design(study) {
        lines.push(String::new());
        lines.extend(report.to_string().lines().map(str::to_owned));
        lines.extend(hasty);
    }
    lines
}

/// A file without its folder.
pub(crate) fn file_name(path: &str) -> String {
    let file = Path::new(path).file_name();
    file.map_or_else(|| path.to_owned(), |f| f.display().to_string())
}

/// Fixed steps in words.
pub(crate) fn steps(method: Method) -> Option<String> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Some(format!("steps of {h:?} at most")),
        Method::Rk4(Step::Substeps(n)) => Some(format!("{n} steps from sample to sample")),
        _ => None,
    }
}
