//! Plant and observer together.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus_expr::Budget;
use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Design;
use lynkeus_run::{Level, Simulation, Trajectory};

use crate::outcome::{alarms, measurements, partial, show_measurements, watches};
use crate::prepare::Prepared;
use crate::study::{Noise, SimulateSettings};
use crate::systems::{self, hat, method};
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
    let run = simulation.run_watched(&mut within(&study.budget, watch));
    let (trajectory, note) = match run {
        Ok(trajectory) => (trajectory, None),
        Err(error) => {
            let (trajectory, note) = partial(*error, &study.budget, &study.file)?;
            (trajectory, Some(note))
        }
    };
    let mut outcome = outcome(&plant, design, &trajectory);
    outcome.notes.extend(note);
    Ok(outcome)
}

/// A watch that also ends a run whose budget is spent.
pub(crate) fn within<'a>(
    budget: &'a Budget,
    watch: &'a mut dyn FnMut(f64) -> ControlFlow<()>,
) -> impl FnMut(f64) -> ControlFlow<()> + 'a {
    move |fraction| match budget.spent() {
        Some(_) => ControlFlow::Break(()),
        None => watch(fraction),
    }
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
            Noise::Uniform(bound) => Level::Uniform(bound),
        };
        levels.insert(name.text.clone(), level);
    }
    Ok(lynkeus_run::Noise {
        seed: settings.seed,
        sample_step: settings.sample_step,
        levels,
    })
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
