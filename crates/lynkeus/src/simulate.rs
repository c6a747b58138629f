//! Plant and observer together.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Design;
use lynkeus_run::{Level, Method, Simulation, Step, Tolerances, Trajectory};

use crate::outcome::{alarms, interrupted, watches};
use crate::prepare::Prepared;
use crate::study::{self, Noise, Rk4Step, SimulateSettings, Solver};
use crate::systems::{self, hat};
use crate::{Error, Outcome, Quantity, Study, prepare};

/// Rows of a result whose study does not say how many.
const ROWS: f64 = 500.0;

/// Runs the study's plant with its observer; `watch` is told the fraction done
/// and may stop the run.
///
/// # Errors
/// A study that cannot be run, conditions that are refuted, an estimate that diverges.
pub fn simulate(
    study: &Study,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let settings = settings(study)?;
    let plant = prepare::plant(study)?;
    let design = Prepared::new(study, &plant)?.design()?;
    let simulation = Simulation {
        observer: Some(systems::observer(&plant, &design.observer)?),
        inputs: systems::inputs(study, &plant, settings, &design.observer)?,
        ..open_loop(study, settings, &plant)?
    };
    let trajectory = simulation
        .run_watched(watch)
        .map_err(|error| interrupted(error.error, &study.file))?;
    Ok(outcome(&plant, design, &trajectory))
}

/// The study's `[simulate]`.
pub(crate) fn settings(study: &Study) -> Result<&SimulateSettings, Error> {
    study.simulate.as_ref().ok_or_else(|| {
        Error::input("the study has no [simulate] section")
            .at(&study.file)
            .hint("add [simulate] with `until` and `inputs`")
    })
}

/// The study's plant under its inputs and with its noise, without an observer.
pub(crate) fn open_loop(
    study: &Study,
    settings: &SimulateSettings,
    plant: &Plant,
) -> Result<Simulation, Error> {
    let span = settings.until - settings.start;
    let inputs = systems::input_expressions(study, plant, settings)?;
    Ok(Simulation {
        plant: systems::plant(plant, settings)?,
        inputs: systems::of_time(plant, &inputs)?,
        observer: None,
        start: settings.start,
        until: settings.until,
        output_step: settings.output_step.unwrap_or(span / ROWS),
        method: method(&settings.method),
        noise: noise(study, settings, plant)?,
        record_outputs: true,
    })
}

fn noise(
    study: &Study,
    settings: &SimulateSettings,
    plant: &Plant,
) -> Result<lynkeus_run::Noise, Error> {
    let mut levels = BTreeMap::new();
    for (name, noise) in &study.sensors.noise {
        if !plant.outputs.iter().any(|o| o.name == name.text) {
            let outputs = plant.outputs.iter().map(|o| o.name.as_str());
            let refusal = Error::input(format!(
                "noise: the plant '{}' has no output named \"{name}\"",
                plant.name
            ))
            .hint(crate::near::suggest(&name.text, outputs));
            return Err(name.blame(refusal));
        }
        let level = match *noise {
            Noise::Absolute(deviation) => Level::Absolute(deviation),
            Noise::Relative(share) => Level::Relative(share),
        };
        levels.insert(name.text.clone(), level);
    }
    Ok(lynkeus_run::Noise {
        seed: settings.seed,
        sample_step: settings.sample_step,
        levels,
    })
}

/// The study's method as the runner has it.
pub(crate) fn method(method: &study::Method) -> Method {
    match *method {
        study::Method::Rk4(Rk4Step::Length(h)) => Method::Rk4(Step::AtMost(h)),
        study::Method::Rk4(Rk4Step::PerRow(n)) => {
            Method::Rk4(Step::Substeps(usize::try_from(n).unwrap_or(usize::MAX)))
        }
        study::Method::Adaptive { solver, rtol, atol } => {
            let tolerances = Tolerances {
                relative: rtol,
                absolute: atol,
                ..Tolerances::default()
            };
            match solver {
                Solver::Auto => Method::Adaptive(tolerances),
                Solver::Explicit => Method::Explicit(tolerances),
                Solver::Stiff => Method::Stiff(tolerances),
            }
        }
    }
}

fn outcome(plant: &Plant, design: Design, trajectory: &Trajectory) -> Outcome {
    let column = |name: &str| trajectory.column(name);
    let quantity = |variable: &Variable| Quantity {
        name: variable.name.clone(),
        unit: variable.unit.clone(),
        description: variable.description.clone(),
        truth: column(&variable.name),
        measured: None,
        estimate: column(&hat(&variable.name)),
        unknown_input: design
            .observer
            .estimates
            .iter()
            .any(|e| e.unknown_input && e.variable.name == variable.name),
        is_input: plant.inputs.iter().any(|i| i.name == variable.name),
    };
    let mut quantities: Vec<Quantity> = plant
        .states
        .iter()
        .chain(&plant.inputs)
        .map(quantity)
        .collect();
    let measurements = measurements(&design, |name| {
        column(&format!("{name}_measured")).or_else(|| column(name))
    });
    show_measurements(plant, &measurements, &mut quantities);
    let watches = watches(&design, trajectory);
    let notes = design
        .notes
        .iter()
        .cloned()
        .chain(alarms(&watches))
        .collect();
    Outcome {
        plant: plant.name.clone(),
        time: trajectory.times().to_vec(),
        design,
        quantities,
        measurements,
        watches,
        notes,
    }
}

/// The measured outputs of which `values` knows the values.
pub(crate) fn measurements(
    design: &Design,
    values: impl Fn(&str) -> Option<Vec<f64>>,
) -> Vec<(String, Vec<f64>)> {
    let measured = design.observer.measured.iter();
    measured
        .filter_map(|signal| Some((signal.name.clone(), values(&signal.name)?)))
        .collect()
}

/// Puts each measurement beside the state it shows; one that shows none becomes
/// a quantity of its own.
pub(crate) fn show_measurements(
    plant: &Plant,
    measurements: &[(String, Vec<f64>)],
    quantities: &mut Vec<Quantity>,
) {
    for (name, values) in measurements {
        let Some(output) = plant.outputs.iter().find(|o| o.name == *name) else {
            continue;
        };
        let state = plant.states.iter().find(|s| s.node == output.node);
        let shown = state.and_then(|s| quantities.iter_mut().find(|q| q.name == s.name));
        match shown {
            Some(quantity) => quantity.measured = Some(values.clone()),
            None => quantities.push(Quantity {
                name: output.name.clone(),
                unit: output.unit.clone(),
                description: output.description.clone(),
                measured: Some(values.clone()),
                ..Quantity::default()
            }),
        }
    }
}
