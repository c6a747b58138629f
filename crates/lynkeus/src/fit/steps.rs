//! Steps of Runge and Kutta that are short enough for −log L.

use lynkeus_expr::Budget;
use lynkeus_run::{Method, Step};
use nalgebra::DVector;

use super::logs::FittedLog;
use super::problem::{Point, Problem};
use crate::Error;

/// What −log L may change by where steps are halved.
pub(super) const SETTLED: f64 = 1e-4;

/// At the start a share of it: what counts there is the way to the end.
const NEARLY: f64 = 1e-5;

/// Most halvings of the usual interval between rows, at the start.
const HALVINGS: u32 = 5;

/// Steps over all logs at which a plant that has no value is given up.
const MOST_STEPS: usize = 2_000_000;

/// One row of so many may be one at which the plant has no value where the estimate is.
const CONFINED: usize = 10;

impl Problem<'_> {
    /// A point at such steps of the study's method that shorter ones hardly change −log L. Steps that are too long for
    /// a stiff plant throw its estimates out of every range: such a point counts only where shorter ones do not help.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn stepped(
        &mut self,
        z: DVector<f64>,
        method: &Method,
        budget: &Budget,
    ) -> Result<Point, Error> {
        if let Method::Rk4(step) = method {
            self.step = *step;
            return self.at(z);
        }
        let intervals = self.logs.iter().map(FittedLog::interval);
        let usual = intervals.fold(f64::INFINITY, f64::min);
        self.step = Step::AtMost(usual);
        let first = self.at(z)?;
        let mut point = first.clone();
        let mut length = usual;
        for halving in 1.. {
            let is_enough = match self.is_sound(&point) {
                true => halving > HALVINGS,
                false => self.rows() << halving > MOST_STEPS,
            };
            if is_enough || budget.spent().is_some() {
                break;
            }
            let tolerance = SETTLED.max(NEARLY * point.value.abs());
            self.step = Step::AtMost(0.5 * length);
            let fine = self.at(point.z.clone())?;
            if self.is_sound(&point) && (fine.value - point.value).abs() < tolerance {
                self.step = Step::AtMost(length);
                return Ok(point);
            }
            (point, length) = (fine, 0.5 * length);
        }
        if self.is_sound(&point) {
            return Ok(point);
        }
        self.step = Step::AtMost(usual);
        Ok(first)
    }

    /// The same point at half the steps, which are kept where that changes it.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn halved(&mut self, coarse: &Point) -> Result<Option<Point>, Error> {
        let Step::AtMost(length) = self.step else {
            return Ok(None);
        };
        self.step = Step::AtMost(0.5 * length);
        let fine = self.at(coarse.z.clone())?;
        if (fine.value - coarse.value).abs() < SETTLED {
            self.step = Step::AtMost(length);
            return Ok(None);
        }
        Ok(Some(fine))
    }

    /// Whether the plant has a value at nearly every row: a filter that is put back at every other row is none whose
    /// likelihood means something.
    pub fn is_sound(&self, point: &Point) -> bool {
        point.value.is_finite() && CONFINED * point.confined <= self.rows()
    }

    /// From here on a point where the plant has a value at fewer rows than at this one has no −log L, but for those
    /// that are sound.
    pub fn confine(&mut self, point: &Point) {
        self.most_confined = point.confined.max(self.rows() / CONFINED);
    }

    /// Those that are fitted.
    fn rows(&self) -> usize {
        self.logs.iter().map(|log| log.fitted).sum()
    }
}
