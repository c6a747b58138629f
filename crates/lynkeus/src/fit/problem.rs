//! What is made least: −log L over all logs, and what was known before.

use lynkeus_expr::Budget;
use lynkeus_run::filter::{Likelihood, Score, Seen};
use lynkeus_run::{Error as RunError, Step};
use nalgebra::{DMatrix, DVector};

use super::logs::FittedLog;
use super::unknown::Unknown;
use crate::Error;
use lynkeus_experiment::words::explain;

/// −log L with the prior's share, where the search has it: parameters that are searched as logarithms are ones.
#[derive(Clone, Debug)]
pub(crate) struct Point {
    /// where, as logarithms where those are searched
    pub z: DVector<f64>,
    /// with the prior's share; infinite where the plant has no value
    pub value: f64,
    pub gradient: DVector<f64>,
    /// Fisher's information and the prior's
    pub information: DMatrix<f64>,
    /// without the prior's share
    pub nll: f64,
    pub readings: usize,
    /// intervals on which the plant had no value where the estimate was
    pub confined: usize,
}

/// A log with the function of the unknowns that it is.
#[derive(Clone, Debug)]
pub(crate) struct Term {
    pub likelihood: Likelihood,
    /// the places of the unknowns that it depends on
    pub places: Vec<usize>,
}

/// The steps from one row to the next.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Steps {
    pub length: Step,
    /// how often that is halved
    pub halvings: u32,
    pub is_implicit: bool,
    /// a factor of all that −log L may be wrong by
    pub tolerance: f64,
}

impl Steps {
    /// From now on a likelihood of the same plant goes by them.
    pub fn on(self, likelihood: &mut Likelihood) {
        likelihood.implicit(self.is_implicit);
        likelihood.shorten(1 << self.halvings);
    }
}

impl Default for Steps {
    fn default() -> Self {
        Self {
            length: Step::Auto,
            halvings: 0,
            is_implicit: false,
            tolerance: 1.0,
        }
    }
}

/// What a fit makes least.
#[derive(Clone, Debug)]
pub(crate) struct Problem<'a> {
    pub unknowns: &'a [Unknown],
    pub logs: &'a [FittedLog],
    /// one per log
    pub terms: Vec<Term>,
    pub steps: Steps,
    /// where the plant has no value in more intervals than so many, −log L has none: steps are too long there
    pub most_confined: usize,
    pub evaluations: usize,
    /// once it is spent, nothing has a value any more
    pub budget: Budget,
}

/// Rows after which the clock is looked at.
const LOOK: usize = 64;

/// A noise that is a smaller share of its start is as good as none.
const NOTHING: f64 = 1e-4;

/// Rows of a log.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Rows {
    Fitted,
    All,
}

