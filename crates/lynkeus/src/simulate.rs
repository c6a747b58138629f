//! Plant and observer together.

mod noise;

use std::ops::ControlFlow;

use lynkeus_model::{Plant, Variable};
use lynkeus_observers::{Design, Observer};
use lynkeus_run::{Role, Simulation, System};

use crate::Table;
use crate::course::fixed_steps::unlocated;
use crate::course::recorded::Recorded;
use crate::course::{Course, Samples};
use crate::crew::{Watch, within};
use crate::judge::outcome::{Raw, interrupted, is_answer, measurements, settle};
use crate::prepare::headers::{header, log_time};
use crate::prepare::spread::Spread;
use crate::prepare::systems::{self, method, settings};
use crate::prepare::{Prepared, StudyDesign};
use crate::words::explain;
use crate::{Error, Outcome, Quantity, Series, Study, estimate, prepare};
use lynkeus_study::SimulateSettings;
use noise::{noise, stirred};

/// Runs the study's plant with its observer; `watch` is told the fraction done
/// and may stop the run.
///
/// # Errors
/// A study that cannot be run, conditions that are refuted, an estimate that diverges. One that
/// is not credible is a result: [`Outcome::refusal`].
pub fn simulate(
    study: &Study,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    settings(study)?;
    let plant = prepare::plant(study)?;
    simulated(&Prepared::new(study, &plant)?, watch)
}

/// The same of a study that is prepared.
pub(crate) fn simulated(
    prepared: &Prepared<'_>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    of_rig(prepared, Rig::new(prepared)?, watch)
}

/// The same of a plant with its observer.
pub(crate) fn of_rig(
    prepared: &Prepared<'_>,
    rig: Rig,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let Ran { run, mut course } = rig.run(prepared, settings(prepared.study())?.seed, watch)?;
    course.notes.extend(rig.notes);
    outcome(prepared, rig.design, &run, course)
}

/// A study's plant with its observer, ready for the run of any seed.
#[derive(Clone, Debug)]
pub(crate) struct Rig {
    pub design: StudyDesign,
    /// a filter works on what the plant's sensors show, and is not in it
    pub simulation: Simulation,
    spread: Spread,
    /// what is to be said of every run
    pub notes: Vec<String>,
}

/// One run of a [`Rig`].
#[derive(Debug)]
pub(crate) struct Ran {
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

impl Spread {
    /// The plant of the run of a seed; `nominal` is the study's.
    ///
    /// # Errors
    /// A plant that cannot be made with the parameters that were drawn.
    pub fn drawn(&self, study: &Study, nominal: &System, seed: u64) -> Result<System, Error> {
        let plant = match self.has_parameters() {
            false => nominal.clone(),
            true => {
                let drawn = self.study(study, seed);
                let plant = prepare::plant(&drawn)?;
                systems::plant(&plant, systems::settings(&drawn)?)?
            }
        };
        let start = self.start(&plant, seed);
        plant.with_start(start).map_err(explain)
    }
}

impl Rig {
    /// Designs the observer of a study.
    ///
    /// # Errors
    /// A study that cannot be run.
    pub fn new(prepared: &Prepared<'_>) -> Result<Self, Error> {
        Self::of(prepared, prepared.design()?)
    }

    /// With an observer that was designed for the study.
    ///
    /// # Errors
    /// A study that cannot be run.
    pub fn of(prepared: &Prepared<'_>, design: StudyDesign) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let settings = settings(study)?;
        let mut simulation = match design.observer.filter {
            Some(_) => open_loop(study, settings, plant)?,
            None => closed_loop(study, plant, &design.observer)?,
        };
        if design.observer.filter.is_some() {
            simulation.output_step = sample_step(settings);
        }
        Ok(Self {
            spread: Spread::new(plant, settings)?,
            notes: stirred(&mut simulation).into_iter().collect(),
            simulation,
            design,
        })
    }

    /// The same for a study with another noise, other starts or another `spread`; `plant` is this
    /// rig's.
    ///
    /// # Errors
    /// Names that the plant does not have.
    pub fn redrawn(self, study: &Study, plant: &Plant) -> Result<Self, Error> {
        let settings = settings(study)?;
        let start = systems::starts(plant, &settings.initial)?;
        let system = self.simulation.plant.with_start(start);
        let mut simulation = Simulation {
            plant: system.map_err(explain)?,
            noise: noise(study, settings, plant)?,
            ..self.simulation
        };
        Ok(Self {
            spread: Spread::new(plant, settings)?,
            notes: stirred(&mut simulation).into_iter().collect(),
            simulation,
            design: self.design,
        })
    }

    /// Whether the runs of different seeds differ at all.
    pub fn is_random(&self) -> bool {
        let noise = &self.simulation.noise;
        let is_noisy = noise.levels.values().any(|level| level.size() > 0.0);
        is_noisy || noise.process.values().any(|q| *q > 0.0) || self.spread.is_random()
    }

    /// Whether the runs of different seeds differ in more than noise and start.
    pub fn has_own_programs(&self) -> bool {
        self.spread.has_parameters()
    }

    /// The start of the plant in the run of a seed.
    pub fn start(&self, seed: u64) -> Vec<f64> {
        self.spread.start(&self.simulation.plant, seed)
    }

