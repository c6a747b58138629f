//! Definiteness that rounding cannot fake, and inverses of which the same is true.

use lynkeus_expr::Interval;

/// A symmetric matrix of enclosures, row by row.
pub(crate) type Matrix = Vec<Vec<Interval>>;

/// Whether every symmetric matrix inside the enclosures is positive definite.
pub(crate) fn positive(matrix: &Matrix) -> bool {
    lynkeus_gain::definite::is_positive_definite(matrix)
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
