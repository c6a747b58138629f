//! The coefficients of Astolfi and Marconi, *A high-gain nonlinear observer with
//! limited gain power*, IEEE Trans. Automatic Control 60 (2015) 3059–3064.
//!
//! m = n − 1 second-order blocks with gains (ℓk_i1, ℓ²k_i2) and the innovations
//! e_i = b_{i−1} − a_i; their scaled errors follow ε' = ℓ M ε with
//!
//! a_i' = b_i + k_i1 (b_{i−1} − a_i),  b_i' = b_{i+1} + k_i2 (b_{i−1} − a_i),  b_0 = b_{m+1} = 0.
//!
//! Eliminating the a_i leaves a tridiagonal system in the b_i, whose continuant
//! telescopes: with κ_i = k_12 ⋯ k_i2 and κ_0 = 1,
//!
//! det(sI − M) = Σ_{i=0}^{m} κ_i ∏_{j>i} s(s + k_j1).
//!
//! So P(s) = det(sI − M) can be any Hurwitz polynomial of degree 2m, block by block from the
//! last: κ_m = P(0), −k_m1 is a real root of (P − P(0))/s, which has odd degree, and
//! (P − P(0))/(s(s + k_m1)) is the polynomial of the blocks before.

use std::cmp::Ordering;

use lynkeus_proof::decay::{self, ErrorModel, Proof};
use lynkeus_proof::matrix::points;
use lynkeus_proof::{lyapunov, spectrum, vertices};
use nalgebra::{DMatrix, DVector};

use crate::integrators;

/// (k_i1, k_i2) of each block, from the first.
pub type Coefficients = Vec<[f64; 2]>;

/// Coefficients with every eigenvalue of M at −1: P = (w + 1)^m in w = s(s + 2), so
/// that k_i1 = 2 and κ_i is the binomial coefficient.
///
/// ```
/// assert_eq!(lynkeus_gain::low_power::at_one(2), [[2.0, 2.0], [2.0, 0.5]]);
/// ```
pub fn at_one(blocks: usize) -> Coefficients {
    let ratio = |i: usize| (blocks + 1 - i) as f64 / i as f64;
    (1..=blocks).map(|i| [2.0, ratio(i)]).collect()
}

/// Coefficients with the eigenvalues of M at `poles`, two per block. None where their number
/// is odd, or where the recursion leaves the range of numbers.
///
/// ```
/// let K = lynkeus_gain::low_power::place(&[-1.0, -1.0, -2.0, -2.0]).unwrap();
/// assert!((lynkeus_gain::low_power::abscissa(&K) + 1.0).abs() < 1e-6);
/// ```
pub fn place(poles: &[f64]) -> Option<Coefficients> {
    if !poles.len().is_multiple_of(2) {
        return None;
    }
    let mut P = vec![1.0];
    P.extend(integrators::place(poles));
    let mut blocks = vec![];
    while P.len() > 1 {
        let κ = P.pop()?; // P(0); what is left is (P − P(0))/s
        let u = -real_root(&P)?;
        deflate(&mut P, -u);
        blocks.push((u, κ));
    }
    blocks.reverse();
    let mut before = 1.0;
    let mut K = vec![];
    for (u, κ) in blocks {
        K.push([u, κ / before]);
        before = κ;
    }
    K.iter().flatten().all(|k| k.is_finite()).then_some(K)
}

/// P(s), coefficients from the highest.
fn value(P: &[f64], s: f64) -> f64 {
    P.iter().fold(0.0, |sum, c| sum * s + c)
}

/// A real root of a monic polynomial of odd degree: by bisection, on the negative
/// side if P(0) > 0, as with every Hurwitz polynomial.
fn real_root(P: &[f64]) -> Option<f64> {
    // Cauchy's bound
    let bound = 1.0 + P[1..].iter().fold(0.0, |m: f64, c| m.max(c.abs()));
    if !bound.is_finite() {
        return None;
    }
    let ends = match value(P, 0.0) > 0.0 {
        true => [-bound, 0.0],
        false => [0.0, bound],
    };
    let passes = |s: f64| value(P, s).partial_cmp(&0.0) != Some(Ordering::Less);
    let [low, high] = integrators::bisected(ends, passes);
    Some(low + (high - low) / 2.0)
}

/// P/(s − root), by Horner's scheme.
fn deflate(P: &mut Vec<f64>, root: f64) {
    for k in 1..P.len() {
        P[k] += root * P[k - 1];
    }
    P.pop();
}

