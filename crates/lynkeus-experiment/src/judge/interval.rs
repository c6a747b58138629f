//! The interval between samples against what the observer stands.

use std::sync::OnceLock;

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
#[derive(Clone, Debug, PartialEq)]
pub struct Intervals {
    /// the time between two samples, the median of a log's
    pub interval: f64,
    /// whose samples these are
    pub of: Sampled,
    /// how the run went
    between: BetweenSamples,
    /// the error at some rows, never none
    errors: Vec<sampling::SampledError>,
    /// takes a thousand exponentials, and most runs need not know it
    predict: OnceLock<f64>,
}

/// The interval between samples, beside what the observer stands (an estimate, no proof).
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SamplingLimits {
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
    let interval = median_interval(samples)?;
    let errors = path.errors(prepared.augmented(), &design.observer)?;
    Intervals::new(interval, Sampled::Log, errors, prepared)
}

/// The interval of the study's simulation, where it is sampled, against the limits along its run,
/// of which these are the times and quantities.
pub fn simulated(
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
    let errors = path.errors(prepared.augmented(), observer)?;
    Intervals::new(step, Sampled::Simulation, errors, prepared)
}

/// A run of an observer: what it estimates and its inputs, row by row.
struct Path<'s> {
    time: &'s Series,
    estimates: Vec<&'s Series>,
    inputs: Vec<&'s Series>,
}

impl Path<'_> {
    /// The errors along the run that shrink with short intervals; none for filters, whose gains know
    /// the interval, and for observers with further states.
    fn errors(
        &self,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
    ) -> Option<Vec<sampling::SampledError>> {
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
            (M, C)
        };
        let mut all: Vec<(DMatrix<f64>, DMatrix<f64>)> =
            (0..rows).step_by(stride).map(at).collect();
        // that of a linear plant is the same everywhere
        all.dedup();
        let of = |(M, C): (DMatrix<f64>, DMatrix<f64>)| sampling::SampledError::new(M, &C);
        Some(all.into_iter().filter_map(of).collect())
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
    /// None where no error shrinks.
    fn new(
        interval: f64,
        of: Sampled,
        errors: Vec<sampling::SampledError>,
        prepared: &Prepared<'_>,
    ) -> Option<Self> {
        (!errors.is_empty()).then(|| Self {
            interval,
            of,
            between: prepared.study().estimate.between_samples,
            errors,
            predict: OnceLock::new(),
        })
    }

    /// With `between_samples = "predict"`: beyond it errors grow from sample to sample.
    #[must_use]
    pub fn predict(&self) -> f64 {
        let smallest =
            |least, error: &sampling::SampledError| f64::min(least, error.predict(least));
        let find = || self.errors.iter().fold(f64::INFINITY, smallest);
        *self.predict.get_or_init(find)
    }

    /// With held measurements: beyond it an observer follows the steps that holding makes.
    #[must_use]
    pub fn hold(&self) -> f64 {
        let limits = self.errors.iter().map(sampling::SampledError::hold);
        limits.fold(f64::INFINITY, f64::min)
    }

    /// Whether the readings are further apart than the observer stands. Readings that are
    /// interpolated show what comes, and no limit is known for them.
    #[must_use]
    pub fn is_beyond(&self) -> bool {
        match self.between {
            BetweenSamples::Predict => self.interval >= self.predict(),
            BetweenSamples::Hold => self.interval > self.hold(),
            BetweenSamples::Linear => false,
        }
    }

    /// Beside the limit in a few words, where the readings are beyond it.
    pub fn beyond(&self) -> Option<String> {
        self.is_beyond().then(|| {
            let (limit, how) = match self.between {
                BetweenSamples::Predict => (self.predict(), "predicted"),
                _ => (self.hold(), "held"),
            };
            format!(
                "the samples are {} apart, and {how} between them this observer stands about {} (an estimate, no proof)",
                figures(self.interval, 2),
                figures(limit, 2)
            )
        })
    }

    /// For machines; of a certificate, whether the interval is beyond the limits as well.
    pub fn entry(&self, of_certificate: bool) -> SamplingLimits {
        let of = |sampled| (self.of == sampled).then_some(self.interval);
        SamplingLimits {
            log: of(Sampled::Log),
            simulation: of(Sampled::Simulation),
            largest_predict: finite(self.predict()),
            largest_hold: finite(self.hold()),
            beyond: of_certificate.then(|| self.is_beyond()),
        }
    }

    /// What is to be said where the log's interval is beyond the limit.
    pub(crate) fn words(&self) -> Option<String> {
        if !self.is_beyond() {
            return None;
        }
        let interval = figures(self.interval, 2);
        let (predict, hold) = (figures(self.predict(), 2), figures(self.hold(), 2));
        let is_for_predict = self.interval < self.predict();
        match self.between {
            BetweenSamples::Predict => Some(format!(
                "the log's readings are {interval} apart, and this observer stands about {predict} with between_samples = \"predict\" (an estimate from its linearised error, no proof): a smaller theta, or family = \"ekf\""
            )),
            _ => {
                let remedy = match is_for_predict {
                    true => format!(
                        "between_samples = \"predict\", which stands {}, ",
                        match self.predict().is_finite() {
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
        // e' = −e/2 − K e, held for 2/K
        let K = 2.0 / hold;
        let M = DMatrix::from_row_slice(2, 2, &[-0.5 - K, K, -0.5, 0.0]);
        let error = sampling::SampledError::new(M, &DMatrix::identity(1, 1));
        let found = Intervals {
            interval,
            of: Sampled::Log,
            between: BetweenSamples::Hold,
            errors: error.into_iter().collect(),
            predict: predict.into(),
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
