//! The counterpart of a Lyapunov function: a proof that no decay is possible.
//!
//! If He(HA) > 0 for a symmetric H and eᵀHe > 0 for some e, then eᵀHe grows along
//! e' = Ae from that e on: A has an eigenvalue with a positive real part (Lyapunov's
//! theorem on instability; as many as H has positive ones, Ostrowski and Schneider
//! 1962). Computed eigenvalues alone show nothing: those of a matrix near a defective one
//! are wrong by the n-th root of the rounding. So they only propose H, which is checked
//! in interval arithmetic.

use crate::spectrum;
use lynkeus_expr::Interval;
use nalgebra::DMatrix;

use super::frame::balanced;
use crate::definite::is_positive_definite;
use crate::lyapunov;
use crate::matrix::{IntervalMatrix, dot, points, product, square};

/// States up to which H is sought: its equation has n² unknowns.
const STATES: usize = 32;
/// Places of the imaginary axis tried.
const SHIFTS: usize = 6;
/// Where in a gap the axis is put: not in the middle, where the eigenvalues at its ends
/// cancel in the equation of H.
const SHARES: [f64; 2] = [0.1, 0.35];
/// Whether every matrix with entries in these intervals is proved to have an eigenvalue
/// with a positive real part.
///
/// ```
/// use lynkeus_expr::Interval;
/// use lynkeus_proof::decay::is_unstable;
///
/// let saddle = |x: f64| vec![
///     vec![Interval::point(-1.0), Interval::ONE],
///     vec![Interval::ONE, Interval::point(x)],
/// ];
/// assert!(is_unstable(&saddle(0.0)));
/// assert!(!is_unstable(&saddle(-2.0)));
/// ```
pub fn is_unstable(A: &IntervalMatrix) -> bool {
    let n = A.len();
    let is_square = A.iter().all(|row| row.len() == n);
    if n == 0 || n > STATES || !is_square || !A.iter().flatten().all(|x| x.is_bounded()) {
        return false;
    }
    let middle = DMatrix::from_fn(n, n, |i, j| A[i][j].midpoint());
    // powers of two change no digit
    let sizes: Vec<f64> = balanced(&middle, &vec![1.0; n])
        .iter()
        .map(|d| d.log2().round().exp2())
        .collect();
    let scaled = |i: usize, j: usize| Interval::point(sizes[j] / sizes[i]) * A[i][j];
    let A = square(n, scaled);
    let middle = DMatrix::from_fn(n, n, |i, j| A[i][j].midpoint());
    let shifts = shifts(&middle).into_iter();
    shifts.take(SHIFTS).any(|σ| {
        let shifted = &middle - DMatrix::identity(n, n) * σ;
        lyapunov::solve(&shifted, &-DMatrix::identity(n, n)).is_some_and(|H| grows(&A, σ, &H))
    })
}

/// Where to put the axis, σ ≥ 0: between real parts of eigenvalues that are far apart,
/// the widest gap first.
fn shifts(A: &DMatrix<f64>) -> Vec<f64> {
    let Some(eigenvalues) = spectrum::eigenvalues(A.clone()) else {
        return vec![];
    };
    let mut parts: Vec<f64> = eigenvalues.iter().map(|λ| λ.re).collect();
    parts.sort_by(|a, b| b.total_cmp(a));
    parts.push(f64::NEG_INFINITY);
    let growing = parts.windows(2).filter(|pair| pair[0] > 0.0);
    let mut gaps: Vec<(f64, f64)> = growing
        .flat_map(|pair| SHARES.map(|share| (pair[0], pair[1], share)))
        .map(|(above, below, share)| {
            let from = below.max(0.0);
            let σ = from + share * (above - from);
            ((above - σ).min(σ - below), σ)
        })
        .collect();
    gaps.sort_by(|a, b| b.0.total_cmp(&a.0));
    gaps.into_iter().map(|(_, σ)| σ).collect()
}

