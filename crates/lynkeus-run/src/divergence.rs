//! When an estimate counts as diverged.

use crate::Error;
use crate::snapshot::{Damaged, Persist, Walk};

/// An estimate this many times larger than anything seen is no estimate.
const FACTOR: f64 = 1e12;

/// Bound on an estimate, from its start and the signals seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    scale: f64,
}

impl Bound {
    pub(crate) fn new(start: &[f64]) -> Self {
        let mut bound = Self { scale: 1.0 };
        bound.see(start);
        bound
    }

    /// Widens the bound for these values.
    pub(crate) fn see(&mut self, values: &[f64]) {
        for value in values {
            self.scale = self.scale.max(value.abs());
        }
    }

    /// The largest number seen, or 1.
    pub(crate) fn scale(&self) -> f64 {
        self.scale
    }

    /// # Errors
    /// [`Error::Diverged`], with the hint, for a value beyond the bound, or NaN.
    pub(crate) fn check(
        &self,
        time: f64,
        names: &[String],
        values: &[f64],
        hint: impl FnOnce() -> String,
    ) -> Result<(), Error> {
        // a reading may be so large that the bound itself is infinite
        let inside = |v: &f64| v.is_finite() && v.abs() <= FACTOR * self.scale;
        match values.iter().position(|v| !inside(v)) {
            None => Ok(()),
            Some(i) => Err(Error::Diverged {
                time,
                name: names.get(i).cloned().unwrap_or_default(),
                value: values[i],
                hint: hint(),
            }),
        }
    }
}

/// A covariance that has grown beyond every number.
pub(crate) fn deviation_diverged(time: f64, name: &str, value: f64) -> Error {
    Error::Diverged {
        time,
        name: format!("standard deviation of {name}"),
        value,
        hint: "; give smaller values in initial_variance or [process_noise]".to_owned(),
    }
}

impl Persist for Bound {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.number(&mut self.scale)
    }
}
