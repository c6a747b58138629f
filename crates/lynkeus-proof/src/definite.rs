//! Rigorous positive definiteness, by a Cholesky factorisation in interval
//! arithmetic: where every pivot is proved positive, every symmetric matrix between
//! the bounds is positive definite (Alefeld and Mayer 1993).

use lynkeus_expr::Interval;
use nalgebra::DMatrix;

use crate::matrix::{IntervalMatrix, square};
use crate::search::largest;

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

/// Whether P − βQ is positive definite for symmetric P and Q of one size: a bound of one
/// quadratic form by another.
pub fn is_below(Q: &DMatrix<f64>, β: f64, P: &DMatrix<f64>) -> bool {
    let β = Interval::point(β);
    let entry = |i, j| Interval::point(P[(i, j)]) - β * Interval::point(Q[(i, j)]);
    P.shape() == Q.shape() && is_positive_definite(&square(P.nrows(), entry))
}

/// A lower bound of the least eigenvalue of every symmetric matrix within the entries, as
/// large as the arithmetic proves but at most `limit`; none where it is not proved to be
/// positive.
///
/// ```
/// use lynkeus_expr::Interval;
/// use lynkeus_proof::definite::least_eigenvalue;
///
/// let matrix = [[2.0, 1.0], [1.0, 2.0]].map(|row| row.map(Interval::point).to_vec());
/// let found = least_eigenvalue(&matrix, f64::INFINITY).unwrap();
/// assert!(found < 1.0 && found > 1.0 - 1e-12);
/// ```
pub fn least_eigenvalue(matrix: &[Vec<Interval>], limit: f64) -> Option<f64> {
    let above = |μ: f64| {
        let entry = |i: usize, j: usize| match i == j {
            true => matrix[i][j] - Interval::point(μ),
            false => matrix[i][j],
        };
        is_positive_definite(&square(matrix.len(), entry))
    };
    let diagonal = (0..matrix.len()).map(|i| matrix[i][i].hi());
    let limit = diagonal.fold(limit, f64::min);
    match limit > 0.0 && limit.is_finite() && above(limit) {
        true => Some(limit),
        false => largest(limit, above),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

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
}
