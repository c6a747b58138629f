//! The Riccati inequality of Germani and Manes (1999), for a gain that is given:
//!
//! A P + P Aᵀ + E Eᵀ + 2αP + γ²P² ≤ 0,  P > 0   (3.2), (3.16), (4.7), (4.33)
//!
//! where A holds the gain already. With ν = eᵀP⁻¹e and e' = Ae + Ev, |v| ≤ γ|e|, it
//! gives ν' ≤ −2αν. P is found by Newton's method from below (Kleinman's iteration)
//! and counts only if the inequality holds in interval arithmetic.

use lynkeus_expr::Interval;
use nalgebra::linalg::balancing::balance_parlett_reinsch;
use nalgebra::{DMatrix, DVector};

use crate::definite::is_positive_definite;
use crate::ellipsoid::Ellipsoid;
use crate::lyapunov;
use crate::matrix::{dot, points, square};

/// Newton steps; convergence is quadratic.
const STEPS: usize = 40;
/// Halvings of the interval in which the largest rate or bound is sought.
const HALVINGS: usize = 40;
/// The inequality is solved with a little more, so that rounding does not decide.
const SLACK: f64 = 1e-12;
const SHARE: f64 = 1e-10;

/// The largest entry of A that is looked at.
const LARGEST: f64 = 1e100;

/// A proved solution of the inequality; none where none was found.
///
/// ```
/// use lynkeus_proof::riccati::solve;
///
/// // −2·3 P + 1 + 2·0.5 P + 4 P² ≤ 0 has solutions, with 3 in place of 0.5 none
/// let one = |x: f64| nalgebra::DMatrix::from_element(1, 1, x);
/// let found = solve(&one(-3.0), &one(1.0), 0.5, 2.0).unwrap();
/// let P = found.P[0];
/// assert!(-6.0 * P + 1.0 + P + 4.0 * P * P <= 0.0);
/// assert!(solve(&one(-3.0), &one(1.0), 3.0, 2.0).is_none());
/// ```
pub fn solve(A: &DMatrix<f64>, E: &DMatrix<f64>, α: f64, γ: f64) -> Option<Ellipsoid> {
    // e = D e', D of powers of two, so that fast poles leave nothing of very
    // different size; scaling back is exact
    let mut A = A.clone();
    // squares that overflow would keep the balancing going for ever
    if !A.iter().all(|a| a.abs() < LARGEST) {
        return None;
    }
    let D = balance_parlett_reinsch(&mut A);
    let n = A.nrows();
    let E = DMatrix::from_fn(n, E.ncols(), |i, j| E[(i, j)] / D[i]);
    let M = DMatrix::from_diagonal(&D.map(|d| (d * γ) * (d * γ)));
    let shifted = &A + DMatrix::identity(n, n) * α;
    let P = newton(&shifted, &raised(&shifted, &E)?, &M)?;
    if !holds(&A, &E, α, (γ, &D), &P) {
        return None;
    }
    let P = DMatrix::from_fn(n, n, |i, j| D[i] * P[(i, j)] * D[j]);
    Ellipsoid::of(P, α)
}

/// A solution with the largest α below `limit`.
pub fn fastest(A: &DMatrix<f64>, E: &DMatrix<f64>, γ: f64, limit: f64) -> Option<Ellipsoid> {
    let mut best = solve(A, E, 1e-6 * limit, γ)?;
    let (mut low, mut high) = (best.α, limit);
    for _ in 0..HALVINGS {
        let middle = low + (high - low) / 2.0;
        match solve(A, E, middle, γ) {
            Some(found) => (low, best) = (middle, found),
            None => high = middle,
        }
        if high - low < 1e-4 * high {
            break;
        }
    }
    Some(best)
}

