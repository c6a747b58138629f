//! An observer from its design to where it runs.

use std::fmt::Write;

use crate::filter::{FilterSettings, NoisyModel};
use crate::integrator::AUTO_PRODUCT;
use crate::jacobian::{Fastest, fastest};
use crate::snapshot::Digest;
use crate::system::Evaluation;
use crate::{EstimatorSettings, Events, Method, System};

/// An observer with all that says how it is run: every [`Estimator`](crate::Estimator) is made of
/// one, and what runs elsewhere (another language, a device) is printed from one.
///
/// The signals of its flow are known inputs, then what its [updates](Updates) need. It reports
/// [`System::estimates`], monitors last.
#[derive(Clone, Debug)]
pub struct Blueprint {
    /// what runs between samples
    pub flow: System,
    /// names of the measured outputs, whose readings may be missing
    pub sensors: Vec<String>,
    /// how it goes from sample to sample
    pub run: EstimatorSettings,
    /// what readings do
    pub updates: Updates,
    /// readings are judged by what is expected of them, where errors are followed
    pub judges: bool,
}

/// What the readings of sensors do.
#[derive(Clone, Debug)]
pub enum Updates {
    /// Measurements are states of their own: w jumps to a reading when the sensor reports, and in
    /// between stays (`hold`) or follows the model, w' = L_f h(x̂) (the inter-sample predictor of
    /// Karafyllis and Kravaris, *From continuous-time design to sampled-data design of observers*, 2009).
    ///
    /// The flow is z' = F(t, z, u, w). With one for each of the sensors, its last states are w; its
    /// signals are known inputs, then whether w follows the model (1) or stays (0), then what `tuned`
    /// makes; its last outputs are h(x̂).
    Jumps {
        /// w follows the model also after a reading, not only where one is missing
        predict: bool,
        /// how errors spread, where standard deviations are asked for
        errors: Option<Box<NoisyModel>>,
        /// numbers of the equations that may be changed while it runs elsewhere; here they stay
        tuned: Option<Tuned>,
    },
    /// A Kalman filter corrects its estimate.
    Filter {
        /// the plant with its noises
        model: Box<NoisyModel>,
        /// which filter
        settings: FilterSettings,
    },
}

/// Numbers of an observer's equations, and what the equations make of them.
#[derive(Clone, Debug)]
pub struct Tuned {
    /// without states: its signals are the numbers, its outputs the last signals of the observer
    pub system: System,
    /// the numbers
    pub values: Vec<f64>,
}

impl Tuned {
    /// The last signals of the observer.
    pub fn signals(&self) -> Vec<f64> {
        let mut evaluation = self.system.evaluation();
        evaluation.signals_mut().copy_from_slice(&self.values);
        let mut signals = vec![0.0; self.system.outputs().len()];
        evaluation.outputs(0.0, &[], &mut signals);
        signals
    }
}

impl Blueprint {
    /// Of an observer whose signals are all there at every sample.
    #[must_use]
    pub fn new(system: &System, run: EstimatorSettings) -> Self {
        Self {
            flow: system.clone(),
            sensors: vec![],
            run,
            updates: Updates::Jumps {
                predict: false,
                errors: None,
                tuned: None,
            },
            judges: false,
        }
    }

    /// A Kalman filter.
    #[must_use]
    pub fn filter(model: NoisyModel, settings: FilterSettings, run: EstimatorSettings) -> Self {
        Self {
            flow: model.flow.system().clone(),
            sensors: model.sensors.iter().map(|s| s.name.clone()).collect(),
            run,
            updates: Updates::Filter {
                model: Box::new(model),
                settings,
            },
            judges: true,
        }
    }

    /// The same, integrated by another method.
    #[must_use]
    pub fn with_method(mut self, method: Method) -> Self {
        self.run.method = method;
        self
    }

    /// What is made of the numbers that may be changed.
    pub(crate) fn tuned(&self) -> Option<&Tuned> {
        match &self.updates {
            Updates::Jumps { tuned, .. } => tuned.as_ref(),
            Updates::Filter { .. } => None,
        }
    }

    /// Names of the known inputs.
    pub(crate) fn inputs(&self) -> &[String] {
        let follow = match self.updates {
            Updates::Jumps { .. } => self.sensors.len(),
            Updates::Filter { .. } => 0,
        };
        let tuned = self.tuned().map_or(0, |t| t.system.outputs().len());
        let signals = self.flow.signals();
        &signals[..signals.len().saturating_sub(follow + tuned)]
    }

    /// Names of what is estimated, monitors last.
    pub(crate) fn estimates(&self) -> &[String] {
        match self.updates {
            Updates::Jumps { .. } => {
                let names = self.flow.estimates();
                &names[..names.len().saturating_sub(self.sensors.len())]
            }
            Updates::Filter { ref model, .. } => {
                let names = self.flow.states();
                &names[..names.len().saturating_sub(model.drawn)]
            }
        }
    }

    /// A number that differs for observers with other equations, settings, noises or starts.
    pub(crate) fn fingerprint(&self) -> u64 {
        let mut digest = Digest::default();
        let inputs = self.inputs();
        // a digest takes any text
        let _ = write!(digest, "{:?} {inputs:?} {:?}", self.sensors, self.run);
        self.flow.tell(&mut digest);
        let model = match &self.updates {
            Updates::Jumps {
                predict,
                errors,
                tuned,
            } => {
                let _ = write!(digest, "{predict}");
                if let Some(tuned) = tuned {
                    tuned.system.tell(&mut digest);
                    digest.numbers(&tuned.values);
                }
                errors.as_ref()
            }
            Updates::Filter { model, settings } => {
                let _ = write!(digest, "{settings:?}");
                Some(model)
            }
        };
        if let Some(model) = model {
            model.tell(&mut digest);
        }
        digest.value()
    }
}

impl Fastest {
    /// The longest fixed step that is short enough (|λ|·h ≤ ½); infinite where nothing moves.
    #[must_use]
    pub fn step(&self) -> f64 {
        AUTO_PRODUCT / self.radius
    }
}

/// The fastest mode at the start, for known inputs at these values, the others at 0; none where the
/// equations have no slopes there. `sizes` of the states count where a slope is infinite.
#[must_use]
pub fn fastest_mode(
    blueprint: &Blueprint,
    inputs: &[(&str, f64)],
    sizes: &[f64],
) -> Option<Fastest> {
    let system = &blueprint.flow;
    let mut evaluation = system.evaluation();
    for (name, signal) in system.signals().iter().zip(evaluation.signals_mut()) {
        let given = inputs.iter().find(|(input, _)| input == name);
        *signal = given.map_or(0.0, |(_, value)| *value);
    }
    let tuned = blueprint.tuned().map(Tuned::signals).unwrap_or_default();
    let signals = evaluation.signals_mut().iter_mut();
    for (signal, value) in signals.rev().zip(tuned.into_iter().rev()) {
        *signal = value;
    }
    fastest_at(&mut evaluation, system.start(), sizes)
}

/// The fastest mode of a system under the signals that are set, as [`fastest_mode`] of an
/// estimator.
#[must_use]
pub fn fastest_at(evaluation: &mut Evaluation, start: &[f64], sizes: &[f64]) -> Option<Fastest> {
    evaluation.enter(0.0);
    let seen = fastest(evaluation, 0.0, start, Some(sizes));
    (seen.step() > 0.0).then_some(seen)
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
            let found = fastest_at(&mut system.evaluation(), &[start], sizes).unwrap();
            (found.step(), found.is_steep)
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