    /// The run of a seed: its noise, its start and its parameters. `prepared` is the study's.
    ///
    /// # Errors
    /// As [`simulate`].
    pub fn run(
        &self,
        prepared: &Prepared<'_>,
        seed: u64,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Ran, Error> {
        let study = prepared.study();
        let mut simulation = self.simulation.clone();
        simulation.noise.seed = seed;
        simulation.plant = self.spread.drawn(study, &simulation.plant, seed)?;
        if self.design.observer.filter.is_some() {
            return sampled(prepared, &self.design, &simulation, watch);
        }
        let watch = &mut within(&study.budget, watch);
        let mut ran = Ran::together(&simulation, &self.design.observer, watch);
        let rows = ran.run.time.len();
        settle(&mut ran.course, rows, study, &study.file, is_answer)?;
        Ok(ran)
    }
}

/// Why a run ended before its end: a limit, or what the model does.
fn ended_early(error: lynkeus_run::Error, study: &Study) -> Error {
    match study.budget.marked() {
        Some(spent) => Error::ended(spent).at(&study.file),
        None => interrupted(error, &study.file),
    }
}

/// The plant alone, then a filter on what its sensors show: every row is a sample.
fn sampled(
    prepared: &Prepared<'_>,
    design: &Design,
    simulation: &Simulation,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Ran, Error> {
    let study = prepared.study();
    let watch = &mut within(&study.budget, watch);
    let mut run = alone(study, simulation, &mut |done| watch(0.5 * done))?;
    let samples = seen(prepared.plant(), &design.observer, &run);
    let mut course = estimate::course(prepared, design, &samples, &mut |done| {
        watch(0.5 + 0.5 * done)
    })?;
    let rows = course.estimates.first().map_or(0, Series::len);
    settle(&mut course, rows, study, &study.file, is_answer)?;
    run.truncate(rows);
    Ok(Ran { run, course })
}

/// The run of a plant without an observer.
///
/// # Errors
/// What ends it early.
pub(crate) fn alone(
    study: &Study,
    simulation: &Simulation,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Recorded, Error> {
    let mut run = Recorded::new(simulation);
    let done = simulation.run_into(&mut |time, row| run.push(time, row), watch);
    done.map_err(|error| ended_early(error, study))?;
    Ok(run)
}

/// What an observer reads of a plant's run: every row is a sample.
pub(crate) fn seen(plant: &Plant, observer: &Observer, run: &Recorded) -> Samples {
    let place = |variables: &[Variable], name: &str| variables.iter().position(|v| v.name == name);
    let column = |role: Role, at: Option<usize>| {
        let values = at.and_then(|i| run.column(role.at(i)));
        values.cloned().unwrap_or_default()
    };
    let readings = observer.measured.iter();
    let inputs = observer.inputs.iter();
    Samples {
        time: run.time.clone(),
        readings: readings
            .map(|s| column(Role::Measured, place(&plant.outputs, &s.name)))
            .collect(),
        inputs: inputs
            .map(|s| column(Role::Input, place(&plant.inputs, &s.name)))
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
    let watch = &mut |_| ControlFlow::Continue(());
    let run = alone(study, &simulation, &mut within(&study.budget, watch))?;
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
    let seen = seen.chain(inputs.clone());
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
pub(crate) fn open_loop(
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
    })
}

/// A run with what is to be said of it.
pub(crate) fn outcome(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    run: &Recorded,
    mut course: Course,
) -> Result<Outcome, Error> {
    let plant = prepared.plant();
    let deviations = prepared.study().estimate.deviations;
    let mut quantity = |variable: &Variable, role: Role, place: usize| {
        let estimates = &design.observer.estimates;
        let own = |e: &lynkeus_observers::Estimate| e.variable.node == variable.node;
        let estimated = estimates.iter().position(own);
        let mut quantity = Quantity {
            name: variable.name.clone(),
            unit: variable.unit.clone(),
            description: variable.description.clone(),
            truth: run.column(role.at(place)).cloned(),
            unknown_input: estimated.is_some_and(|i| estimates[i].unknown_input),
            is_input: role == Role::Input,
            ..Quantity::default()
        };
        if let Some(i) = estimated {
            course.give(i, deviations, &mut quantity);
        }
        quantity
    };
    let states = plant.states.iter().enumerate();
    let mut quantities: Vec<Quantity> = states.map(|(i, v)| quantity(v, Role::State, i)).collect();
    let inputs = plant.inputs.iter().enumerate();
    quantities.extend(inputs.map(|(i, v)| quantity(v, Role::Input, i)));
    let mut notes = design.notes.clone();
    let settings = prepared.study().simulate.as_ref();
    notes.extend(settings.and_then(|s| unlocated(plant, method(&s.method))));
    let measured = |signal: &lynkeus_observers::Signal| {
        let output = systems::output_of(plant, signal)?;
        run.column(Role::Measured.at(output)).cloned()
    };
    Raw {
        time: run.time.clone(),
        origin: None,
        quantities,
        measurements: measurements(&design, measured),
        replayed: false,
        frozen: vec![],
        intervals: None,
        notes,
        course,
        prepared,
        design,
    }
    .finish()
}
