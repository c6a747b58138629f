//! The interval between samples against what the observer stands.

use lynkeus_expr::{Node, Tape, jacobian};
use lynkeus_gain::sampling;
use lynkeus_observers::{Design, Observer};
use lynkeus_structure::AugmentedPlant;
use lynkeus_words::figures;
use nalgebra::DMatrix;
use serde::Serialize;

use crate::course::{Course, Samples};
use crate::entries::finite;
use crate::prepare::Prepared;
use crate::{Quantity, Series, prepare::systems};
use lynkeus_study::BetweenSamples;
use lynkeus_table::series::{Sorted, points, steps};

/// Rows of the log at which the error is linearised.
const PLACES: usize = 12;

/// What is sampled.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Sampled {
    /// the plant itself: a log of its sensors
    Log,
    /// the simulation that the study states, where there is no log
    Simulation,
}

/// The sampling interval of a log or of a simulation, and estimates of the largest that the observer
/// stands: from its linearised error along the estimate, no proof.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Intervals {
    /// the time between two samples, the median of a log's
    pub interval: f64,
    /// whose samples these are
    pub of: Sampled,
    /// with `between_samples = "predict"`: beyond it errors grow from sample to sample
    pub predict: f64,
    /// with held measurements: beyond it an observer follows the steps that holding makes
    pub hold: f64,
    /// how the run went
    between: BetweenSamples,
}

/// The interval between samples, beside what the observer stands (an estimate, no proof).
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct SamplingLimits {
    /// the interval of the log
    #[serde(skip_serializing_if = "Option::is_none")]
    log: Option<f64>,
    /// the interval of the simulation
    #[serde(skip_serializing_if = "Option::is_none")]
    simulation: Option<f64>,
    /// the largest with `between_samples = "predict"`
    largest_predict: Option<f64>,
    /// the largest with held measurements
    largest_hold: Option<f64>,
    /// whether the study's is beyond them; of certificates
    #[serde(skip_serializing_if = "Option::is_none")]
    beyond: Option<bool>,
}

/// The interval of a log against the limits along the run.
pub(crate) fn intervals(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    course: &Course,
) -> Option<Intervals> {
    let path = Path {
        time: &samples.time,
        estimates: course.estimates.iter().collect(),
        inputs: samples.inputs.iter().collect(),
    };
    let limits = path.limits(prepared.augmented(), &design.observer)?;
    let interval = median_interval(samples)?;
    Some(Intervals::new(interval, Sampled::Log, limits, prepared))
}

/// The interval of the study's simulation, where it is sampled, against the limits along its run,
/// of which these are the times and quantities.
pub(crate) fn simulated(
    prepared: &Prepared<'_>,
    design: &Design,
    time: &Series,
    quantities: &[Quantity],
) -> Option<Intervals> {
    let study = prepared.study();
    let noise = &prepared.declared().noise;
    let noisy = noise.iter().any(|(_, noise)| noise.size() > 0.0);
    let settings = study.simulate.as_ref().filter(|_| noisy)?;
    let step = systems::sampled_every(study, settings)?;
    let of = |name: &str| quantities.iter().find(|q| q.name == name);
    let observer = &design.observer;
    let estimates = observer.estimates.iter();
    let inputs = observer.inputs.iter();
    let path = Path {
        time,
        estimates: estimates
            .map(|e| of(&e.variable.name)?.estimate.as_ref())
            .collect::<Option<_>>()?,
        inputs: inputs
            .map(|u| of(&u.name)?.truth.as_ref())
            .collect::<Option<_>>()?,
    };
    let limits = path.limits(prepared.augmented(), observer)?;
    Some(Intervals::new(step, Sampled::Simulation, limits, prepared))
}

/// A run of an observer: what it estimates and its inputs, row by row.
struct Path<'s> {
    time: &'s Series,
    estimates: Vec<&'s Series>,
    inputs: Vec<&'s Series>,
}

impl Path<'_> {
    /// The smallest limits along the run; none for filters, whose gains know the interval, for
    /// observers with further states, and where errors do not shrink.
    fn limits(
        &self,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
    ) -> Option<sampling::Limits> {
        let is_estimate = observer
            .states
            .iter()
            .map(|(signal, _)| signal.symbol)
            .eq(observer.estimates.iter().map(|e| e.node));
        if observer.filter.is_some() || !is_estimate || !observer.input_derivatives.is_empty() {
            return None;
        }
        let lynkeus_observers::Sampled {
            observer: sampled,
            outputs,
            ..
        } = observer.sampled(augmented).ok()?;
        let states: Vec<Node> = sampled.states.iter().map(|(s, _)| s.symbol).collect();
        let graph = augmented.graph();
        let slopes = jacobian::forward(graph, &sampled.derivatives, &states);
        let views = jacobian::forward(graph, &outputs, &states[..observer.states.len()]);
        let entries = slopes.entries.iter().chain(&views.entries);
        let nodes: Vec<Node> = entries.map(|entry| entry.2).collect();
        let inputs = sampled.inputs.iter().map(|s| s.symbol);
        let symbols = std::iter::once(sampled.time).chain(states.iter().copied());
        let symbols: Vec<Node> = symbols.chain(inputs).collect();
        let slope_values = Tape::new(graph, &symbols, &nodes).ok()?;
        let expected = Tape::new(graph, &symbols, &outputs).ok()?;
        let sensors = outputs.len();
        let rows = self.estimates.first()?.len();
        let value = |column: &Series, row| column.get(row).unwrap_or(f64::NAN);
        let stride = rows.div_ceil(PLACES).max(1);
        let at = |row: usize| {
            let mut values = vec![value(self.time, row)];
            values.extend(self.estimates.iter().map(|column| value(column, row)));
            let first = values.len();
            values.extend(std::iter::repeat_n(0.0, sensors));
            values.extend(self.inputs.iter().map(|u| value(u, row)));
            // every measurement follows the model
            values.extend(std::iter::repeat_n(1.0, sensors));
            let mut y = vec![0.0; sensors];
            expected.evaluator().eval(&values, &mut y);
            values[first..first + sensors].copy_from_slice(&y);
            let mut entries = vec![0.0; nodes.len()];
            slope_values.evaluator().eval(&values, &mut entries);
            let mut M = DMatrix::zeros(states.len(), states.len());
            for (&(i, j, _), value) in slopes.entries.iter().zip(&entries) {
                M[(i, j)] += value;
            }
            let mut C = DMatrix::zeros(sensors, states.len() - sensors);
            let rest = entries.iter().skip(slopes.entries.len());
            for (&(i, j, _), value) in views.entries.iter().zip(rest) {
                C[(i, j)] += value;
            }
            sampling::limits(&M, &C)
        };
        let found: Vec<sampling::Limits> = (0..rows).step_by(stride).filter_map(at).collect();
        let smallest = |of: fn(&sampling::Limits) -> f64| found.iter().map(of).reduce(f64::min);
        Some(sampling::Limits {
            predict: smallest(|l| l.predict)?,
            hold: smallest(|l| l.hold)?,
        })
    }
}

