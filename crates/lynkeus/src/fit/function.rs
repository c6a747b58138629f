//! −log L as a function of what `[fit]` names, for optimisers and samplers of others.

use lynkeus_expr::Budget;
use lynkeus_study::{Objective, Prior};
use nalgebra::{DMatrix, DVector};

use super::logs::FittedLog;
use super::plant;
use super::posed::{self, Posed};
use super::problem::{Problem, Rows, Steps, Term};
use super::search::hessian;
use super::unknown::Unknown;
use crate::{Error, Study, Table};
use lynkeus_experiment::prepare::{self, Prepared};

/// −log L of a study's logs as a function of what its `[fit]` names, in the units of the study: noises as the study
/// has them, no logarithms. The steps are settled at the study's own values, as [`fit`](super::fit) does before its
/// search, and stay, so that the function is smooth.
#[derive(Clone, Debug)]
pub struct LikelihoodFunction {
    /// name of the plant
    pub plant: String,
    /// names of what is measured
    pub outputs: Vec<String>,
    /// what the user should know
    pub notes: Vec<String>,
    /// what of the logs contradicts itself, or counts nowhere
    pub warnings: Vec<String>,
    /// as a fit searches them, without priors
    searched: Vec<Unknown>,
    /// the same without logarithms
    plain: Vec<Unknown>,
    priors: Vec<Option<Prior>>,
    logs: Vec<FittedLog>,
    terms: Vec<Term>,
    steps: Steps,
    most_confined: usize,
}

/// −log L at a point with its derivatives.
#[derive(Clone, Debug, PartialEq)]
pub struct LikelihoodPoint {
    /// −log L; infinite outside of the bounds, and where the plant has no value
    pub nll: f64,
    /// by each value; no numbers where −log L is infinite
    pub gradient: Vec<f64>,
    /// Fisher's information, row by row; no numbers where −log L is infinite
    pub information: Vec<f64>,
}

/// The innovations of a log, row by row and in a row output by output; no numbers where an output did not report.
///
/// The outputs of a row count one after the other: the innovation of a later one is what the earlier ones leave of it,
/// so that all of them are independent.
#[derive(Clone, Debug, PartialEq)]
pub struct LogInnovations {
    /// its file, or what stands for it
    pub log: String,
    /// the time of each row
    pub time: Vec<f64>,
    /// how many of the first rows are fitted; those after them are held out
    pub fitted: usize,
    /// reading − prediction; of a reading at an end of its range the end less the prediction
    pub innovation: Vec<f64>,
    /// the variance of each
    pub variance: Vec<f64>,
    /// whether the reading only says that the output is there or beyond
    pub is_at_end: Vec<bool>,
}

/// Makes −log L of logs a function of what `[fit]` names.
///
/// # Errors
/// As [`fit`](super::fit), but for a start without a value, and for what the logs do not determine.
pub fn likelihood(study: &Study, tables: &[Table]) -> Result<LikelihoodFunction, Error> {
    let (study, mut notes) = posed::with_filter(study)?;
    let plant = prepare::plant(&study)?;
    let prepared = Prepared::new(&study, &plant)?;
    let design = prepared.design()?;
    let logs = posed::logs(&prepared, &design, tables)?;
    let symbolic = plant::symbolic(&study)?;
    let posed = Posed::new(&prepared, &design, &symbolic, &logs)?;
    notes.extend(posed.notes());
    let mut problem = Problem {
        unknowns: &posed.unknowns,
        logs: &logs,
        terms: posed.terms(study.fit.objective == Objective::Simulation)?,
        steps: Steps::default(),
        most_confined: usize::MAX,
        evaluations: 0,
        budget: study.budget.clone(),
    };
    problem.begin(&study)?;
    // half a likelihood, and steps that are not settled, are none
    if let Some(spent) = study.budget.spent() {
        return Err(Error::ended(spent).at(&study.file));
    }
    let own = |is_plain: bool| {
        let all = posed.unknowns.iter().map(move |unknown| Unknown {
            is_log: unknown.is_log && !is_plain,
            prior: None,
            ..unknown.clone()
        });
        all.collect()
    };
    Ok(LikelihoodFunction {
        plant: plant.name.clone(),
        outputs: posed.outputs(),
        notes,
        warnings: posed.warnings(),
        searched: own(false),
        plain: own(true),
        priors: posed.unknowns.iter().map(|u| u.prior).collect(),
        steps: problem.steps,
        most_confined: problem.most_confined,
        terms: problem.terms,
        logs,
    })
}

impl LikelihoodFunction {
    /// `k1`, `noise.level`, `process_noise.x`, `initial.x[1]`: the last by the number of its log.
    pub fn names(&self) -> Vec<String> {
        self.plain.iter().map(Unknown::label).collect()
    }

    /// The study's own values.
    pub fn start(&self) -> Vec<f64> {
        self.plain.iter().map(|u| u.start).collect()
    }

    /// Least and largest values.
    pub fn bounds(&self) -> Vec<(f64, f64)> {
        self.plain.iter().map(|u| (u.low, u.high)).collect()
    }

