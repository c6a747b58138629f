//! Steps of Runge and Kutta that are short enough for −log L.

use lynkeus_run::{Method, Step};

use super::logs::FittedLog;
use super::problem::{Point, Problem};
use crate::prepare::systems;
use crate::{Error, Study};

/// What −log L may change by where steps are halved.
pub(super) const SETTLED: f64 = 1e-4;

/// The same as a share of −log L, at the start: there nothing fits yet.
const NEARLY: f64 = 1e-5;

/// Most halvings of the usual interval between rows, at the start.
const HALVINGS: usize = 5;

impl Problem<'_> {
    /// The study's own values, at steps that are short enough.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn begin(&mut self, study: &Study) -> Result<Point, Error> {
        let starts = self.unknowns.iter().map(|u| u.start);
        let z = self.searched(starts);
        if let Method::Rk4(step) = systems::method(&study.estimate.method) {
            self.step = step;
            return self.at(z);
        }
        let intervals = self.logs.iter().map(FittedLog::interval);
        let interval = intervals.fold(f64::INFINITY, f64::min);
        self.step = Step::AtMost(interval);
        let mut point = self.at(z)?;
        for _ in 0..HALVINGS {
            if study.budget.spent().is_some() {
                break;
            }
            let tolerance = SETTLED.max(NEARLY * point.value.abs());
            let Some(next) = self.halved(&point, tolerance)? else {
                return Ok(point);
            };
            point = next;
        }
        Ok(point)
    }

    /// The same point at half the steps, which are kept where that changes it.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn halved(&mut self, coarse: &Point, tolerance: f64) -> Result<Option<Point>, Error> {
        let Step::AtMost(length) = self.step else {
            return Ok(None);
        };
        self.step = Step::AtMost(0.5 * length);
        let fine = self.at(coarse.z.clone())?;
        if (fine.value - coarse.value).abs() < tolerance {
            self.step = Step::AtMost(length);
            return Ok(None);
        }
        Ok(Some(fine))
    }
}
