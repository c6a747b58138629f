//! What random noise leaves of an error with V' ≤ −2·rate·V, in mean square and in probability.
//!
//! e' = A e + w − Σ bⱼνⱼ with white process noise beside it and V = eᵀPe obeys
//!
//! dV ≤ (−2·rate·V + 2√V·(β + Σ cⱼ|νⱼ|) + τ) dt + 2√V dM, d⟨M⟩ ≤ σ dt,
//!
//! with β what is bounded for certain, cⱼ² = bⱼᵀPbⱼ, τ = tr(PQ) and σ the largest eigenvalue of
//! √Q P √Q, for densities Q. The νⱼ are any processes that process noise does not depend on, sampled, held,
//! correlated in time and with each other; each has at every time a normal law.
//!
//! *In mean square.* (E V)' ≤ −2·rate·E V + 2√(E V)·(β + Σ cⱼ sdⱼ) + τ by Schwarz's inequality: [`settled`].
//!
//! *In probability.* Let B' = −rate·B + β + Σ cⱼ|νⱼ|. Then Y = max(√V − B, 0)² has
//! dY ≤ (−2·rate·Y + τ) dt + 2√Y dM (of √(V + h) first, then h → 0), so that for 0 < μ < rate/σ
//! E e^(μY) ends below e^(μτ/a), a = 2(rate − μσ): the drift of e^(μY) is at most
//! μ(τ − aY)e^(μY) ≤ a(e^(μτ/a) − e^(μY)). The mean of Y over its worst share δ is at most
//! (ln E e^(μY) + ln(1/δ))/μ, with the best μ (√(τ/2rate) + √(σ ln(1/δ)/rate))². Means over worst shares
//! are subadditive (Rockafellar and Uryasev 2000), of averages over time and of sums, however their terms depend on each
//! other; of √V ≤ B + √Y it is
//!
//! √(τ/(2·rate)) + √(σ ln(1/δ)/rate) + (β + Σ cⱼ sdⱼ T)/rate
//!
//! at most, T that of |N(0, 1)|. The quantile is below its mean.

use lynkeus_expr::Interval;
use nalgebra::DMatrix;

use crate::chain::settled;
use crate::definite::is_positive_definite;
use crate::matrix::square;
use crate::spectrum;

/// The probability of the bounds.
pub const PROBABILITY: f64 = 0.99;

/// ln(1/δ), not below it.
const LOG: f64 = 4.605_171;

/// The mean of |N(0, 1)| over the share δ of its largest values, not below it: 2φ(z)/δ.
const TAIL: f64 = 2.892_2;

/// How V = eᵀPe moves, see above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Noise {
    /// V' ≤ −2·rate·V without all else
    pub rate: f64,
    /// β where all that has a bound is at it
    pub certain: Interval,
    /// the same with roots of mean squares where these are known
    pub usual: Interval,
    /// Σ cⱼ sdⱼ of normal errors
    pub normal: Interval,
    /// τ = tr(PQ)
    pub trace: Interval,
    /// σ
    pub largest: f64,
}

impl Noise {
    /// What √(E V) ends within.
    pub fn in_mean_square(&self) -> Interval {
        settled(self.rate, self.usual + self.normal, self.trace)
    }

    /// What √V is within in the end, at any one time with [`PROBABILITY`].
    pub fn in_probability(&self) -> Interval {
        let [rate, σ, two] = [self.rate, self.largest, 2.0].map(Interval::point);
        let process = (self.trace / (two * rate)).sqrt() + (σ * Interval::point(LOG) / rate).sqrt();
        process + (self.certain + self.normal * Interval::point(TAIL)) / rate
    }
}

