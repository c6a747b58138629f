//! Runs of an observer that end: an estimate that diverges, a matrix that is singular.

use crate::error::{digits, state_text};
use crate::{Error, Margin, Result};

/// An estimate this many times larger than anything seen is no estimate.
const FACTOR: f64 = 1e12;

/// Bound on an estimate, from its start and the signals seen.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Bound {
    /// the largest number seen, or 1
    pub scale: f64,
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

    /// What no value may exceed.
    pub(crate) fn most(&self) -> f64 {
        FACTOR * self.scale
    }

    /// # Errors
    /// [`Error::Diverged`], with the hint, for a value beyond the bound, or NaN.
    pub(crate) fn check(
        &self,
        time: f64,
        names: &[String],
        values: &[f64],
        hint: impl FnOnce() -> String,
    ) -> Result<()> {
        let most = self.most();
        // a reading may be so large that the bound itself is infinite
        let inside = |v: &f64| v.is_finite() && v.abs() <= most;
        match values.iter().position(|v| !inside(v)) {
            None => Ok(()),
            Some(i) => Err(diverged(time, names, values, i, hint())),
        }
    }
}

/// That one of some values has diverged.
pub(crate) fn diverged(
    time: f64,
    names: &[String],
    values: &[f64],
    place: usize,
    hint: String,
) -> Error {
    Error::Diverged {
        time,
        name: names.get(place).cloned().unwrap_or_default(),
        value: values.get(place).copied().unwrap_or_default(),
        hint,
    }
}

/// The place of the value that is furthest from 0.
pub(crate) fn largest(x: &[f64]) -> usize {
    let places = (0..x.len()).max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()));
    places.unwrap_or_default()
}

/// # Errors
/// [`Error::DeviationDiverged`] of a covariance that has grown beyond every number.
pub(crate) fn check_deviations(time: f64, names: &[String], deviations: &[f64]) -> Result<()> {
    match deviations.iter().position(|d| !d.is_finite()) {
        None => Ok(()),
        Some(i) => Err(Error::DeviationDiverged {
            time,
            name: names.get(i).cloned().unwrap_or_default(),
            value: deviations[i],
        }),
    }
}

/// An estimate so many times larger than all that was seen is on its way to infinity, whatever ends
/// the run.
const RUN_AWAY: f64 = 1e6;

/// The margin that is furthest below its limit, with its value among those of the outputs.
fn closest<'m>(margins: &'m [Margin], outputs: &[f64]) -> Option<(&'m Margin, f64)> {
    let known = margins.iter();
    let known = known.filter_map(|m| Some((m, *outputs.get(m.output)?)));
    let low = known.filter(|(m, value)| *value < m.below);
    low.min_by(|a, b| (a.1 / a.0.below).total_cmp(&(b.1 / b.0.below)))
}

/// An integration that could not go on at `x`, by its cause: an estimate on its way to infinity, far
/// beyond `scale`, the largest number among starts and signals, or a matrix that is singular at
/// the estimate, by the margins and the outputs there. Other errors stay.
pub(crate) fn explained(
    mut error: Error,
    names: &[String],
    x: &[f64],
    scale: f64,
    (margins, outputs): (&[Margin], &[f64]),
) -> Error {
    let Some(time) = error.time() else {
        return error;
    };
    let place = largest(x);
    let is_away = x.get(place).is_some_and(|x| x.abs() > RUN_AWAY * scale);
    if is_away && !matches!(error, Error::Diverged { .. }) {
        error = diverged(time, names, x, place, String::new());
    }
    let Some((margin, value)) = closest(margins, outputs) else {
        return error;
    };
    if let Error::Diverged { hint, .. } = &mut error {
        *hint += &format!(
            "; {} is close to singular there ({} = {}): {}",
            margin.matrix,
            margin.name,
            digits(value),
            margin.meaning
        );
        return error;
    }
    Error::Singular {
        time,
        margin: Box::new(margin.clone()),
        value,
        state: state_text(names, x),
    }
}
