//! Which experiment would tell most: how well the values would be known with one more log.
//!
//! The information of the logs, at the values found, and that of a log that does not exist yet add up. A log's own is
//! Fisher's, along the readings that the plant is expected to show: these need no noise, since ν = 0 is its mean and
//! its sensitivities do not depend on it (G. C. Goodwin and R. L. Payne, *Dynamic System Identification: Experiment
//! Design and Data Analysis*, 1977). The criteria are those of A. C. Atkinson and A. N. Donev, *Optimum Experimental
//! Designs*, 1992.

mod candidates;
mod extra;
mod extras;

use lynkeus_run::filter::Likelihood;
use nalgebra::{Cholesky, DMatrix};
use serde::Serialize;

use super::known::{Knowledge, knowledge};
use super::plant::Source;
use super::problem::Problem;
use super::search::{Found, positive};
use super::unknown::{Kind, Unknown};
use crate::Error;
pub(super) use candidates::Candidate;
use candidates::Experiment;
use extra::Extra;
use extras::{Predictor, own, with_starts};
use lynkeus_experiment::entries::{Named, finite};
use lynkeus_experiment::words::explain;

/// What is known of the next experiment.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ahead {
    /// the value that is known worst from the logs alone, with its relative standard error
    pub now: Option<(String, f64)>,
    /// the best first
    pub tried: Vec<NextExperiment>,
}

/// How well the values would be known with one more log.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct NextExperiment {
    /// what is done: a name of the study's, or words
    pub name: String,
    /// rows of the log
    pub rows: usize,
    /// readings in it
    pub readings: usize,
    /// from its first row to its last
    pub duration: f64,
    /// sensors beside the study's, with their noise
    pub sensors: Vec<String>,
    /// the value that would then be known worst, as a share of it
    pub worst: Option<String>,
    /// its relative standard error
    pub relative_sd: Option<f64>,
    /// the same over that of the value that is known worst now; none where the logs do not determine all values
    pub factor: Option<f64>,
    /// the D criterion: volume of the ellipsoid of errors over what it is now
    pub volume: Option<f64>,
    /// the A criterion: sum of the squared relative standard errors over what it is now
    pub trace: Option<f64>,
    /// the standard error of each value, by what `correlation` calls it
    pub sd: Named<Option<f64>>,
    /// what the logs do not determine, and would with this one
    pub determines: Vec<String>,
    /// what they would not tell even so
    pub undetermined: Vec<String>,
}

/// Tries candidates; also told is what the user should know.
///
/// # Errors
/// As [`Source::likelihood`].
pub(super) fn ahead(
    source: Source<'_>,
    planned: Vec<Candidate>,
    problem: &Problem<'_>,
    found: &Found,
) -> Result<(Ahead, Vec<String>), Error> {
    let mut notes = vec![];
    let Some(log) = problem.logs.first() else {
        return Ok((Ahead::default(), notes));
    };
    let (mut extras, planned) = extras::Extras::of(planned);
    let mut predictor = Predictor::new(source, problem, found, &extras.all)?;
    extras.settle(&mut predictor, log)?;
    let mut judge = Judge::new(source, problem, found, &extras.all)?;
    let now = knowledge(&judge.logs, &judge.free);
    let mut tried = vec![];
    let count = planned.len();
    for (k, (candidate, places)) in planned.into_iter().enumerate() {
        if problem.is_spent() {
            notes.push(format!(
                "a limit left out {} of {count} candidates for the next experiment",
                count - k
            ));
            break;
        }
        let sensors: Vec<&Extra> = places.iter().map(|&i| &extras.all[i]).collect();
        let name = candidate.words(&sensors);
        // the answer does not fall with one candidate
        let experiment = candidate.experiment(log, extras.all.len(), &places);
        let (experiment, then) = match experiment.and_then(|e| judge.tried(&mut predictor, e)) {
            Ok(tried) => tried,
            Err(error) => {
                notes.push(format!("the next experiment, {name}: {error}"));
                continue;
            }
        };
        if then.is_none() {
            notes.push(format!(
                "the next experiment, {name}: the plant has no value there"
            ));
        }
        for input in experiment.beyond(&source.symbolic.inputs) {
            notes.push(format!(
                "the next experiment, {name}: {input} leaves its declared range"
            ));
        }
        let sensors = sensors.iter().map(|extra| extra.words()).collect();
        tried.push(judge.told(&now, then, name, sensors, &experiment));
    }
    let key = |next: &NextExperiment| {
        let unknown = next.undetermined.len() + usize::from(next.sd.is_empty());
        (unknown, next.relative_sd.unwrap_or(f64::INFINITY))
    };
    tried.sort_by(|a, b| {
        let (a, b) = (key(a), key(b));
        a.0.cmp(&b.0).then(a.1.total_cmp(&b.1))
    });
    // starts of the log to come are not what these logs should tell
    let is_told = now.flat.iter().all(|&i| i >= problem.unknowns.len());
    let now = judge.worst(&now).filter(|_| is_told);
    let now = now.map(|(place, share)| (judge.unknowns[place].label(), share));
    Ok((Ahead { now, tried }, notes))
}