impl Problem<'_> {
    /// The unknowns as the search has them.
    pub fn searched(&self, values: impl IntoIterator<Item = f64>) -> DVector<f64> {
        let values = values.into_iter().zip(self.unknowns);
        let z = values.map(|(value, unknown)| unknown.searched(value));
        DVector::from_iterator(self.unknowns.len(), z)
    }

    /// The unknowns themselves.
    pub fn values(&self, z: &DVector<f64>) -> Vec<f64> {
        let z = z.iter().zip(self.unknowns);
        z.map(|(z, unknown)| unknown.value(*z)).collect()
    }

    /// −log L and its derivatives; infinite where a limit struck on the way.
    ///
    /// # Errors
    /// A step of which there are too many.
    pub fn at(&mut self, z: DVector<f64>) -> Result<Point, Error> {
        self.evaluations += 1;
        let values = self.values(&z);
        let n = values.len();
        let mut point = Point {
            value: 0.0,
            gradient: DVector::zeros(n),
            information: DMatrix::zeros(n, n),
            nll: 0.0,
            readings: 0,
            confined: 0,
            z,
        };
        for place in 0..self.terms.len() {
            let budget = self.budget.clone();
            let score = self.score(place, &values, Rows::Fitted, &budget, |_| {})?;
            let places = &self.terms[place].places;
            point.nll += score.value;
            point.readings += score.readings;
            point.confined += score.confined;
            for (i, &p) in places.iter().enumerate() {
                point.gradient[p] += score.gradient[i];
                for (j, &q) in places.iter().enumerate() {
                    point.information[(p, q)] += score.information[i * places.len() + j];
                }
            }
        }
        point.value = point.nll;
        self.add_priors(&values, &mut point);
        self.stretch(&values, &mut point);
        let is_finite = point
            .gradient
            .iter()
            .chain(&point.information)
            .all(|x| x.is_finite());
        let is_sound = is_finite && point.confined <= self.most_confined && !self.is_spent();
        if !is_sound || point.value.is_nan() {
            point.value = f64::INFINITY;
        }
        Ok(point)
    }

    /// Whether −log L may have knees and steps, which no Hessian tells of.
    pub fn has_knees(&self) -> bool {
        self.terms.iter().any(|term| term.likelihood.has_knees())
    }

    /// Whether a limit struck: what has been computed before still counts.
    pub fn is_spent(&self) -> bool {
        self.budget.spent().is_some()
    }

    /// The share of one log, or of its first rows where the budget ends; `see` is told its innovations.
    pub fn score(
        &mut self,
        place: usize,
        values: &[f64],
        rows: Rows,
        budget: &Budget,
        see: impl FnMut(Seen),
    ) -> Result<Score, Error> {
        let (log, term) = (&self.logs[place], &mut self.terms[place]);
        let own: Vec<f64> = term.places.iter().map(|&p| values[p]).collect();
        let count = match rows {
            Rows::Fitted => log.fitted,
            Rows::All => log.time.len(),
        };
        let is_going = |k: usize| !k.is_multiple_of(LOOK) || budget.spent().is_none();
        let rows = log.rows(count).enumerate();
        let rows = rows.take_while(|(k, _)| is_going(*k)).map(|(_, row)| row);
        let score = term.likelihood.watched(&own, rows, self.steps.length, see);
        score.map_err(|error| match &error {
            // steps that grow reach any distance, equal ones do not
            RunError::Setting { .. } => log.gap().unwrap_or_else(|| explain(error).at(&log.place)),
            _ => explain(error).at(&log.place),
        })
    }

    fn add_priors(&self, values: &[f64], point: &mut Point) {
        for (i, (value, unknown)) in values.iter().zip(self.unknowns).enumerate() {
            let Some(prior) = unknown.prior else { continue };
            let off = (value - prior.mean) / prior.sd;
            point.value += 0.5 * off * off;
            point.gradient[i] += off / prior.sd;
            point.information[(i, i)] += 1.0 / (prior.sd * prior.sd);
        }
    }

    /// By what is searched instead of by the unknowns.
    fn stretch(&self, values: &[f64], point: &mut Point) {
        for (i, (value, unknown)) in values.iter().zip(self.unknowns).enumerate() {
            if unknown.is_log {
                point.gradient[i] *= value;
                point.information.row_mut(i).scale_mut(*value);
                point.information.column_mut(i).scale_mut(*value);
            }
        }
    }

    /// The ranges of what is searched.
    pub fn ranges(&self) -> Vec<(f64, f64)> {
        let ranges = self.unknowns.iter();
        ranges
            .map(|u| (u.searched(u.low), u.searched(u.high)))
            .collect()
    }
}

impl Unknown {
    /// As the search has it.
    pub fn searched(&self, value: f64) -> f64 {
        match self.is_log {
            true => value.ln(),
            false => value,
        }
    }

    /// Of what the search has.
    pub fn value(&self, z: f64) -> f64 {
        match self.is_log {
            true => z.exp(),
            false => z,
        }
    }

    /// Whether it is a noise that stands for 0 there.
    pub fn is_nothing(&self, z: f64) -> bool {
        self.reaches_zero() && self.value(z) <= NOTHING * self.start
    }

    /// Its derivative by what is searched.
    pub fn slope(&self, value: f64) -> f64 {
        match self.is_log {
            true => value,
            false => 1.0,
        }
    }
}
