//! Sensors that are not there yet, and what all sensors are expected to show.

use lynkeus_run::filter::{Likelihood, Limits};
use lynkeus_study::Noise;

use super::candidates::{Candidate, Experiment};
use super::extra::{Extra, one_in_a_hundred};
use crate::Error;
use crate::fit::logs::FittedLog;
use crate::fit::plant::{Further, Source};
use crate::fit::problem::Problem;
use crate::fit::search::Found;
use crate::fit::unknown::{Kind, Unknown};
use lynkeus_experiment::words::explain;

/// All of them, so that one likelihood serves every candidate: a sensor that does not report is none.
pub(super) struct Extras {
    pub all: Vec<Extra>,
}

impl Extras {
    /// Those of the candidates, each with the places of its own.
    pub fn of(candidates: Vec<Candidate>) -> (Self, Vec<(Candidate, Vec<usize>)>) {
        let mut all: Vec<Extra> = vec![];
        let planned = candidates.into_iter().map(|candidate| {
            let places = candidate.extras.iter().map(|extra| {
                let known = all.iter().position(|other| other == extra);
                known.unwrap_or_else(|| {
                    all.push(extra.clone());
                    all.len() - 1
                })
            });
            let places = places.collect();
            (candidate, places)
        });
        let planned = planned.collect();
        (Self { all }, planned)
    }

    /// Gives noises to those of which nothing is said, by how far they go in a log.
    ///
    /// # Errors
    /// As [`Predictor::predict`].
    pub fn settle(&mut self, predictor: &mut Predictor, log: &FittedLog) -> Result<(), Error> {
        if self.all.iter().all(|extra| extra.noise.is_some()) {
            return Ok(());
        }
        let places: Vec<usize> = (0..self.all.len()).collect();
        let mut again = Candidate::again(log).experiment(log, self.all.len(), &places)?;
        predictor.predict(&mut again)?;
        let [outputs, _] = again.widths;
        let first = outputs - self.all.len();
        for (i, extra) in self.all.iter_mut().enumerate() {
            let shown = again
                .readings
                .chunks_exact(outputs)
                .map(|row| row[first + i].abs());
            let reach = shown.filter(|y| y.is_finite()).fold(0.0, f64::max);
            let reach = if reach > 0.0 { reach } else { 1.0 };
            extra.noise.get_or_insert(one_in_a_hundred(reach));
        }
        Ok(())
    }
}

/// The likelihood of a log with these sensors, too.
///
/// # Errors
/// As [`Source::likelihood`].
pub(super) fn likelihood(
    source: Source<'_>,
    extras: &[Extra],
    own: &[(usize, &Unknown)],
    starts: &[f64],
) -> Result<Likelihood, Error> {
    let further: Vec<Further> = extras
        .iter()
        .map(|extra| Further {
            output: extra.node,
            // one whose noise is not known yet is read only for what it shows
            level: extra.noise.unwrap_or(Noise::Absolute(1.0)).into(),
            limits: extra.limits,
        })
        .collect();
    let source = Source {
        further: &further,
        ..source
    };
    source.likelihood(own, starts)
}

/// The plant alone at the values found.
pub(super) struct Predictor {
    likelihood: Likelihood,
    values: Vec<f64>,
    step: lynkeus_run::Step,
    /// by sensor
    limits: Vec<Option<Limits>>,
}

impl Predictor {
    /// # Errors
    /// As [`Source::likelihood`].
    pub fn new(
        source: Source<'_>,
        problem: &Problem<'_>,
        found: &Found,
        extras: &[Extra],
    ) -> Result<Self, Error> {
        let source = Source {
            is_alone: true,
            ..source
        };
        let (unknowns, values) = with_starts(problem, found);
        let own = own(problem, &unknowns);
        let outputs = source.symbolic.outputs.iter();
        let declared = &source.prepared.declared().limits;
        let limits = outputs.map(|o| declared.of(&o.variable.name).copied());
        let mut likelihood = likelihood(source, extras, &own, &problem.logs[0].starts)?;
        problem.steps.on(&mut likelihood);
        Ok(Self {
            likelihood,
            values: own.iter().map(|(place, _)| values[*place]).collect(),
            step: problem.steps.length,
            limits: limits
                .chain(extras.iter().map(|extra| extra.limits))
                .collect(),
        })
    }

    /// Puts what is expected in the place of every reading; false where the plant has no value.
    ///
    /// # Errors
    /// Steps of which there are too many.
    pub fn predict(&mut self, experiment: &mut Experiment) -> Result<bool, Error> {
        let [outputs, _] = experiment.widths;
        for row in experiment.readings.chunks_exact_mut(outputs) {
            for (reading, limits) in row.iter_mut().zip(&self.limits) {
                if reading.is_finite() {
                    *reading = inside(*limits);
                }
            }
        }
        let mut expected = experiment.readings.clone();
        let score = self
            .likelihood
            .watched(&self.values, experiment.rows(), self.step, |seen| {
                let shown = &mut expected[seen.row * outputs + seen.sensor];
                *shown -= seen.innovation;
                if let Some(limits) = self.limits[seen.sensor] {
                    *shown = shown.clamp(limits.low, limits.high);
                }
            });
        let score = score.map_err(explain)?;
        experiment.readings = expected;
        Ok(score.value.is_finite())
    }
}

/// A reading that is at no end of its range.
fn inside(limits: Option<Limits>) -> f64 {
    let Some(Limits { low, high }) = limits else {
        return 0.0;
    };
    match (low.is_finite(), high.is_finite()) {
        (true, true) => 0.5 * (low + high),
        (true, false) => low + low.abs() + 1.0,
        (false, true) => high - high.abs() - 1.0,
        (false, false) => 0.0,
    }
}

/// The values with the starts of the log to come, which are those of the first one.
pub(super) fn with_starts(problem: &Problem<'_>, found: &Found) -> (Vec<Unknown>, Vec<f64>) {
    let mut unknowns = problem.unknowns.to_vec();
    let mut values = problem.values(&found.point.z);
    let next = problem.logs.len();
    for (place, unknown) in problem.unknowns.iter().enumerate() {
        if let Kind::Start { state, log: 0 } = unknown.kind {
            unknowns.push(Unknown {
                kind: Kind::Start { state, log: next },
                ..unknown.clone()
            });
            values.push(values[place]);
        }
    }
    (unknowns, values)
}

/// Those that a log to come depends on, with their places.
pub(super) fn own<'u>(problem: &Problem<'_>, unknowns: &'u [Unknown]) -> Vec<(usize, &'u Unknown)> {
    let next = problem.logs.len();
    let is_own = |kind: Kind| !matches!(kind, Kind::Start { log, .. } if log != next);
    let all = unknowns.iter().enumerate();
    all.filter(|(_, unknown)| is_own(unknown.kind)).collect()
}