/// The values with what the logs tell of them.
struct Judge<'p, 'l> {
    problem: &'p Problem<'l>,
    /// those of the logs, then the starts of the log to come
    unknowns: Vec<Unknown>,
    values: Vec<f64>,
    /// what is judged: not at a bound
    free: Vec<usize>,
    /// places of what the log to come depends on
    places: Vec<usize>,
    likelihood: Likelihood,
    /// the information of the logs
    logs: DMatrix<f64>,
}

impl<'p, 'l> Judge<'p, 'l> {
    fn new(
        source: Source<'_>,
        problem: &'p Problem<'l>,
        found: &Found,
        extras: &[Extra],
    ) -> Result<Self, Error> {
        let (unknowns, values) = with_starts(problem, found);
        let own = own(problem, &unknowns);
        let starts = &problem.logs[0].starts;
        let mut likelihood = extras::likelihood(source, extras, &own, starts)?;
        problem.steps.on(&mut likelihood);
        let places = own.iter().map(|(place, _)| *place).collect();
        let told = problem.unknowns.len();
        let free: Vec<usize> = (0..told).filter(|&i| !found.is_bound[i]).collect();
        let hessian = DMatrix::from_fn(free.len(), free.len(), |i, j| {
            found.hessian[(free[i], free[j])]
        });
        // where it has no inverse, what scoring takes
        let matrix = match positive(hessian) {
            Some(_) => &found.hessian,
            None => &found.point.information,
        };
        let n = unknowns.len();
        let mut logs = DMatrix::zeros(n, n);
        for &i in &free {
            for &j in &free {
                logs[(i, j)] = matrix[(i, j)];
            }
        }
        for (i, unknown) in unknowns.iter().enumerate().skip(told) {
            let prior = unknown.prior.map(|prior| prior.sd.powi(-2));
            logs[(i, i)] = prior.unwrap_or(0.0);
        }
        Ok(Self {
            problem,
            free: free.into_iter().chain(told..n).collect(),
            unknowns,
            values,
            places,
            likelihood,
            logs,
        })
    }

    /// An experiment with what is expected of it, and what would be known; none where the plant has no value.
    fn tried(
        &mut self,
        predictor: &mut Predictor,
        mut experiment: Experiment,
    ) -> Result<(Experiment, Option<Knowledge>), Error> {
        let then = match predictor.predict(&mut experiment)? {
            true => self.after(&experiment)?,
            false => None,
        };
        Ok((experiment, then))
    }

    /// What would be known; none where the plant has no value.
    fn after(&mut self, experiment: &Experiment) -> Result<Option<Knowledge>, Error> {
        let own: Vec<f64> = self.places.iter().map(|&p| self.values[p]).collect();
        let score = self
            .likelihood
            .score(&own, experiment.rows(), self.problem.steps.length)
            .map_err(explain)?;
        if !score.value.is_finite() || score.information.iter().any(|x| !x.is_finite()) {
            return Ok(None);
        }
        let slope = |i: usize| self.unknowns[i].slope(self.values[i]);
        let mut all = self.logs.clone();
        let count = self.places.len();
        for (i, &p) in self.places.iter().enumerate() {
            for (j, &q) in self.places.iter().enumerate() {
                all[(p, q)] += score.information[i * count + j] * slope(p) * slope(q);
            }
        }
        Ok(Some(knowledge(&all, &self.free)))
    }

    /// The values that are judged: the parameters, else noises and densities, else what there is.
    fn judged(&self) -> Vec<usize> {
        let told = self.problem.unknowns.len();
        let of = |is_asked: fn(Kind) -> bool| -> Vec<usize> {
            let free = self.free.iter().copied().filter(|&i| i < told);
            free.filter(|&i| is_asked(self.unknowns[i].kind)).collect()
        };
        let kinds: [fn(Kind) -> bool; 3] = [
            |kind| kind == Kind::Parameter,
            |kind| kind.is_noise(),
            |_| true,
        ];
        let mut groups = kinds.into_iter().map(of);
        groups.find(|group| !group.is_empty()).unwrap_or_default()
    }

