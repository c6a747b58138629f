//! What an estimator is made of.

use crate::filter::{FilterModel, FilterSettings};
use crate::integrator::AUTO_PRODUCT;
use crate::system::Evaluation;
use crate::{
    Dynamics, Error, Estimator, EstimatorSettings, Method, SampledObserver, System, spectral_radius,
};

/// An observer with all that says how it is run: an [`Estimator`] is made of one, and what runs
/// elsewhere (another language, a device) is printed from one.
#[derive(Clone, Debug)]
pub enum Blueprint {
    /// an observer whose sensors report when they do
    Sampled {
        /// its equations
        observer: Box<SampledObserver>,
        /// how it is integrated
        method: Method,
    },
    /// a Kalman filter
    Filter {
        /// the plant with its noises
        model: Box<FilterModel>,
        /// which filter
        settings: FilterSettings,
        /// how it goes from sample to sample
        run: EstimatorSettings,
    },
}

impl Blueprint {
    /// The estimator, at its start.
    ///
    /// # Errors
    /// As [`Estimator::sampled`] and [`Estimator::filter`].
    pub fn estimator(&self) -> Result<Estimator, Error> {
        match self {
            Self::Sampled { observer, method } => Estimator::sampled(observer, *method),
            Self::Filter {
                model,
                settings,
                run,
            } => Estimator::filter(model, settings.clone(), *run),
        }
    }

    /// What runs between samples.
    #[must_use]
    pub fn flow(&self) -> &System {
        match self {
            Self::Sampled { observer, .. } => &observer.system,
            Self::Filter { model, .. } => model.flow(),
        }
    }

    /// How it is integrated.
    #[must_use]
    pub fn method(&self) -> Method {
        match self {
            Self::Sampled { method, .. } => *method,
            Self::Filter { run, .. } => run.method,
        }
    }

    /// The same, integrated by another method.
    #[must_use]
    pub fn with_method(mut self, by: Method) -> Self {
        match &mut self {
            Self::Sampled { method, .. } => *method = by,
            Self::Filter { run, .. } => run.method = by,
        }
        self
    }
}

/// The longest fixed step that is short enough for the fastest mode at the start (|λ|·h ≤ ½), for
/// known inputs at these values, the others at 0; infinite where nothing moves, none where the
/// equations have no slopes there.
#[must_use]
pub fn needed_step(blueprint: &Blueprint, inputs: &[(&str, f64)]) -> Option<f64> {
    let system = blueprint.flow();
    let mut evaluation = system.evaluation();
    for (name, signal) in system.signals().iter().zip(evaluation.signals_mut()) {
        let given = inputs.iter().find(|(input, _)| input == name);
        *signal = given.map_or(0.0, |(_, value)| *value);
    }
    step_of(&mut evaluation, system.start())
}

/// The longest fixed step of a system under the signals that are set, as [`needed_step`] of an
/// estimator.
#[must_use]
pub fn step_of(evaluation: &mut Evaluation, start: &[f64]) -> Option<f64> {
    evaluation.enter(0.0);
    let needed = AUTO_PRODUCT / spectral_radius(evaluation, 0.0, start);
    (needed > 0.0).then_some(needed)
}
