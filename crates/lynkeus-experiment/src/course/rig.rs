//! A study's plant with its observer, run after run.

use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::Design;
use lynkeus_run::{Simulation, System};

use crate::course::curved;
use crate::course::ended::{is_answer, settle};
use crate::course::plant::{
    Ran, Shown, closed_loop, noise, open_loop, sample_step, shown, stirred,
};
use crate::course::run::course;
use crate::crew::within;
use crate::prepare::spread::Spread;
use crate::prepare::systems::{self, settings};
use crate::prepare::{self, Prepared, StudyDesign};
use crate::words::explain;
use crate::{Error, Series, Study};

/// A study's plant with its observer, ready for the run of any seed.
#[derive(Clone, Debug)]
pub struct Rig {
    /// the observer
    pub design: StudyDesign,
    /// a filter works on what the plant's sensors show, and is not in it
    pub simulation: Simulation,
    spread: Spread,
    /// what is to be said of every run
    pub notes: Vec<String>,
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
    /// As [`simulate`](crate::simulate()).
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

/// The plant alone, then a filter on what its sensors show: every row is a sample.
fn sampled(
    prepared: &Prepared<'_>,
    design: &Design,
    simulation: &Simulation,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Ran, Error> {
    let study = prepared.study();
    let watch = &mut within(&study.budget, watch);
    let first = &mut |done| watch(0.5 * done);
    let shown = shown(study, prepared.plant(), &design.observer, simulation, first)?;
    let Shown { mut run, samples } = shown;
    let mut course = course(prepared, design, &samples, &mut |done| {
        watch(0.5 + 0.5 * done)
    })?;
    let rows = course.estimates.first().map_or(0, Series::len);
    settle(&mut course, rows, study, &study.file, is_answer)?;
    run.truncate(rows);
    curved::beside_truth(prepared.plant(), &design.observer, &run, &mut course);
    Ok(Ran { run, course })
}
