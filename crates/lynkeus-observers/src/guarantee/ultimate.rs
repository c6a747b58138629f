//! What is left of the error as t → ∞ when something acts on the plant that the
//! observer does not know, and when the measurements err.
//!
//! With e' = A e + w − Eν, |w_i| ≤ drift_i and |ν_j| ≤ noise_j, V = eᵀPe obeys
//! (√V)' ≤ −rate·√V + √(wᵀPw), so in the end √V ≤ r = max √(wᵀPw)/rate, |e| ≤ r/√λ_min(P)
//! and |e_i| ≤ r·√(P⁻¹)_ii.
//!
//! Process noise, white with the densities Q on x', adds tr(PQ) to (E V)'; then √(E V) settles where
//! rate·E V = √(wᵀPw)·√(E V) + tr(PQ)/2, and √(E e_i²) obeys what |e_i| did.

use lynkeus_expr::{Budget, Interval};
use lynkeus_proof::chain::settled;
use lynkeus_proof::decay::{self, Proof};
use lynkeus_proof::definite::is_below;
use lynkeus_proof::magnitude::times;
use lynkeus_proof::matrix::sum;
use lynkeus_proof::spectrum;
use lynkeus_structure::Extended;
use nalgebra::DMatrix;

use super::error_system::ErrorSystem;
use crate::{Assumptions, Bounds};

/// A guessed bound of a quadratic form is raised by this before it is tried.
const RESERVE: f64 = 1e-6;
/// How often it is raised further.
const TRIES: usize = 40;

/// Slower rates whose P may leave a smaller mean square, as shares of the fastest.
const SLOWER: [f64; 3] = [0.85, 0.6, 0.35];

/// What the error ends within without process noise; none where an assumed size is infinite.
pub(super) fn bounds(
    extended: &Extended<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
) -> Option<Bounds> {
    of(extended, system, proof, assumptions, Interval::ZERO)
}

/// What the root of its mean square ends within with process noise, by the P of the proof and those of
/// slower rates: each of the bounds holds.
pub(super) fn mean_square(
    extended: &Extended<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
    budget: &Budget,
) -> Option<Bounds> {
    let slower = SLOWER.iter().filter_map(|share| {
        decay::prove(&system.models, &system.scale, share * proof.rate, budget)
    });
    let each = std::iter::once(proof.clone()).chain(slower);
    let each = each.filter_map(|proof| {
        let densities = assumptions.process_noise.iter().enumerate();
        let trace =
            sum(densities.map(|(i, q)| Interval::point(proof.P[(i, i)]) * Interval::point(*q)));
        of(extended, system, &proof, assumptions, trace)
    });
    each.reduce(|a, b| Bounds {
        norm: a.norm.min(b.norm),
        states: a
            .states
            .into_iter()
            .zip(b.states)
            .map(|(a, b)| if a.value <= b.value { a } else { b })
            .collect(),
    })
}

fn of(
    extended: &Extended<'_>,
    system: &ErrorSystem,
    proof: &Proof,
    assumptions: &Assumptions,
    trace: Interval,
) -> Option<Bounds> {
    let n = extended.states.len();
    let through = |i: usize| {
        let columns = system.injection[i].iter().zip(&assumptions.noise);
        sum(columns.map(|(e, ν)| match times(*e, *ν) == 0.0 {
            true => Interval::ZERO,
            false => Interval::point(*e) * Interval::point(*ν),
        }))
    };
    let drift = |i: usize| assumptions.drift.get(i).copied().unwrap_or(0.0);
    let w: Vec<Interval> = (0..n)
        .map(|i| Interval::point(drift(i)) + through(i))
        .collect();
    let finite = |x: f64| Some(x).filter(|x| x.is_finite());
    for w in &w {
        finite(w.hi())?;
    }
    let pairs = (0..n).flat_map(|i| (0..n).map(move |j| (i, j)));
    let square = sum(pairs.map(|(i, j)| Interval::point(proof.P[(i, j)]).abs() * w[i] * w[j]));
    let r = settled(proof.rate, square.sqrt(), trace);
    let state = |i: usize| {
        let mut unit = DMatrix::zeros(n, n);
        unit[(i, i)] = 1.0;
        let bound = finite((r * width(&proof.P, &unit)?).hi())?;
        Some((extended.states[i].name.clone(), bound).into())
    };
    Some(Bounds {
        norm: finite((r * width(&proof.P, &DMatrix::identity(n, n))?).hi())?,
        states: (0..n).map(state).collect::<Option<_>>()?,
    })
}

/// √cond(P), not below it: computed eigenvalues of a matrix in units of very different
/// size may have no correct digit at the lower end.
pub(super) fn spread(P: &DMatrix<f64>) -> Option<f64> {
    let n = P.nrows();
    let unit = DMatrix::identity(n, n);
    let largest = spectrum::symmetric(P.clone())?.eigenvalues.max();
    let largest = raised(largest, |α| {
        is_below(P, 1.0, &(&unit * α)).then(|| Interval::point(α).sqrt())
    })?;
    Some((largest * width(P, &unit)?).hi())
}

/// The smallest β, to six digits, that is proved to satisfy |Q^½ e| ≤ β·√(eᵀPe) for a
/// projection Q.
fn width(P: &DMatrix<f64>, Q: &DMatrix<f64>) -> Option<Interval> {
    // the largest eigenvalue of P^−½ Q P^−½ is that of QP⁻¹Q
    let inverse = P.clone().cholesky()?.inverse();
    let projected = Q * inverse * Q;
    let largest = spectrum::symmetric(projected)?.eigenvalues.max();
    raised(largest, |β| {
        let share = 1.0 / β;
        is_below(Q, share, P).then(|| (Interval::ONE / Interval::point(share)).sqrt())
    })
}

/// What is proved of the smallest number above a guess for which there is a proof.
fn raised(guess: f64, proved: impl Fn(f64) -> Option<Interval>) -> Option<Interval> {
    let mut bound = guess * (1.0 + RESERVE);
    for _ in 0..TRIES {
        if let Some(found) = proved(bound) {
            return Some(found);
        }
        bound *= 1.1;
    }
    None
}
