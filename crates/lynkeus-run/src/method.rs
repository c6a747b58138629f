//! The choice of an integrator.

use std::ops::RangeInclusive;

use crate::{Error, Result};

/// How a system is integrated.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Method {
    /// error-controlled; explicit while that pays, implicit while the system is stiff
    Adaptive(Tolerances),
    /// error-controlled, always the explicit Dormand–Prince method of order 8
    Explicit(Tolerances),
    /// error-controlled, always the implicit Radau IIA method of order 5
    Stiff(Tolerances),
    /// the classical Runge–Kutta method of order 4
    Rk4(Step),
}

impl Default for Method {
    fn default() -> Self {
        Self::Adaptive(Tolerances::default())
    }
}

impl Method {
    /// Checks the numbers.
    ///
    /// # Errors
    /// [`Error::Setting`] names the number that is impossible.
    pub fn check(&self) -> Result<()> {
        match self {
            Self::Adaptive(t) | Self::Explicit(t) | Self::Stiff(t) => t.check(),
            Self::Rk4(step) => step.check(),
        }
    }
}

/// Error control: a step may be wrong by `absolute + relative·|x|` per state.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tolerances {
    /// in [`Tolerances::RELATIVE`]
    pub relative: f64,
    /// above 0, in the unit of the states
    pub absolute: f64,
    /// most steps (rejected ones included) from one output point or sample to the
    /// next; each switching instant between them adds 20. A whole run has 300 000
    /// and 200 more for each of its intervals
    pub budget: usize,
}

impl Default for Tolerances {
    fn default() -> Self {
        Self {
            relative: 1e-8,
            absolute: 1e-10,
            budget: 100_000,
        }
    }
}

impl Tolerances {
    /// What the relative tolerance may be: below, rounding errors of a step exceed what it may be
    /// wrong by.
    pub const RELATIVE: RangeInclusive<f64> = 1e-13..=0.1;

    fn check(&self) -> Result<()> {
        let range = Self::RELATIVE;
        if !range.contains(&self.relative) {
            let expected = format!("a number in [{:e}, {}]", range.start(), range.end());
            return Err(Error::setting("rtol", expected, self.relative));
        }
        if !(self.absolute > 0.0 && self.absolute.is_finite()) {
            let expected = "a finite number above 0";
            return Err(Error::setting("atol", expected, self.absolute));
        }
        if self.budget == 0 {
            return Err(Error::setting("step budget", "at least 1", 0));
        }
        Ok(())
    }
}

/// The step of [`Method::Rk4`].
///
/// An interval between two stops (output points, samples, switching instants) is
/// divided into equal steps, so every stop is hit exactly.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum Step {
    /// small enough for the fastest mode: |λ|·h ≤ ½, estimated along the way
    #[default]
    Auto,
    /// steps of at most this length
    AtMost(f64),
    /// so many steps from one sample or output point to the next
    Substeps(usize),
}

impl Step {
    /// The greatest length of a step in an interval of this one; none where it follows from the
    /// system.
    pub(crate) fn length(self, interval: f64) -> Option<f64> {
        match self {
            Self::Auto => None,
            Self::AtMost(h) => Some(h.min(interval)),
            Self::Substeps(n) => Some(interval / n as f64),
        }
    }

    fn check(&self) -> Result<()> {
        match *self {
            Self::AtMost(h) if !(h > 0.0 && h.is_finite()) => {
                Err(Error::setting("step", "a finite number above 0", h))
            }
            Self::Substeps(0) => Err(Error::setting("substeps", "at least 1", 0)),
            _ => Ok(()),
        }
    }
}

/// Whether all are finite numbers, without a branch for each of them.
pub(crate) fn are_finite(values: &[f64]) -> bool {
    values.iter().fold(true, |all, v| all & v.is_finite())
}

/// Steps shorter than this do not move time reliably.
pub(crate) fn resolution(t: f64) -> f64 {
    (16.0 * f64::EPSILON * t.abs()).max(f64::MIN_POSITIVE)
}
