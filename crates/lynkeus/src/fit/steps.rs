//! Steps of Runge and Kutta that are short enough for −log L.

use lynkeus_run::{Method, Step};
use nalgebra::DVector;

use super::logs::FittedLog;
use super::problem::{Point, Problem, Steps};
use crate::{Error, Study};
use lynkeus_experiment::prepare::systems;

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

/// What a study's relative tolerance is where it does not say: a smaller one makes all others here as much smaller.
const USUAL: f64 = 1e-9;

impl Problem<'_> {
    /// The study's own values, at steps that are short enough; from there on as [`Self::confine`] has it.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn begin(&mut self, study: &Study) -> Result<Point, Error> {
        let starts = self.unknowns.iter().map(|u| u.start);
        let z = self.searched(starts);
        let method = systems::method(&study.estimate.method);
        let begin = self.stepped(z, &method)?;
        self.confine(&begin);
        Ok(begin)
    }

    /// A point at such steps of the study's method that shorter ones hardly change −log L. Steps that are too long for
    /// a stiff plant throw its estimates out of every range: such a point counts only where shorter ones do not help.
    /// A plant alone then has implicit ones.
    ///
    /// # Errors
    /// As [`Problem::at`].
    fn stepped(&mut self, z: DVector<f64>, method: &Method) -> Result<Point, Error> {
        match method {
            Method::Rk4(step) => {
                self.steps.length = *step;
                return self.at(z);
            }
            Method::Adaptive(t) | Method::Explicit(t) | Method::Stiff(t) => {
                self.steps.tolerance = (t.relative / USUAL).min(1.0);
            }
        }
        let mut found: Option<Point> = None;
        if !matches!(method, Method::Stiff(_)) {
            let (point, is_settled) = self.halving(&z, HALVINGS)?;
            if is_settled || matches!(method, Method::Explicit(_)) || self.is_spent() {
                return Ok(point);
            }
            found = Some(point).filter(|point| self.is_sound(point));
        }
        let explicit = self.steps.halvings;
        if self.implicit(true) {
            let (point, is_settled) = self.halving(&z, HALVINGS)?;
            let is_better = found.is_none() && self.is_sound(&point);
            if is_settled || is_better || self.is_spent() {
                return Ok(point);
            }
        }
        self.implicit(false);
        match found {
            Some(point) => {
                self.shorten(explicit);
                Ok(point)
            }
            None => Ok(self.halving(&z, u32::MAX)?.0),
        }
    }

    /// By implicit steps from here on, or not; whether there are such.
    fn implicit(&mut self, is_implicit: bool) -> bool {
        let mut all = true;
        for term in &mut self.terms {
            all &= term.likelihood.implicit(is_implicit);
        }
        self.steps.is_implicit = is_implicit && all;
        all
    }

    /// A point at steps that are halved until that hardly changes −log L; whether it came to that.
    /// Where the plant has no value they are halved `most` times at most.
    fn halving(&mut self, z: &DVector<f64>, most: u32) -> Result<(Point, bool), Error> {
        let finer = (-self.steps.tolerance.log2() / 4.0).ceil() as u32;
        let intervals = self.logs.iter().map(FittedLog::interval);
        self.steps.length = Step::AtMost(intervals.fold(f64::INFINITY, f64::min));
        self.shorten(0);
        let first = self.at(z.clone())?;
        let mut point = first.clone();
        for halving in 1.. {
            let is_enough = match self.is_sound(&point) {
                true => halving > HALVINGS + finer,
                false => halving > most || self.rows() << halving > MOST_STEPS,
            };
            if is_enough || self.is_spent() {
                break;
            }
            let tolerance = self.steps.tolerance * SETTLED.max(NEARLY * point.value.abs());
            self.shorten(halving);
            let fine = self.at(point.z.clone())?;
            if self.is_spent() {
                self.shorten(halving - 1);
                break;
            }
            if self.is_sound(&point) && (fine.value - point.value).abs() < tolerance {
                self.shorten(halving - 1);
                return Ok((point, true));
            }
            point = fine;
        }
        if self.is_sound(&point) {
            return Ok((point, false));
        }
        self.shorten(0);
        Ok((first, false))
    }

    /// Steps that are halved so often, in every interval between two rows.
    fn shorten(&mut self, halvings: u32) {
        self.steps.halvings = halvings;
        for term in &mut self.terms {
            term.likelihood.shorten(1 << halvings);
        }
    }

    /// By such steps.
    pub fn step_as(&mut self, steps: Steps) {
        self.steps = steps;
        self.implicit(steps.is_implicit);
        self.shorten(steps.halvings);
    }

    /// Whether steps of half the length are too many.
    pub fn is_shortest(&self) -> bool {
        // a few halvings are worth their time on any log
        self.steps.halvings > 2 && self.rows() << (self.steps.halvings + 1) > MOST_STEPS
    }

    /// The same point at half the steps, which are kept where that changes it.
    ///
    /// # Errors
    /// As [`Problem::at`].
    pub fn halved(&mut self, coarse: &Point) -> Result<Option<Point>, Error> {
        if !matches!(self.steps.length, Step::AtMost(_)) {
            return Ok(None);
        }
        let halvings = self.steps.halvings;
        self.shorten(halvings + 1);
        let fine = self.at(coarse.z.clone())?;
        if (fine.value - coarse.value).abs() < self.steps.tolerance * SETTLED {
            self.shorten(halvings);
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
