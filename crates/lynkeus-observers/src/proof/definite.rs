//! Definiteness that rounding cannot fake: S = LDLᵀ in interval arithmetic.

use lynkeus_expr::Interval;

/// A symmetric matrix of enclosures, row by row.
pub(crate) type Matrix = Vec<Vec<Interval>>;

/// Whether every symmetric matrix inside the enclosures is positive definite: each
/// pivot of the elimination is positive for sure.
pub(crate) fn positive(matrix: &Matrix) -> bool {
    let mut left = matrix.clone();
    let n = left.len();
    for k in 0..n {
        let pivot = left[k][k];
        if !pivot.is_positive() {
            return false;
        }
        for i in k + 1..n {
            if left[i][k] == Interval::ZERO {
                continue;
            }
            let factor = left[i][k] / pivot;
            let column: Vec<Interval> = left[k + 1..=i].iter().map(|row| row[k]).collect();
            for (entry, below) in left[i][k + 1..=i].iter_mut().zip(column) {
                *entry = *entry - factor * below;
            }
        }
    }
    true
}

/// Upper bounds of (S⁻¹)_jj, or none where the enclosure of S⁻¹ is not finite.
pub(crate) fn inverse_diagonal(matrix: &Matrix) -> Option<Vec<f64>> {
    let n = matrix.len();
    let flat: Vec<Interval> = matrix.iter().flatten().copied().collect();
    let entry = |j: usize| {
        let unit = |i: usize| {
            if i == j {
                Interval::ONE
            } else {
                Interval::ZERO
            }
        };
        let right: Vec<Interval> = (0..n).map(unit).collect();
        let (column, regular) = lynkeus_expr::interval::solve(&flat, &right);
        let bound = column[j].hi();
        (regular && bound.is_finite() && bound > 0.0).then_some(bound)
    };
    (0..n).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(rows: &[&[f64]]) -> Matrix {
        let row = |r: &&[f64]| r.iter().map(|&x| Interval::point(x)).collect();
        rows.iter().map(row).collect()
    }

    #[test]
    fn a_margin_of_rounding_decides() {
        let e = 1e-9;
        assert!(positive(&points(&[&[1.0, 1.0 - e], &[1.0 - e, 1.0]])));
        assert!(!positive(&points(&[&[1.0, 1.0], &[1.0, 1.0]])));
        assert!(!positive(&points(&[&[1.0, 1.0 + e], &[1.0 + e, 1.0]])));
    }

    #[test]
    fn the_diagonal_of_an_inverse() {
        let found = inverse_diagonal(&points(&[&[2.0, 1.0], &[1.0, 2.0]])).unwrap();
        for bound in found {
            assert!((bound - 2.0 / 3.0).abs() < 1e-12 && bound >= 2.0 / 3.0);
        }
    }
}
