//! An observer whose signals are all known at every sample.

use crate::divergence::Bound;
use crate::driven::Driven;
use crate::filter::Health;
use crate::intake::Sample;
use crate::runner::Runner;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, EstimatorSettings, Events, Integrator, StepAdvice, System};

#[derive(Clone, Debug)]
pub(crate) struct Flow {
    driven: Driven,
    integrator: Integrator,
    x: Vec<f64>,
    estimates: Vec<f64>,
    bound: Bound,
    health: Health,
}

impl Flow {
    pub fn new(observer: &System, settings: EstimatorSettings) -> Result<Self, Error> {
        Ok(Self {
            integrator: Integrator::new(settings.method, observer.states().len())?,
            x: observer.start().to_vec(),
            estimates: vec![0.0; observer.estimates().len()],
            bound: Bound::new(observer.start()),
            driven: Driven::new(observer, settings.between),
            health: Health::default(),
        })
    }

    pub fn state(&self) -> &[f64] {
        &self.x
    }

    pub fn advice(&self) -> Option<StepAdvice> {
        self.integrator.advice()
    }
}

impl Runner for Flow {
    fn begin(&mut self, _: &Sample<'_>) -> Result<(), Error> {
        Ok(())
    }

    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<(), Error> {
        self.driven.aim(from, sample.t, sample.inputs);
        let done = self
            .integrator
            .advance(&mut self.driven, from, sample.t, &mut self.x);
        let scale = self.bound.scale();
        let evaluation = &mut self.driven.evaluation;
        done.map_err(|error| evaluation.explained(error, &self.x, scale))?;
        self.driven.arrive();
        Ok(())
    }

    fn update(&mut self, sample: &Sample<'_>) -> Result<(), Error> {
        self.health.inputs_held += sample.held;
        self.bound.see(sample.inputs);
        self.driven.start(sample.inputs);
        Ok(())
    }

    fn report(&mut self, t: f64) -> Result<(), Error> {
        let names = self.driven.evaluation.system().states();
        let inside = self
            .bound
            .check(t, names, &self.x, || self.integrator.hint());
        let evaluation = &mut self.driven.evaluation;
        let scale = self.bound.scale();
        inside.map_err(|error| evaluation.explained(error, &self.x, scale))?;
        evaluation.enter(t);
        evaluation.estimates(t, &self.x, &mut self.estimates);
        match self.estimates.iter().all(|v| v.is_finite()) {
            true => Ok(()),
            false => Err(evaluation.not_finite(t, &self.x)),
        }
    }

    fn estimate(&self) -> &[f64] {
        &self.estimates
    }

    fn health(&self) -> &Health {
        &self.health
    }
}

impl Persist for Flow {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.integrator.walk(walk)?;
        walk.numbers(&mut self.x)?;
        walk.numbers(&mut self.estimates)?;
        self.bound.walk(walk)?;
        self.health.walk(walk)
    }
}