    /// A standard error as a share of its value; of one that is 0, of its start or range.
    fn share(&self, i: usize, known: &Knowledge) -> f64 {
        let unknown = &self.unknowns[i];
        let deviation = known.covariance[(i, i)].sqrt() * unknown.slope(self.values[i]).abs();
        let sizes = [self.values[i], unknown.start, unknown.high - unknown.low];
        let mut sizes = sizes.into_iter().map(f64::abs);
        let size = sizes.find(|size| *size > 0.0 && size.is_finite());
        deviation / size.unwrap_or(1.0)
    }

    /// Of what is told and judged, the one that is known worst.
    fn worst(&self, known: &Knowledge) -> Option<(usize, f64)> {
        let told = self
            .judged()
            .into_iter()
            .filter(|i| !known.flat.contains(i));
        let shares = told.map(|i| (i, self.share(i, known)));
        shares.max_by(|a, b| a.1.total_cmp(&b.1))
    }

    /// The determinant of the errors' correlation matrix, and the product of their deviations, as a logarithm.
    fn log_volume(&self, known: &Knowledge) -> Option<f64> {
        let own = self.judged();
        let matrix = DMatrix::from_fn(own.len(), own.len(), |i, j| {
            known.covariance[(own[i], own[j])]
        });
        let scale = matrix.diagonal().map(f64::sqrt);
        let unit = DMatrix::from_fn(own.len(), own.len(), |i, j| {
            matrix[(i, j)] / (scale[i] * scale[j])
        });
        let root = Cholesky::new(unit)?.l();
        let logs = root.diagonal().map(f64::ln).sum() + scale.map(f64::ln).sum();
        logs.is_finite().then_some(logs)
    }

    fn told(
        &self,
        now: &Knowledge,
        then: Option<Knowledge>,
        name: String,
        sensors: Vec<String>,
        experiment: &Experiment,
    ) -> NextExperiment {
        let count = self.problem.unknowns.len();
        let names = |places: &[usize]| -> Vec<String> {
            let own = places.iter().filter(|i| **i < count);
            own.map(|&i| self.unknowns[i].label()).collect()
        };
        let then = then.as_ref();
        let flat = then.map_or(&now.flat, |then| &then.flat);
        let determines: Vec<usize> = now
            .flat
            .iter()
            .copied()
            .filter(|i| !flat.contains(i))
            .collect();
        let worst = then.and_then(|then| self.worst(then));
        let own = self.judged();
        let are_told = |known: &Knowledge| !own.iter().any(|i| known.flat.contains(i));
        let both = then.filter(|then| are_told(now) && are_told(then));
        let ratio = |of: &dyn Fn(&Knowledge) -> Option<f64>| {
            let both = both?;
            of(both)
                .zip(of(now))
                .and_then(|(then, now)| finite(then / now))
        };
        let squares = |known: &Knowledge| {
            let shares = own.iter().map(|&i| self.share(i, known).powi(2));
            Some(shares.sum::<f64>())
        };
        let volume = both.and_then(|then| {
            let [then, now] = [then, now].map(|known| self.log_volume(known));
            finite((then? - now?).exp())
        });
        let deviation = |then: &Knowledge, i: usize| {
            let slope = self.unknowns[i].slope(self.values[i]).abs();
            let is_told = self.free.contains(&i) && !then.flat.contains(&i);
            finite(then.covariance[(i, i)].sqrt() * slope).filter(|_| is_told)
        };
        let deviations = |then: &Knowledge| -> Named<Option<f64>> {
            let all = (0..count).map(|i| (self.unknowns[i].label(), deviation(then, i)));
            all.collect()
        };
        NextExperiment {
            name,
            rows: experiment.time.len(),
            readings: experiment.readings(),
            duration: experiment.duration(),
            sensors,
            worst: worst.map(|(i, _)| self.unknowns[i].label()),
            relative_sd: worst.and_then(|(_, share)| finite(share)),
            factor: ratio(&|known| self.worst(known).map(|(_, share)| share)),
            volume,
            trace: ratio(&squares),
            sd: then.map(deviations).unwrap_or_default(),
            determines: names(&determines),
            undetermined: names(flat),
        }
    }
}
