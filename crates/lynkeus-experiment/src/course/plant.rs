//! A study's plant through time, alone or with an observer that runs along.

mod noise;

use std::ops::ControlFlow;

use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Observer;
use lynkeus_run::{Role, Simulation};

use crate::course::ended::interrupted;
use crate::course::recorded::Recorded;
use crate::course::{Course, Samples};
use crate::crew::{Watch, within};
use crate::prepare::headers::{header, log_time};
use crate::prepare::manifold;
use crate::prepare::systems::{self, method, settings};
use crate::{Error, Series, Study, Table};
use lynkeus_study::SimulateSettings;
pub(crate) use noise::{noise, stirred};

/// One run of a [`Rig`](crate::course::rig::Rig).
#[derive(Debug)]
pub struct Ran {
    /// the plant
    pub run: Recorded,
    /// the estimates, row by row of the run
    pub course: Course,
}

impl Ran {
    /// Plant and observer as one system; what ends it early is told in the course.
    pub fn together(simulation: &Simulation, observer: &Observer, watch: &mut Watch<'_>) -> Self {
        let mut run = Recorded::new(simulation);
        let done = simulation.run_into(&mut |time, row| run.push(time, row), watch);
        let mut course = Course::of_run(observer, &run);
        course.ended = done.err();
        Self { run, course }
    }
}

/// Why a run ended before its end: a limit, or what the model does.
fn ended_early(error: lynkeus_run::Error, study: &Study) -> Error {
    match study.budget.marked() {
        Some(spent) => Error::ended(spent).at(&study.file),
        None => interrupted(error, &study.file),
    }
}

/// The run of a plant without an observer.
///
/// # Errors
/// What ends it early.
pub fn alone(
    study: &Study,
    simulation: &Simulation,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Recorded, Error> {
    let mut run = Recorded::new(simulation);
    let watch = &mut within(&study.budget, watch);
    let done = simulation.run_into(&mut |time, row| run.push(time, row), watch);
    done.map_err(|error| ended_early(error, study))?;
    Ok(run)
}

/// A run of the plant alone, and what an observer reads of it.
#[derive(Debug)]
pub(crate) struct Shown {
    pub run: Recorded,
    /// every row is one
    pub samples: Samples,
}

/// The plant alone, and what an observer reads of it.
///
/// # Errors
/// What ends it early.
pub(crate) fn shown(
    study: &Study,
    plant: &Plant,
    observer: &Observer,
    simulation: &Simulation,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Shown, Error> {
    let run = alone(study, simulation, watch)?;
    let samples = seen(plant, observer, &run);
    Ok(Shown { run, samples })
}

/// What an observer reads of a plant's run.
pub fn seen(plant: &Plant, observer: &Observer, run: &Recorded) -> Samples {
    let place = |variables: &[Variable], name: &str| variables.iter().position(|v| v.name == name);
    let column = |role: Role, at: Option<usize>| {
        let values = at.and_then(|i| run.column(role.at(i)));
        values.cloned().unwrap_or_default()
    };
    let readings = observer.measured.iter();
    let inputs = observer.inputs.iter();
    let input = |at: Option<usize>| {
        let read = at.and_then(|i| run.column(Role::Read.at(i)));
        read.cloned().unwrap_or_else(|| column(Role::Input, at))
    };
    Samples {
        time: run.time.clone(),
        readings: readings
            .map(|s| column(Role::Measured, place(&plant.outputs, &s.name)))
            .collect(),
        inputs: inputs
            .map(|s| input(place(&plant.inputs, &s.name)))
            .collect(),
    }
}

/// The study's plant as a logger would have it, a sample every `step`, with the true states and
/// inputs beside it.
///
/// # Errors
/// A study that cannot be run.
pub(crate) fn recorded(study: &Study, plant: &Plant, step: f64) -> Result<Table, Error> {
    let settings = settings(study)?;
    let mut simulation = open_loop(study, settings, plant)?;
    simulation.output_step = step;
    let run = alone(study, &simulation, &mut |_| ControlFlow::Continue(()))?;
    let settings = &study.estimate;
    let own = |variables: &[Variable], role: Role| -> Vec<(String, Vec<f64>)> {
        let values = |i: usize| run.column(role.at(i)).map_or_else(Vec::new, Series::to_vec);
        let variables = variables.iter().enumerate();
        variables
            .map(|(i, v)| (v.name.clone(), values(i)))
            .collect()
    };
    let inputs = own(&plant.inputs, Role::Input);
    let seen = own(&plant.outputs, Role::Measured).into_iter();
    let is_misread = run.column(Role::Read.at(0)).is_some();
    let read = match is_misread {
        true => own(&plant.inputs, Role::Read),
        false => inputs.clone(),
    };
    let seen = seen.chain(read);
    let seen = seen.map(|(name, values)| (header(settings, &name).to_owned(), values));
    let time = (log_time(plant, settings), run.time.to_vec());
    let truth = own(&plant.states, Role::State).into_iter().chain(inputs);
    let table = Table::from_columns([time].into_iter().chain(seen).collect())?;
    Ok(table.with_truth(truth.collect()))
}

/// The time between two samples of a filter.
pub(crate) fn sample_step(settings: &SimulateSettings) -> f64 {
    settings.sample_step.unwrap_or(settings.row_step())
}

/// The study's plant with an observer that follows its sensors.
pub(crate) fn closed_loop(
    study: &Study,
    plant: &Plant,
    observer: &Observer,
) -> Result<Simulation, Error> {
    let settings = settings(study)?;
    let open = open_loop(study, settings, plant)?;
    Ok(Simulation {
        observer: Some(systems::observer(plant, observer)?),
        inputs: systems::inputs(study, plant, settings, observer)?,
        ..open
    })
}

/// The study's plant under its inputs and with its noise, without an observer.
pub fn open_loop(
    study: &Study,
    settings: &SimulateSettings,
    plant: &Plant,
) -> Result<Simulation, Error> {
    let inputs = systems::input_expressions(study, plant, settings)?;
    Ok(Simulation {
        plant: systems::plant(plant, settings)?,
        inputs: systems::of_time(plant, &inputs)?,
        observer: None,
        start: settings.start,
        until: settings.until,
        output_step: settings.row_step(),
        method: method(&settings.method),
        noise: noise(study, settings, plant)?,
        record_outputs: true,
        manifold: manifold::of_states(&plant.states),
    })
}