/// M, with a_i' = ratio_i b_i + … and b_i' = ratio_{i+1} b_{i+1} + …: the partials of a plant
/// as multiples of those that the gain is made for.
fn matrix(K: &[[f64; 2]], ratios: &[f64]) -> DMatrix<f64> {
    let m = K.len();
    let mut M = DMatrix::zeros(2 * m, 2 * m);
    for (i, k) in K.iter().enumerate() {
        for (row, k) in k.iter().enumerate() {
            M[(2 * i + row, 2 * i)] = -k;
            if i > 0 {
                M[(2 * i + row, 2 * i - 1)] = *k;
            }
        }
        M[(2 * i, 2 * i + 1)] = ratios[i];
        if i + 1 < m {
            M[(2 * i + 1, 2 * i + 3)] = ratios[i + 1];
        }
    }
    M
}

/// The largest real part of an eigenvalue of M; NaN where a coefficient is not finite.
pub fn abscissa(K: &[[f64; 2]]) -> f64 {
    spectrum::abscissa(matrix(K, &vec![1.0; K.len()])).unwrap_or(f64::NAN)
}

/// Blocks beyond which [`tolerates`] gives up: it visits 2^blocks vertices.
const MOST: usize = 10;

/// Is ε' = ℓM(t)ε proved to converge for partials that vary as they like within the ratios
/// (smallest, largest) to those the gain is made for? Decided with the quadratic
/// function of the constant M, MᵀP + PM = −I, in interval arithmetic: M is affine in the
/// ratios, so their vertices suffice. Where it is false convergence may hold all the same.
pub fn tolerates(K: &[[f64; 2]], ratios: &[(f64, f64)]) -> bool {
    let m = K.len();
    if m > MOST || ratios.len() != m {
        return false;
    }
    let M = matrix(K, &vec![1.0; m]);
    let Some(P) = lyapunov::solve(&M, &DMatrix::identity(2 * m, 2 * m)) else {
        return false;
    };
    let vertices = vertices(&ratios.iter().map(|&r| r.into()).collect::<Vec<_>>());
    let models: Vec<ErrorModel> = vertices
        .map(|ratios| ErrorModel {
            constant: points(&matrix(K, &ratios)),
            sectors: vec![],
        })
        .collect();
    let proof = Proof {
        rate: 0.0,
        P,
        multipliers: vec![DVector::zeros(0); models.len()],
    };
    decay::holds(&models, &proof)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// det(sI − M) at s against the product over the poles.
    fn assert_places(poles: &[f64]) {
        let K = place(poles).unwrap();
        let M = matrix(&K, &vec![1.0; K.len()]);
        for s in [0.0, 0.3, 1.0, 2.5] {
            let shifted = DMatrix::identity(poles.len(), poles.len()) * s - &M;
            let expected: f64 = poles.iter().map(|λ| s - λ).product();
            let found = shifted.determinant();
            assert!(
                (found - expected).abs() < 1e-9 * expected,
                "{found} {expected}"
            );
        }
        assert!(abscissa(&K) < 0.0);
    }

    #[test]
    fn the_eigenvalues_are_the_poles() {
        assert_places(&[-1.0, -2.0]);
        assert_places(&[-1.0, -2.0, -3.0, -4.0]);
        assert_places(&[-0.5, -0.5, -1.0, -2.0, -3.0, -7.0]);
        assert_places(&[-1.0, -1.1, -1.2, -1.3, -1.4, -1.5, -1.6, -1.7, -1.8, -1.9]);
    }

    #[test]
    fn the_closed_form_is_what_the_recursion_finds() {
        for blocks in 1..=6 {
            let (closed, found) = (at_one(blocks), place(&vec![-1.0; 2 * blocks]).unwrap());
            for (c, f) in closed.iter().flatten().zip(found.iter().flatten()) {
                assert!((c - f).abs() < 1e-9 * c, "{closed:?} {found:?}");
            }
        }
    }

    #[test]
    fn an_odd_number_of_poles_fits_no_blocks() {
        assert_eq!(place(&[-1.0; 3]), None);
    }

    #[test]
    fn small_variations_are_tolerated_and_a_change_of_sign_is_not() {
        let K = at_one(2);
        assert!(tolerates(&K, &[(1.0, 1.0); 2]));
        assert!(tolerates(&K, &[(0.95, 1.05); 2]));
        assert!(!tolerates(&K, &[(-1.0, 1.0); 2]));
    }
}
