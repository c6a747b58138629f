//! Rigorous positive definiteness, by a Cholesky factorisation in interval
//! arithmetic: where every pivot is proved positive, every symmetric matrix between
//! the bounds is positive definite.

use lynkeus_expr::{Interval, interval};

use crate::matrix::IntervalMatrix;

/// Whether every symmetric matrix within the entries is positive definite. False may
/// also mean that the bounds are too wide to tell. Only the lower triangle is read.
///
/// ```
/// use lynkeus_expr::Interval;
/// use lynkeus_proof::definite::is_positive_definite;
///
/// let near = |x: f64| Interval::new(x - 0.1, x + 0.1).unwrap();
/// assert!(is_positive_definite(&[vec![near(2.0), near(1.0)], vec![near(1.0), near(2.0)]]));
/// assert!(!is_positive_definite(&[vec![near(1.0), near(1.0)], vec![near(1.0), near(1.0)]]));
/// ```
pub fn is_positive_definite(matrix: &[Vec<Interval>]) -> bool {
    if matrix.iter().enumerate().any(|(i, row)| row.len() <= i) {
        return false;
    }
    let mut L: IntervalMatrix = vec![];
    for (i, given) in matrix.iter().enumerate() {
        let mut row: Vec<Interval> = vec![];
        for j in 0..=i {
            let above = if j == i { &row } else { &L[j] };
            let products = row.iter().zip(above).take(j).map(|(a, b)| match i == j {
                true => a.powi(2),
                false => *a * *b,
            });
            let rest = products.fold(given[j], |sum, product| sum - product);
            if j < i {
                row.push(rest / L[j][j]);
            } else if rest.is_positive() && rest.is_defined() {
                row.push(rest.sqrt());
            } else {
                return false;
            }
        }
        L.push(row);
    }
    true
}

/// Upper bounds of (S⁻¹)_jj, or none where the enclosure of S⁻¹ is not finite.
pub fn inverse_diagonal(matrix: &IntervalMatrix) -> Option<Vec<f64>> {
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
        let (column, regular) = interval::solve(&flat, &right);
        let bound = column[j].hi();
        (regular && bound.is_finite() && bound > 0.0).then_some(bound)
    };
    (0..n).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::DMatrix;
    use proptest::prelude::*;

    fn points(matrix: &DMatrix<f64>, radius: f64) -> IntervalMatrix {
        let side = |x: f64| Interval::new(x - radius, x + radius).unwrap();
        let row = |i: usize| matrix.row(i).iter().map(|&x| side(x)).collect();
        (0..matrix.nrows()).map(row).collect()
    }

    #[test]
    fn what_is_no_number_is_not_definite() {
        assert!(!is_positive_definite(&[vec![Interval::EMPTY]]));
        assert!(!is_positive_definite(&[vec![Interval::ENTIRE]]));
        assert!(!is_positive_definite(&[vec![Interval::ONE], vec![]]));
    }

    fn rows(rows: &[&[f64]]) -> IntervalMatrix {
        let row = |r: &&[f64]| r.iter().map(|&x| Interval::point(x)).collect();
        rows.iter().map(row).collect()
    }

    #[test]
    fn a_margin_of_rounding_decides() {
        let e = 1e-9;
        assert!(is_positive_definite(&rows(&[
            &[1.0, 1.0 - e],
            &[1.0 - e, 1.0]
        ])));
        assert!(!is_positive_definite(&rows(&[&[1.0, 1.0], &[1.0, 1.0]])));
        assert!(!is_positive_definite(&rows(&[
            &[1.0, 1.0 + e],
            &[1.0 + e, 1.0]
        ])));
    }

    #[test]
    fn the_diagonal_of_an_inverse() {
        let found = inverse_diagonal(&rows(&[&[2.0, 1.0], &[1.0, 2.0]])).unwrap();
        for bound in found {
            assert!((bound - 2.0 / 3.0).abs() < 1e-12 && bound >= 2.0 / 3.0);
        }
    }

    proptest! {
        /// The verdict agrees with the eigenvalues wherever these are clear.
        #[test]
        fn the_verdict_agrees_with_eigenvalues(
            entries in proptest::collection::vec(-1.0_f64..1.0, 36),
            shift in -3.0_f64..6.0,
            radius in 0.0_f64..0.05,
        ) {
            let square = DMatrix::from_vec(6, 6, entries);
            let matrix = (&square + square.transpose()) * 0.5 + DMatrix::identity(6, 6) * shift;
            let smallest = matrix.symmetric_eigenvalues().min();
            let verdict = is_positive_definite(&points(&matrix, radius));
            // some matrix within the radius has an eigenvalue lower by it
            if smallest <= radius {
                prop_assert!(!verdict, "smallest eigenvalue {smallest}, radius {radius}");
            }
            if radius == 0.0 && smallest > 1e-9 {
                prop_assert!(verdict, "smallest eigenvalue {smallest}");
            }
        }
    }
}
