//! An observer from its design to where it runs.

use std::fmt::Write;

use crate::filter::{FilterSettings, NoisyModel};
use crate::integrator::AUTO_PRODUCT;
use crate::jacobian::fastest;
use crate::snapshot::Digest;
use crate::system::Evaluation;
use crate::{EstimatorSettings, Events, Method, SampledObserver, System, Tuned};

/// An observer with all that says how it is run: every [`Estimator`](crate::Estimator) is made of
/// one, and what runs elsewhere (another language, a device) is printed from one.
#[derive(Clone, Debug)]
pub enum Blueprint {
    /// an observer whose sensors, if it has any, report when they do
    Sampled {
        /// its equations
        observer: Box<SampledObserver>,
        /// how it is integrated
        method: Method,
    },
    /// a Kalman filter
    Filter {
        /// the plant with its noises
        model: Box<NoisyModel>,
        /// which filter
        settings: FilterSettings,
        /// how it goes from sample to sample
        run: EstimatorSettings,
    },
}

impl Blueprint {
    /// Of an observer whose signals are all there at every sample.
    #[must_use]
    pub fn new(system: &System, settings: EstimatorSettings) -> Self {
        let observer = SampledObserver::of_inputs(system.clone(), settings.between);
        Self::Sampled {
            observer: Box::new(observer),
            method: settings.method,
        }
    }

    /// Names of the sensors, whose readings may be missing.
    pub(crate) fn sensors(&self) -> Vec<String> {
        match self {
            Self::Sampled { observer, .. } => observer.sensors.clone(),
            Self::Filter { model, .. } => model.sensors.iter().map(|s| s.name.clone()).collect(),
        }
    }

    /// Names of the known inputs.
    pub(crate) fn inputs(&self) -> &[String] {
        match self {
            Self::Sampled { observer, .. } => observer.known_inputs(),
            Self::Filter { model, .. } => model.flow.system().signals(),
        }
    }

    /// Names of what is estimated, monitors last.
    pub(crate) fn estimates(&self) -> &[String] {
        match self {
            Self::Sampled { observer, .. } => observer.estimates(),
            Self::Filter { model, .. } => model.flow.system().states(),
        }
    }

    /// A number that differs for observers with other equations, settings, noises or starts.
    pub(crate) fn fingerprint(&self) -> u64 {
        let mut digest = Digest::default();
        let signals = [&self.sensors()[..], self.inputs()].concat();
        // a digest takes any text
        let _ = write!(digest, "{signals:?} ");
        let _ = match self {
            Self::Sampled { observer, method } => {
                let SampledObserver {
                    system,
                    predict,
                    inputs,
                    errors,
                    tuned,
                    ..
                } = &**observer;
                system.tell(&mut digest);
                if let Some(errors) = errors {
                    errors.model.flow.system().tell(&mut digest);
                }
                if let Some(tuned) = tuned {
                    tuned.system.tell(&mut digest);
                    digest.numbers(&tuned.values);
                }
                let noises = errors.as_ref().map(|errors| errors.model.numbers());
                write!(digest, "{method:?} {predict} {inputs:?} {noises:?}")
            }
            Self::Filter {
                model,
                settings,
                run,
            } => {
                model.systems().for_each(|system| system.tell(&mut digest));
                write!(digest, "{settings:?} {run:?} {}", model.numbers())
            }
        };
        digest.value()
    }

    /// What runs between samples.
    #[must_use]
    pub fn flow(&self) -> &System {
        match self {
            Self::Sampled { observer, .. } => &observer.system,
            Self::Filter { model, .. } => model.flow.system(),
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

/// A step that a system needs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NeededStep {
    /// the longest that is short enough; infinite where nothing moves
    pub length: f64,
    /// a slope at the start is infinite, as that of a root at 0: that over a hundredth of the states' sizes
    /// counts instead
    pub is_steep: bool,
}

/// The longest fixed step that is short enough for the fastest mode at the start (|λ|·h ≤ ½), for
/// known inputs at these values, the others at 0; none where the equations have no slopes there.
/// `sizes` of the states count where a slope is infinite.
#[must_use]
pub fn needed_step(
    blueprint: &Blueprint,
    inputs: &[(&str, f64)],
    sizes: &[f64],
) -> Option<NeededStep> {
    let system = blueprint.flow();
    let tuned = match blueprint {
        Blueprint::Sampled { observer, .. } => observer.tuned.as_ref(),
        Blueprint::Filter { .. } => None,
    };
    let mut evaluation = system.evaluation();
    for (name, signal) in system.signals().iter().zip(evaluation.signals_mut()) {
        let given = inputs.iter().find(|(input, _)| input == name);
        *signal = given.map_or(0.0, |(_, value)| *value);
    }
    let tuned = tuned.map(Tuned::signals).unwrap_or_default();
    let signals = evaluation.signals_mut().iter_mut();
    for (signal, value) in signals.rev().zip(tuned.into_iter().rev()) {
        *signal = value;
    }
    step_of(&mut evaluation, system.start(), sizes)
}

/// The longest fixed step of a system under the signals that are set, as [`needed_step`] of an
/// estimator.
#[must_use]
pub fn step_of(evaluation: &mut Evaluation, start: &[f64], sizes: &[f64]) -> Option<NeededStep> {
    evaluation.enter(0.0);
    let seen = fastest(evaluation, 0.0, start, sizes);
    let length = AUTO_PRODUCT / seen.radius;
    (length > 0.0).then_some(NeededStep {
        length,
        is_steep: seen.is_steep,
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Graph;

    /// x' = -√x: slope 1/(2√x), infinite at 0, where the secant over a hundredth of 4 has 5.
    #[test]
    fn an_infinite_slope_is_seen_by_a_secant() {
        let g = Graph::new();
        let (t, x) = (g.symbol("t").node(), g.symbol("x"));
        let states = [("x".to_owned(), x.node(), 0.0)];
        let system = System::new(&g, t, &states, &[], &[(-x.sqrt()).node()], &[]).unwrap();
        let step = |start: f64, sizes: &[f64]| {
            let found = step_of(&mut system.evaluation(), &[start], sizes).unwrap();
            (found.length, found.is_steep)
        };
        assert_eq!(step(1.0, &[4.0]), (1.0, false));
        let near = |(length, is_steep): (f64, bool), expected: f64| {
            assert!(
                is_steep && (length / expected - 1.0).abs() < 1e-12,
                "{length}"
            );
        };
        near(step(0.0, &[4.0]), 0.1);
        near(step(0.0, &[]), 0.05);
    }
}