    /// Which of them a fit searches as logarithms.
    pub fn is_log(&self) -> Vec<bool> {
        self.searched.iter().map(|u| u.is_log).collect()
    }

    /// What was known of them before.
    pub fn priors(&self) -> &[Option<Prior>] {
        &self.priors
    }

    /// −log L, its gradient and Fisher's information.
    ///
    /// # Errors
    /// Another number of values; a step of which there are too many.
    pub fn at(&mut self, values: &[f64]) -> Result<LikelihoodPoint, Error> {
        let n = values.len();
        if !self.contains(values)? {
            return Ok(LikelihoodPoint::none(n));
        }
        let point = self.with(false, |problem| {
            problem.at(DVector::from_column_slice(values))
        })?;
        if !point.value.is_finite() {
            return Ok(LikelihoodPoint::none(n));
        }
        Ok(LikelihoodPoint {
            nll: point.nll,
            gradient: point.gradient.as_slice().to_vec(),
            // it is symmetric
            information: point.information.as_slice().to_vec(),
        })
    }

    /// The Hessian of −log L, row by row, by differences of exact gradients to fourth order as
    /// [`fit`](super::fit) takes them; no numbers where −log L is infinite there or beside.
    ///
    /// # Errors
    /// As [`LikelihoodFunction::at`].
    pub fn hessian(&mut self, values: &[f64]) -> Result<Vec<f64>, Error> {
        let n = values.len();
        if !self.contains(values)? {
            return Ok(vec![f64::NAN; n * n]);
        }
        let all: Vec<usize> = (0..n).collect();
        let (point, searched) = self.with(true, |problem| {
            let point = problem.at(problem.searched(values.iter().copied()))?;
            let searched = hessian(problem, &point, &all)?;
            Ok::<_, Error>((point, searched))
        })?;
        let slopes = self.searched.iter().zip(values);
        let slopes: Vec<f64> = slopes.map(|(u, value)| u.slope(*value)).collect();
        // of f(v) with v = exp z: f″ = (d²f/dz² − df/dz)/v²
        let own = DMatrix::from_fn(n, n, |i, j| {
            let bend = match i == j && self.searched[i].is_log {
                true => point.gradient[i],
                false => 0.0,
            };
            (searched[(i, j)] - bend) / (slopes[i] * slopes[j])
        });
        Ok(own.as_slice().to_vec())
    }

    /// The innovations of all rows of all logs, those that are held out included.
    ///
    /// # Errors
    /// As [`LikelihoodFunction::at`].
    pub fn innovations(&mut self, values: &[f64]) -> Result<Vec<LogInnovations>, Error> {
        let is_inside = self.contains(values)?;
        let outputs = self.outputs.len();
        let count = if is_inside { self.logs.len() } else { 0 };
        let mut all: Vec<LogInnovations> = (self.logs.iter())
            .map(|log| LogInnovations::none(log, outputs))
            .collect();
        self.with(false, |problem| {
            for (place, found) in all.iter_mut().enumerate().take(count) {
                problem.score(place, values, Rows::All, &Budget::default(), |seen| {
                    let at = seen.row * outputs + seen.sensor;
                    found.innovation[at] = seen.innovation;
                    found.variance[at] = seen.variance;
                    found.is_at_end[at] = seen.is_at_end;
                })?;
            }
            Ok(all)
        })
    }

    /// Does something with the sum over the logs, by logarithms as a fit has them or by the values themselves.
    fn with<T>(&mut self, is_searched: bool, work: impl FnOnce(&mut Problem<'_>) -> T) -> T {
        let mut problem = Problem {
            unknowns: match is_searched {
                true => &self.searched,
                false => &self.plain,
            },
            logs: &self.logs,
            terms: std::mem::take(&mut self.terms),
            steps: self.steps,
            most_confined: self.most_confined,
            evaluations: 0,
            budget: Budget::default(),
        };
        let found = work(&mut problem);
        self.terms = problem.terms;
        found
    }

    /// Whether the values are within the bounds.
    ///
    /// # Errors
    /// Another number of them.
    fn contains(&self, values: &[f64]) -> Result<bool, Error> {
        if values.len() != self.plain.len() {
            return Err(Error::input(format!(
                "expected {} values ({}), found {}",
                self.plain.len(),
                self.names().join(", "),
                values.len()
            )));
        }
        let mut all = self.plain.iter().zip(values);
        Ok(all.all(|(unknown, value)| (unknown.low..=unknown.high).contains(value)))
    }
}

impl LikelihoodPoint {
    fn none(values: usize) -> Self {
        Self {
            nll: f64::INFINITY,
            gradient: vec![f64::NAN; values],
            information: vec![f64::NAN; values * values],
        }
    }
}

impl LogInnovations {
    fn none(log: &FittedLog, outputs: usize) -> Self {
        let count = log.time.len() * outputs;
        Self {
            log: log.place.clone(),
            time: log.time.clone(),
            fitted: log.fitted,
            innovation: vec![f64::NAN; count],
            variance: vec![f64::NAN; count],
            is_at_end: vec![false; count],
        }
    }
}