/// The median time from one reading of a sensor to its next, of the slowest sensor.
fn median_interval(samples: &Samples) -> Option<f64> {
    let of = |readings: &Series| {
        let times = points(&samples.time, readings).map(|p| p.0);
        Sorted::new(samples.time.store(), steps(times)).median()
    };
    samples.readings.iter().filter_map(of).reduce(f64::max)
}

impl Intervals {
    fn new(interval: f64, of: Sampled, limits: sampling::Limits, prepared: &Prepared<'_>) -> Self {
        Self {
            interval,
            of,
            predict: limits.predict,
            hold: limits.hold,
            between: prepared.study().estimate.between_samples,
        }
    }

    /// Whether the readings are further apart than the observer stands. Readings that are
    /// interpolated show what comes, and no limit is known for them.
    #[must_use]
    pub fn is_beyond(&self) -> bool {
        match self.between {
            BetweenSamples::Predict => self.interval >= self.predict,
            BetweenSamples::Hold => self.interval > self.hold,
            BetweenSamples::Linear => false,
        }
    }

    /// Beside the limit in a few words, where the readings are beyond it.
    pub(crate) fn beyond(&self) -> Option<String> {
        let (limit, how) = match self.between {
            BetweenSamples::Predict => (self.predict, "predicted"),
            _ => (self.hold, "held"),
        };
        self.is_beyond().then(|| {
            format!(
                "the samples are {} apart, and {how} between them this observer stands about {} (an estimate, no proof)",
                figures(self.interval, 2),
                figures(limit, 2)
            )
        })
    }

    /// For machines; of a certificate, whether the interval is beyond the limits as well.
    pub(crate) fn entry(&self, of_certificate: bool) -> SamplingLimits {
        let of = |sampled| (self.of == sampled).then_some(self.interval);
        SamplingLimits {
            log: of(Sampled::Log),
            simulation: of(Sampled::Simulation),
            largest_predict: finite(self.predict),
            largest_hold: finite(self.hold),
            beyond: of_certificate.then(|| self.is_beyond()),
        }
    }

    /// What is to be said where the log's interval is beyond the limit.
    pub(crate) fn words(&self) -> Option<String> {
        let interval = figures(self.interval, 2);
        let (predict, hold) = (figures(self.predict, 2), figures(self.hold, 2));
        let is_for_predict = self.interval < self.predict;
        match self.between {
            _ if !self.is_beyond() => None,
            BetweenSamples::Predict => Some(format!(
                "the log's readings are {interval} apart, and this observer stands about {predict} with between_samples = \"predict\" (an estimate from its linearised error, no proof): a smaller theta, or family = \"ekf\""
            )),
            _ => {
                let remedy = match is_for_predict {
                    true => format!(
                        "between_samples = \"predict\", which stands {}, ",
                        match self.predict.is_finite() {
                            true => format!("about {predict}"),
                            false => "any interval".to_owned(),
                        }
                    ),
                    false => String::new(),
                };
                Some(format!(
                    "the log's readings are {interval} apart, and beyond about {hold} this observer follows the steps that holding them makes (an estimate from its linearised error, no proof): {remedy}a smaller theta, or family = \"ekf\""
                ))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn words(interval: f64, predict: f64, hold: f64) -> String {
        let between = BetweenSamples::Hold;
        let found = Intervals {
            interval,
            of: Sampled::Log,
            predict,
            hold,
            between,
        };
        found.words().unwrap_or_default()
    }

    #[test]
    fn a_limit_that_there_is_not_is_any_interval() {
        let endless = words(1.0, f64::INFINITY, 0.1);
        assert!(
            endless.contains("\"predict\", which stands any interval, a smaller theta"),
            "{endless}"
        );
        assert!(words(1.0, 3.5, 0.1).contains("which stands about 3.5, "));
        assert!(!words(1.0, 0.5, 0.1).contains("\"predict\""));
        assert_eq!(words(0.05, f64::INFINITY, 0.1), "");
    }
}
