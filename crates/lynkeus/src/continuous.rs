//! Plants and observers in continuous time for simulators.

use lynkeus_run::{Method, Step, step_of};
use lynkeus_structure::short;

use crate::export::{
    Export, ExportOptions, Subject, Target, designed, origin, rounded, sound, steps,
};
use crate::fmu::equations::Equations;
use crate::prepare::{self, Prepared};
use crate::study::{self, Rk4Step};
use crate::{Error, Study, systems};

/// The plant or the observer of a study as a functional mock-up unit.
///
/// # Errors
/// Other languages, `float`, a filter, and what cannot run elsewhere.
pub(crate) fn export(
    study: &Study,
    subject: Subject,
    options: &ExportOptions,
) -> Result<Export, Error> {
    let version = match options.to {
        Target::Fmu(version) => version,
        _ => {
            let message =
                "in continuous time a plant or an observer goes to simulators: expected --to fmu";
            return Err(Error::input(message)
                .at(&study.file)
                .hint("the estimator of a study is exported to C and JavaScript"));
        }
    };
    if options.precision != crate::Precision::F64 {
        let message = "--precision f32: expected f64, in which simulators count";
        return Err(Error::input(message));
    }
    let plant = prepare::plant(study)?;
    let (equations, settings) = match subject {
        Subject::Observer => {
            let design = Prepared::new(study, &plant)?.design()?;
            if design.observer.filter.is_some() {
                return Err(filter(study, design.observer.family));
            }
            let equations = Equations::of_observer(study, &plant, &design.observer);
            (equations, Some(&study.estimate.method))
        }
        Subject::Plant | Subject::Estimator => {
            let settings = study.simulate.as_ref().map(|settings| &settings.method);
            (Equations::of_plant(study, &plant)?, settings)
        }
    };
    let mut notes = vec![];
    let method = match sound(options.step)? {
        Some(step) => Method::Rk4(Step::AtMost(step)),
        None => stepped(study, &equations, settings, &mut notes)?,
    };
    let about = about(study, subject, &plant.name, method);
    let archive = equations.archive(method, &about, version, &mut notes)?;
    Ok(Export {
        files: vec![archive],
        notes,
    })
}

fn filter(study: &Study, family: &str) -> Error {
    Error::refused(format!(
        "{family} jumps when a sensor reports, and has no equations in continuous time: expected an observer whose correction is in its derivatives"
    ))
    .at(&study.file)
    .hint("without --system observer the filter is exported for co-simulation")
}

/// Fixed steps: those of the study, or such as the fastest mode needs.
fn stepped(
    study: &Study,
    equations: &Equations<'_>,
    settings: Option<&study::Method>,
    notes: &mut Vec<String>,
) -> Result<Method, Error> {
    if let Some(settings @ study::Method::Rk4(Rk4Step::Length(_))) = settings {
        return Ok(systems::method(settings));
    }
    let system = equations.system()?;
    let mut evaluation = system.evaluation();
    let signals = evaluation.signals_mut().iter_mut();
    for (signal, value) in signals.zip(equations.typical_inputs()) {
        *signal = value;
    }
    let Some(needed) = step_of(&mut evaluation, system.start()) else {
        let message =
            "the step of co-simulation cannot be chosen: the equations have no slopes at the start";
        return Err(Error::input(message).at(&study.file).hint("give --step"));
    };
    if needed.is_infinite() {
        notes.push("one step from each communication point to the next: at the start nothing moves by itself; `export` takes a longest step as --step".to_owned());
        return Ok(Method::Rk4(Step::Substeps(1)));
    }
    let step = rounded(needed);
    notes.push(format!(
        "in co-simulation steps of {} at most, which the fastest mode at the start needs; `export` takes another as --step",
        short(step)
    ));
    Ok(Method::Rk4(Step::AtMost(step)))
}

/// What stands at the head of the files.
fn about(study: &Study, subject: Subject, name: &str, method: Method) -> Vec<String> {
    let step = steps(method).unwrap_or_default();
    let what = match subject {
        Subject::Observer => {
            format!("An observer of {name} in continuous time: its inputs are the measurements.")
        }
        Subject::Plant | Subject::Estimator => format!("The plant {name}."),
    };
    let mut lines = vec![
        origin(study),
        what,
        format!(
            "In co-simulation: classical Runge-Kutta method, {step}; inputs are held from one communication point to the next."
        ),
    ];
    if subject == Subject::Observer {
        lines.extend(designed(study));
    }
    lines
}