/// Whether He(H(A − σI)) > 0 and some eᵀHe > 0, for every A in the intervals.
fn grows(A: &IntervalMatrix, σ: f64, H: &DMatrix<f64>) -> bool {
    let n = A.len();
    let shifted = |k: usize, j: usize| match k == j {
        true => A[k][j] - Interval::point(σ),
        false => A[k][j],
    };
    let HA = product(&points(H), &square(n, shifted));
    let He = square(n, |i, j| HA[i][j] + HA[j][i]);
    is_positive_definite(&He) && is_positive_somewhere(H)
}

fn is_positive_somewhere(H: &DMatrix<f64>) -> bool {
    let Some(eigen) = spectrum::symmetric(H.clone()) else {
        return false;
    };
    let e = eigen.eigenvectors.column(eigen.eigenvalues.imax());
    let e: Vec<Interval> = e.iter().map(|&e| Interval::point(e)).collect();
    let He: Vec<Interval> = points(H).iter().map(|row| dot(row, &e)).collect();
    dot(&e, &He).is_positive()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(A: &DMatrix<f64>, radius: f64) -> IntervalMatrix {
        let side = |x: f64| Interval::new(x - radius, x + radius).unwrap();
        let row = |i: usize| A.row(i).iter().map(|&x| side(x)).collect();
        (0..A.nrows()).map(row).collect()
    }

    /// The companion matrix of a polynomial with leading coefficient 1, in coordinates
    /// that leave no entry of it.
    fn companion(coefficients: &[f64]) -> DMatrix<f64> {
        let n = coefficients.len();
        let mut A = DMatrix::zeros(n, n);
        for (i, c) in coefficients.iter().enumerate() {
            A[(i, 0)] = -c;
            if i + 1 < n {
                A[(i, i + 1)] = 1.0;
            }
        }
        // integers stay exact
        let T = DMatrix::from_fn(n, n, |i, j| {
            if j <= i {
                (1 + (i * j) % 3) as f64
            } else {
                0.0
            }
        });
        let unit = DMatrix::from_fn(n, n, |i, j| match i == j {
            true => 1.0,
            false => T[(i, j)],
        });
        let mut inverse = DMatrix::<f64>::identity(n, n);
        for j in 0..n {
            for i in j + 1..n {
                let sum: f64 = (j..i).map(|k| unit[(i, k)] * inverse[(k, j)]).sum();
                inverse[(i, j)] = -sum;
            }
        }
        &unit * A * inverse
    }

    fn power(n: usize) -> Vec<f64> {
        let mut row = vec![1.0];
        for _ in 0..n {
            let next = |i: usize| row.get(i).unwrap_or(&0.0) + if i > 0 { row[i - 1] } else { 0.0 };
            row = (0..=row.len()).map(next).collect();
        }
        row[1..].to_vec()
    }

    /// (s + 1)ⁿ with n-fold eigenvalue: its computed eigenvalues lie on a circle about −1
    /// that may reach beyond the axis.
    #[test]
    fn a_defective_stable_matrix_is_not_unstable() {
        for n in 2..=14 {
            assert!(!is_unstable(&points(&companion(&power(n)), 0.0)), "{n}");
        }
    }

    /// (s + 1)ⁿ⁻¹ (s − 1/2) and (s − 1)ⁿ.
    #[test]
    fn a_defective_unstable_matrix_is() {
        for n in 3..=6 {
            let stable = power(n - 1);
            let product = |k: usize| {
                let above = if k == 0 { 1.0 } else { stable[k - 1] };
                stable.get(k).unwrap_or(&0.0) - 0.5 * above
            };
            let coefficients: Vec<f64> = (0..n).map(product).collect();
            assert!(is_unstable(&points(&companion(&coefficients), 0.0)), "{n}");
            let signed = power(n).into_iter().zip(1..);
            let mirrored: Vec<f64> = signed.map(|(c, k)| c * (-1f64).powi(k)).collect();
            assert!(is_unstable(&points(&companion(&mirrored), 0.0)), "{n}");
        }
    }

    #[test]
    fn what_only_oscillates_is_not_unstable() {
        let A = DMatrix::from_row_slice(2, 2, &[0.0, 1.0, -1.0, 0.0]);
        assert!(!is_unstable(&points(&A, 0.0)));
        assert!(!is_unstable(&[vec![Interval::ENTIRE]].to_vec()));
    }
}
