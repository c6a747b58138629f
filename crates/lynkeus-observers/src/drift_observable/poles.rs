//! Poles as a study gives them: all of a chain, or the slowest of it.

use lynkeus_gain::vandermonde::Pole;

use crate::{TuningError, Value};

/// Ratio of each pole to the one before where only the slowest is given: that of the
/// paper's example.
pub(super) const RATIO: f64 = 1.2;

/// The poles of one chain or filter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Poles {
    /// the slowest one, each further one 1.2 times as fast as the one before
    Slowest(f64),
    /// all of them
    All(Vec<Pole>),
}

impl Poles {
    /// A number, or a list of numbers and of tables { re, im } for conjugate pairs. None
    /// where the value is neither.
    pub fn read(key: &str, value: &Value) -> Result<Option<Self>, TuningError> {
        match value {
            Value::Number(x) => Ok(Some(Self::Slowest(negative(key, *x)?))),
            Value::List(entries) => {
                let poles: Result<Option<Vec<Pole>>, _> =
                    entries.iter().map(|e| pole(key, e)).collect();
                Ok(poles?.map(Self::All))
            }
            _ => Ok(None),
        }
    }

    /// How many eigenvalues, where that is said.
    pub fn count(&self) -> Option<usize> {
        match self {
            Self::Slowest(_) => None,
            Self::All(poles) => Some(poles.iter().map(|p| p.count()).sum()),
        }
    }

    /// For a chain of length `n`; none where these are more or fewer.
    pub fn of_length(&self, n: usize) -> Option<Vec<Pole>> {
        match self {
            Self::Slowest(λ) => Some(spaced(*λ, n)),
            Self::All(poles) => (self.count() == Some(n)).then(|| poles.clone()),
        }
    }
}

/// n real poles from the slowest on.
pub(super) fn spaced(slowest: f64, n: usize) -> Vec<Pole> {
    let pole = |k: usize| Pole::Real(slowest * RATIO.powi(k as i32));
    (0..n).map(pole).collect()
}

fn pole(key: &str, value: &Value) -> Result<Option<Pole>, TuningError> {
    match value {
        Value::Number(λ) => Ok(Some(Pole::Real(negative(key, *λ)?))),
        Value::Table(parts) => {
            let part = |name: &str| match parts.get(name) {
                Some(Value::Number(x)) if x.is_finite() => Some(*x),
                _ => None,
            };
            let (Some(re), Some(im), 2) = (part("re"), part("im"), parts.len()) else {
                let expected = "a conjugate pair as { re = number, im = number }";
                return Err(TuningError::new(key, expected, value));
            };
            let re = negative(key, re)?;
            if im == 0.0 {
                let expected = "im ≠ 0 in a conjugate pair; a real pole is a number";
                return Err(TuningError::new(key, expected, value));
            }
            Ok(Some(Pole::Pair { re, im }))
        }
        _ => Ok(None),
    }
}

fn negative(key: &str, pole: f64) -> Result<f64, TuningError> {
    match pole < 0.0 && pole.is_finite() {
        true => Ok(pole),
        false => Err(TuningError::new(key, "negative numbers", pole)),
    }
}

/// Poles for a message or a table.
pub(super) fn list(poles: &[Pole]) -> String {
    let poles: Vec<String> = poles.iter().map(Pole::to_string).collect();
    poles.join(", ")
}