/// E Eᵀ with a little more in each direction, on the scale that P has there.
fn raised(A: &DMatrix<f64>, E: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = A.nrows();
    let W = E * E.transpose();
    let size = W.trace();
    let scale = if size > 0.0 { size } else { 1.0 };
    let W = W + DMatrix::identity(n, n) * (SLACK * scale);
    let P = dual(A, &W)?;
    Some(W + DMatrix::from_diagonal(&P.diagonal()) * (SHARE * A.amax()))
}

/// The smallest P with A P + P Aᵀ + W + P M P = 0.
fn newton(A: &DMatrix<f64>, W: &DMatrix<f64>, M: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let mut P = dual(A, W)?;
    for _ in 0..STEPS {
        let next = dual(&(A + &P * M), &(W - &P * M * &P))?;
        let change = (&next - &P).norm();
        P = next;
        if change <= 1e-13 * P.norm() {
            return Some(P);
        }
    }
    None
}

/// P > 0 with A P + P Aᵀ + W = 0; none where A is not Hurwitz, as far as P tells.
fn dual(A: &DMatrix<f64>, W: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let P = lyapunov::solve(&A.transpose(), W)?;
    P.clone().cholesky().map(|_| P)
}

/// The inequality with γ²P D²P for its last term, in interval arithmetic.
fn holds(
    A: &DMatrix<f64>,
    E: &DMatrix<f64>,
    α: f64,
    (γ, D): (f64, &DVector<f64>),
    P: &DMatrix<f64>,
) -> bool {
    let n = P.nrows();
    let scaled = DMatrix::from_fn(n, n, |i, j| P[(i, j)] * D[j]);
    let [A, E, P, scaled] = [A, E, P, &scaled].map(points);
    let entry = |i: usize, j: usize| {
        let linear = dot(&A[i], &P[j]) + dot(&P[i], &A[j]);
        let square = dot(&scaled[i], &scaled[j]) * Interval::point(γ).powi(2);
        let rate = Interval::point(2.0 * α) * P[i][j];
        Interval::point(0.0) - (linear + dot(&E[i], &E[j]) + rate + square)
    };
    is_positive_definite(&square(n, entry))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The balancing of such a matrix does not end.
    #[test]
    fn poles_beyond_reason_have_no_solution() {
        for pole in [-1e308, -1e200, f64::NAN] {
            let A = DMatrix::from_row_slice(2, 2, &[pole, 1.0, pole, 0.0]);
            let E = second();
            assert!(solve(&A, &E, 0.5, 1.0).is_none());
        }
    }

    fn second() -> DMatrix<f64> {
        DMatrix::from_row_slice(2, 1, &[0.0, 1.0])
    }

    fn companion(K: &[f64]) -> DMatrix<f64> {
        let entry =
            |i: usize, j: usize| f64::from(u8::from(j == i + 1)) - if j == 0 { K[i] } else { 0.0 };
        DMatrix::from_fn(K.len(), K.len(), entry)
    }

    /// For A − KC with the poles −1, −2 and B = (0, 1)ᵀ the transfer function from v to e
    /// is (1, s + 3)ᵀ/(s² + 3s + 2), of norm √10/2 at s = 0: the limit of γ at α = 0.
    #[test]
    fn the_limit_is_the_bounded_real_lemmas() {
        let A = companion(&[3.0, 2.0]);
        let E = second();
        let limit = 2.0 / 10f64.sqrt();
        assert!(solve(&A, &E, 1e-9, limit * 0.999).is_some());
        assert!(solve(&A, &E, 1e-9, limit * 1.001).is_none());
    }

    /// Without perturbation the rate is that of the slowest pole.
    #[test]
    fn the_rate_without_perturbation() {
        let found = fastest(&companion(&[3.0, 2.0]), &second(), 1e-6, 1.0);
        let found = found.unwrap();
        assert!(found.α > 0.99 && found.smallest <= found.largest);
        // eᵢ'P⁻¹e against the definition
        let exact = found.P.clone().cholesky().unwrap().inverse()[(1, 1)].sqrt();
        let weight = found.weight(&[0.0, 1.0]);
        assert!(weight >= exact && weight < exact * (1.0 + 1e-5));
    }
}
