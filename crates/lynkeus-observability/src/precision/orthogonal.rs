//! Singular values by one-sided Jacobi rotations: small ones are as accurate, relatively, as
//! the columns are (Demmel and Veselić 1992).

use lynkeus_expr::Budget;
use nalgebra::DMatrix;

/// Sweeps over all pairs of columns; a handful suffices.
const SWEEPS: usize = 60;

/// Columns count as orthogonal below this cosine.
const COSINE: f64 = 4.0 * f64::EPSILON;

/// A·V has orthogonal columns whose norms are the singular values.
pub(super) struct Singular {
    /// not sorted
    pub values: Vec<f64>,
    /// the directions V, one per column
    pub directions: DMatrix<f64>,
}

/// The singular values and right singular vectors of `a`; none where the budget is spent.
pub(super) fn singular(mut a: DMatrix<f64>, budget: &Budget) -> Option<Singular> {
    let columns = a.ncols();
    let mut v = DMatrix::identity(columns, columns);
    for _ in 0..SWEEPS {
        let mut is_done = true;
        for p in 0..columns {
            if budget.spent().is_some() {
                return None;
            }
            for q in p + 1..columns {
                if let Some((c, s)) = rotation(&a, p, q) {
                    is_done = false;
                    rotate(&mut a, p, q, c, s);
                    rotate(&mut v, p, q, c, s);
                }
            }
        }
        if is_done {
            break;
        }
    }
    Some(Singular {
        values: a.column_iter().map(|column| column.norm()).collect(),
        directions: v,
    })
}

/// Cosine and sine that make two columns orthogonal; none where they are.
fn rotation(a: &DMatrix<f64>, p: usize, q: usize) -> Option<(f64, f64)> {
    let (alpha, beta) = (a.column(p).norm_squared(), a.column(q).norm_squared());
    let gamma = a.column(p).dot(&a.column(q));
    if gamma.abs() <= COSINE * (alpha * beta).sqrt() {
        return None;
    }
    let zeta = (beta - alpha) / (2.0 * gamma);
    let tangent = zeta.signum() / (zeta.abs() + zeta.hypot(1.0));
    let cosine = 1.0 / tangent.hypot(1.0);
    (tangent != 0.0 && tangent.is_finite()).then_some((cosine, cosine * tangent))
}

fn rotate(a: &mut DMatrix<f64>, p: usize, q: usize, c: f64, s: f64) {
    for i in 0..a.nrows() {
        let (x, y) = (a[(i, p)], a[(i, q)]);
        a[(i, p)] = c * x - s * y;
        a[(i, q)] = s * x + c * y;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn small_singular_values_keep_their_digits() {
        // columns nearly parallel: singular values √2 and ε/√2
        let epsilon = 1e-9;
        let a = DMatrix::from_row_slice(2, 2, &[1.0, 1.0, 0.0, epsilon]);
        let mut found = singular(a, &Budget::default()).unwrap().values;
        found.sort_by(f64::total_cmp);
        assert!(
            (found[0] / (epsilon / 2.0_f64.sqrt()) - 1.0).abs() < 1e-6,
            "{found:?}"
        );
        assert!((found[1] - 2.0_f64.sqrt()).abs() < 1e-12);
    }

    #[test]
    fn fewer_rows_than_columns_leave_zeros() {
        let a = DMatrix::from_row_slice(1, 3, &[3.0, 0.0, 4.0]);
        let found = singular(a.clone(), &Budget::default());
        let Singular { values, directions } = found.unwrap();
        assert!((values.iter().copied().fold(0.0, f64::max) - 5.0).abs() < 1e-12);
        assert_eq!(values.iter().filter(|s| **s < 1e-12).count(), 2);
        assert!((&directions * directions.transpose() - DMatrix::identity(3, 3)).norm() < 1e-12);
    }
}
