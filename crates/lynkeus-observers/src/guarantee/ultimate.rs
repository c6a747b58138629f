//! What is left of the error as t → ∞ when something acts on the plant that the
//! observer does not know, and when the measurements err.
//!
//! With e' = A e + w − Eν, |w_i| ≤ drift_i and |ν_j| ≤ noise_j, V = eᵀPe obeys
//! (√V)' ≤ −rate·√V + √(wᵀPw), so in the end √V ≤ r = max √(wᵀPw)/rate, |e| ≤ r/√λ_min(P)
//! and |e_i| ≤ r·√(P⁻¹)_ii.

use lynkeus_gain::decay::{Proof, is_below};
use lynkeus_structure::Extended;
use nalgebra::DMatrix;

use super::error_system::ErrorSystem;
use crate::Assumptions;

/// More than the rounding errors of the sums below.
const GUARD: f64 = 1.0 + 1e-9;

/// Ultimate bounds of the error.
pub(super) struct Bounds {
    /// of its Euclidean norm
    pub norm: f64,
    /// per extended state
    pub states: Vec<(String, f64)>,
}

/// The bounds; none where an assumed size is infinite.
pub(super) fn bounds(
    extended: &Extended<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
) -> Option<Bounds> {
    let n = extended.states.len();
    let through = |i: usize| -> f64 {
        let columns = system.injection[i].iter().zip(&assumptions.noise);
        columns
            .map(|(e, ν)| if *ν == 0.0 { 0.0 } else { e * ν })
            .sum()
    };
    let drift = |i: usize| assumptions.drift.get(i).copied().unwrap_or(0.0);
    let w: Vec<f64> = (0..n).map(|i| drift(i) + through(i)).collect();
    if !w.iter().all(|w| w.is_finite()) {
        return None;
    }
    let mut square = 0.0;
    for i in 0..n {
        for j in 0..n {
            square += proof.P[(i, j)].abs() * w[i] * w[j];
        }
    }
    let r = square.sqrt() / proof.rate * GUARD;
    let state = |i: usize| {
        let mut unit = DMatrix::zeros(n, n);
        unit[(i, i)] = 1.0;
        Some((
            extended.states[i].name.clone(),
            r * width(&proof.P, &unit)? * GUARD,
        ))
    };
    Some(Bounds {
        norm: r * width(&proof.P, &DMatrix::identity(n, n))? * GUARD,
        states: (0..n).map(state).collect::<Option<_>>()?,
    })
}

/// √cond(P), not below it: computed eigenvalues of a matrix in units of very different
/// size may have no correct digit at the lower end.
pub(super) fn spread(P: &DMatrix<f64>) -> Option<f64> {
    let n = P.nrows();
    let largest = P.symmetric_eigenvalues().max().sqrt() * GUARD;
    Some(largest * width(P, &DMatrix::identity(n, n))?)
}

/// The smallest β, to six digits, that is proved to satisfy |Q^½ e| ≤ β·√(eᵀPe) for a
/// projection Q.
fn width(P: &DMatrix<f64>, Q: &DMatrix<f64>) -> Option<f64> {
    // the largest eigenvalue of P^−½ Q P^−½ is that of QP⁻¹Q
    let inverse = P.clone().cholesky()?.inverse();
    let projected = Q * inverse * Q;
    let mut β = projected.symmetric_eigenvalues().max() * (1.0 + 1e-6);
    for _ in 0..40 {
        if is_below(Q, 1.0 / β, P) {
            return Some(β.sqrt() * GUARD);
        }
        β *= 1.1;
    }
    None
}
