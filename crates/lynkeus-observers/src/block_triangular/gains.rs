//! K: given, or by its eigenvalues.

use crate::{Tuning, TuningError, Value};

/// K with the eigenvalues of A − KC at the poles: the coefficients of Π(s − pole).
pub(super) fn placed(poles: &[f64]) -> Vec<f64> {
    let mut coefficients = vec![1.0];
    for pole in poles {
        let shifted = coefficients.iter().map(|c| -pole * c);
        let mut next: Vec<f64> = coefficients.iter().copied().chain([0.0]).collect();
        for (sum, term) in next[1..].iter_mut().zip(shifted) {
            *sum += term;
        }
        coefficients = next;
    }
    coefficients.split_off(1)
}

/// Lists of numbers, one per chain.
pub(super) fn number_lists(
    tuning: &Tuning,
    key: &str,
) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    let Some(value) = tuning.values.get(key) else {
        return Ok(None);
    };
    let wrong = || TuningError::new(key, "a list of lists of numbers, one per chain", value);
    let Value::List(rows) = value else {
        return Err(wrong());
    };
    let number = |x: &Value| match x {
        Value::Number(x) if x.is_finite() => Ok(*x),
        _ => Err(wrong()),
    };
    let row = |row: &Value| match row {
        Value::List(row) => row.iter().map(number).collect(),
        _ => Err(wrong()),
    };
    rows.iter().map(row).collect::<Result<_, _>>().map(Some)
}