/// σ: an upper bound of the largest eigenvalue of √Q P √Q, for densities Q of independent noises; none where
/// it cannot be enclosed.
///
/// ```
/// use lynkeus_proof::noise::largest;
/// use nalgebra::DMatrix;
///
/// let P = DMatrix::from_row_slice(2, 2, &[2.0, 1.0, 1.0, 2.0]);
/// let found = largest(&P, &[1.0, 1.0]).unwrap();
/// assert!(found >= 3.0 && found < 3.001);
/// ```
pub fn largest(P: &DMatrix<f64>, densities: &[f64]) -> Option<f64> {
    let n = P.nrows();
    if P.shape() != (n, n) || densities.len() != n || densities.iter().all(|q| *q == 0.0) {
        return (densities.len() == n).then_some(0.0);
    }
    let root = |i: usize| Interval::point(densities[i]).sqrt();
    let entry = |i: usize, j: usize| root(i) * Interval::point(P[(i, j)]) * root(j);
    let computed = DMatrix::from_fn(n, n, |i, j| entry(i, j).midpoint());
    let guess = spectrum::symmetric(computed)?.eigenvalues.max();
    let is_above = |σ: f64| {
        let diagonal = |i, j| {
            if i == j {
                Interval::point(σ)
            } else {
                Interval::ZERO
            }
        };
        is_positive_definite(&square(n, |i, j| diagonal(i, j) - entry(i, j)))
    };
    let raised = [1.0 + 1e-9, 1.0 + 1e-6, 1.001, 1.1, 2.0].map(|by| by * guess);
    raised.into_iter().find(|σ| σ.is_finite() && is_above(*σ))
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Simpson's rule for ∫ of f from a on.
    fn integral(a: f64, f: impl Fn(f64) -> f64) -> f64 {
        let (count, width) = (20_000, 12.0 - a);
        let h = width / f64::from(count);
        let at = |k: i32| f(a + f64::from(k) * h);
        let inner: f64 = (1..count)
            .map(|k| at(k) * if k % 2 == 1 { 4.0 } else { 2.0 })
            .sum();
        (at(0) + inner + at(count)) * h / 3.0
    }

    /// The constants by quadrature: whatever k is, k + E(|ξ| − k)₊/δ is at least T, and T itself at one of them.
    #[test]
    fn the_tail_of_a_normal_number() {
        let δ = 1.0 - PROBABILITY;
        assert!(LOG >= (1.0 / δ).ln() && LOG < (1.0 / δ).ln() + 1e-5);
        let density = |x: f64| 2.0 * (-0.5 * x * x).exp() / (2.0 * std::f64::consts::PI).sqrt();
        let bound = |k: f64| k + integral(k, |x| (x - k) * density(x)) / δ;
        let least = (0..4000).map(|i| bound(2.5 + 5e-5 * f64::from(i)));
        let least = least.fold(f64::INFINITY, f64::min);
        assert!(TAIL >= least && TAIL < least + 1e-3, "{least}");
    }

    /// A scalar: e' = −e with white noise, whose V is known, e = N(0, q/2).
    #[test]
    fn a_scalar_has_its_known_law() {
        let noise = Noise {
            rate: 1.0,
            certain: Interval::ZERO,
            usual: Interval::ZERO,
            normal: Interval::ZERO,
            trace: Interval::point(2.0),
            largest: 2.0,
        };
        // variance 1: the mean square is exact, the quantile of 99 % 2.576
        let mean_square = noise.in_mean_square().hi();
        assert!((1.0..1.0 + 1e-12).contains(&mean_square), "{mean_square}");
        let probable = noise.in_probability().hi();
        assert!((1.0 + (2.0 * 4.605_17_f64).sqrt() - probable).abs() < 1e-5 && probable > 2.576);
        // e' = −e + ν with ν one normal number for all times: e is that number
        let held = Noise {
            trace: Interval::ZERO,
            largest: 0.0,
            normal: Interval::ONE,
            ..noise
        };
        assert_eq!(held.in_mean_square().hi(), 1.0);
        assert!(held.in_probability().hi() > 2.576 && held.in_probability().hi() < 2.9);
    }

    /// A correlated P beside densities that differ.
    #[test]
    fn the_largest_share_of_a_density() {
        let P = DMatrix::from_row_slice(2, 2, &[4.0, -1.0, -1.0, 9.0]);
        let found = largest(&P, &[1.0, 0.25]).unwrap();
        let exact = f64::midpoint(6.25, (1.75_f64.powi(2) + 4.0 * 0.25).sqrt());
        assert!(found >= exact && found < 1.001 * exact, "{found} {exact}");
        assert_eq!(largest(&P, &[0.0, 0.0]), Some(0.0));
        assert!(largest(&P, &[1.0]).is_none());
    }
}
