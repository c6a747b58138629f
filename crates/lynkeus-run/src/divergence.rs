//! Runs of an observer that end: an estimate that diverges, a matrix that is singular.

use crate::Error;
use crate::error::{digits, state_text};
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

/// # Errors
/// [`Error::DeviationDiverged`] of a covariance that has grown beyond every number.
pub(crate) fn check_deviations(
    time: f64,
    names: &[String],
    deviations: &[f64],
) -> Result<(), Error> {
    match deviations.iter().position(|d| !d.is_finite()) {
        None => Ok(()),
        Some(i) => Err(Error::DeviationDiverged {
            time,
            name: names.get(i).cloned().unwrap_or_default(),
            value: deviations[i],
        }),
    }
}

impl Persist for Bound {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.number(&mut self.scale)
    }
}

/// An output of a system that says how far a matrix is from singular: its reciprocal condition
/// number, which a run that cannot go on is judged by.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// its place among the outputs
    pub output: usize,
    /// what people call it
    pub name: String,
    /// what the matrix is called
    pub matrix: String,
    /// below this it is close to singular
    pub below: f64,
    /// what that means, and what to do
    pub meaning: String,
}

/// An estimate so many times larger than all that was seen is on its way to infinity, whatever ends
/// the run.
const RUN_AWAY: f64 = 1e6;

/// The margin that is furthest below its limit.
fn closest<'m>(margins: &[(&'m Margin, f64)]) -> Option<(&'m Margin, f64)> {
    let low = margins.iter().filter(|(m, value)| *value < m.below);
    low.min_by(|a, b| (a.1 / a.0.below).total_cmp(&(b.1 / b.0.below)))
        .copied()
}

/// An integration that could not go on at `x`, by its cause: an estimate on its way to infinity, far
/// beyond `scale`, the largest number among starts and signals, or a matrix that is singular at
/// the estimate, by the margins with their values there. Other errors stay.
pub(crate) fn explained(
    error: Error,
    names: &[String],
    x: &[f64],
    scale: f64,
    margins: &[(&Margin, f64)],
) -> Error {
    let time = match &error {
        Error::StepBudget { time, .. }
        | Error::StepUnderflow { time, .. }
        | Error::TooStiff { time, .. } => *time,
        Error::Diverged { .. } => return with_hint(error, margins),
        _ => return error,
    };
    let far = RUN_AWAY * scale;
    let largest = (0..x.len()).max_by(|&i, &j| x[i].abs().total_cmp(&x[j].abs()));
    let away = largest.filter(|&i| x[i].abs() > far);
    if let Some(i) = away {
        let diverged = Error::Diverged {
            time,
            name: names.get(i).cloned().unwrap_or_default(),
            value: x[i],
            hint: String::new(),
        };
        return with_hint(diverged, margins);
    }
    match closest(margins) {
        None => error,
        Some((margin, value)) => Error::Singular {
            time,
            matrix: margin.matrix.clone(),
            name: margin.name.clone(),
            value,
            below: margin.below,
            meaning: margin.meaning.clone(),
            state: state_text(names, x),
        },
    }
}

/// A divergence beside a singular matrix says so.
fn with_hint(mut error: Error, margins: &[(&Margin, f64)]) -> Error {
    if let (Error::Diverged { hint, .. }, Some((margin, at))) = (&mut error, closest(margins)) {
        *hint += &format!(
            "; {} is close to singular there ({} = {}): {}",
            margin.matrix,
            margin.name,
            digits(at),
            margin.meaning
        );
    }
    error
}
