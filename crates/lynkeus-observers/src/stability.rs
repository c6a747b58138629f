//! Whether a gain stabilises a chain.
//!
//! In the scaled error of a high-gain observer a large θ leaves A(a) − KC, with the partials
//! a_1, a_2, … of the chain above the diagonal of A, whose characteristic polynomial is
//! sⁿ + k₁sⁿ⁻¹ + a₁k₂sⁿ⁻² + a₁a₂k₃sⁿ⁻³ + …

use lynkeus_expr::Interval;
use lynkeus_proof::hurwitz::{self, Stability};

use crate::proof::words::shown;
use lynkeus_structure::Point;

/// A chain with its gain.
pub(crate) struct GainedChain<'a> {
    /// K
    pub K: &'a [f64],
    /// bounds of a_1, a_2, …, signs included
    pub partials: &'a [(f64, f64)],
}

impl GainedChain<'_> {
    /// For every constant choice of the partials within their bounds.
    pub fn frozen(&self) -> Stability {
        let side = |&(low, high): &(f64, f64)| Interval::new(low, high).unwrap_or(Interval::ENTIRE);
        hurwitz::decide(&self.coefficients(self.partials.iter().map(side)))
    }

    /// k₁, a₁k₂, a₁a₂k₃, …
    fn coefficients(&self, partials: impl Iterator<Item = Interval>) -> Vec<Interval> {
        let mut product = Interval::ONE;
        let ahead = partials.chain([Interval::ONE]);
        let term = |(&k, a): (&f64, Interval)| {
            let coefficient = product * Interval::point(k);
            product = product * a;
            coefficient
        };
        self.K.iter().zip(ahead).map(term).collect()
    }

    /// Partials in the middle of their bounds; none where these do not keep one sign or
    /// are infinite.
    pub fn middle(&self) -> Option<Vec<f64>> {
        let middle = |&(low, high): &(f64, f64)| {
            let one_sign = low > 0.0 && high > 0.0 || low < 0.0 && high < 0.0;
            let product = low * high;
            // the product alone may leave the range of numbers
            let size = match product.is_normal() {
                true => product.sqrt(),
                false => low.abs().sqrt() * high.abs().sqrt(),
            };
            (one_sign && size.is_finite()).then(|| size.copysign(low))
        };
        self.partials.iter().map(middle).collect()
    }

    /// The eigenvalues of A − KC for these partials, the rightmost first; empty where they are
    /// not found.
    pub fn eigenvalues(&self, a: &[f64]) -> Vec<(f64, f64)> {
        let coefficients = self.coefficients(a.iter().map(|&a| Interval::point(a)));
        // of a product out of range the middle is no coefficient
        if !coefficients.iter().all(|c| c.magnitude().is_finite()) {
            return vec![];
        }
        let middles: Vec<f64> = coefficients.iter().map(|c| c.midpoint()).collect();
        hurwitz::zeros(&middles)
    }

    /// The partials `a` as a witness that the chain is not stable: its value is the largest real
    /// part there, or the zero that it is at least, where it is not found.
    pub fn witness(&self, a: &[f64]) -> Point {
        let name = |j: usize| format!("a{}", j + 1);
        let rightmost = self.eigenvalues(a).first().map_or(0.0, |λ| λ.0.max(0.0));
        let coordinates = a.iter().enumerate();
        Point {
            coordinates: coordinates.map(|(j, &a)| (name(j), a).into()).collect(),
            value: rightmost,
        }
    }
}

/// What is said of eigenvalues: `eigenvalues −1, −2 ± 1i`, or that none were found.
pub(crate) fn told(eigenvalues: &[(f64, f64)]) -> String {
    match eigenvalues.is_empty() {
        true => "eigenvalues beyond the range of numbers".to_owned(),
        false => format!("eigenvalues {}", listed(eigenvalues)),
    }
}

/// Eigenvalues in words: conjugate pairs once.
fn listed(eigenvalues: &[(f64, f64)]) -> String {
    let upper = eigenvalues.iter().filter(|λ| λ.1 >= 0.0);
    let one = |&(re, im): &(f64, f64)| match im == 0.0 {
        true => shown(re),
        false => format!("{} ± {}i", shown(re), shown(im)),
    };
    upper.map(one).collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    fn frozen(K: &[f64], partials: &[(f64, f64)]) -> Stability {
        GainedChain { K, partials }.frozen()
    }

    /// s² + 2s + a: stable for a > 0, and with the sign of a in K for a < 0.
    #[test]
    fn two_states_by_hand() {
        assert_eq!(frozen(&[2.0, 1.0], &[(0.1, 9.0)]), Stability::Stable);
        assert_eq!(frozen(&[2.0, 1.0], &[(-2.0, -2.0)]), Stability::Unstable);
        assert_eq!(frozen(&[2.0, -1.0], &[(-2.0, -2.0)]), Stability::Stable);
        assert_eq!(frozen(&[-2.0, 1.0], &[(1.0, 1.0)]), Stability::Unstable);
        assert_eq!(frozen(&[2.0, 1.0], &[(-1.0, 1.0)]), Stability::Unknown);
    }

    /// Positive partials are not enough for three states: (3, 3, 1) needs a₂ < 9.
    #[test]
    fn a_positive_partial_can_be_too_large() {
        assert_eq!(
            frozen(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (10.0, 10.0)]),
            Stability::Unstable
        );
        assert_eq!(
            frozen(&[3.0, 3.0, 1.0], &[(1.0, 1.0), (8.0, 8.0)]),
            Stability::Stable
        );
    }

    #[test]
    fn pairs_are_listed_once() {
        let chain = GainedChain {
            K: &[-2.0, 5.0],
            partials: &[(1.0, 1.0)],
        };
        assert_eq!(listed(&chain.eigenvalues(&[1.0])), "1 ± 2i");
        assert_eq!(chain.middle(), Some(vec![1.0]));
        let mixed = GainedChain {
            K: &[1.0, 1.0],
            partials: &[(-1.0, 1.0)],
        };
        assert_eq!(mixed.middle(), None);
    }

    /// √(1e-200 · 1e-140) = 1e-170, whose square is no number beside zero; and its inverse.
    #[test]
    fn the_middle_of_small_and_large_bounds() {
        let middle = |low: f64, high: f64| {
            let partials = &[(low, high)];
            GainedChain {
                K: &[1.0, 1.0],
                partials,
            }
            .middle()
        };
        for (low, high, exact) in [(1e-200, 1e-140, 1e-170), (1e140, 1e200, 1e170)] {
            let found = middle(low, high).unwrap()[0];
            assert!((found / exact - 1.0).abs() < 1e-14, "{found}");
            let found = middle(-high, -low).unwrap()[0];
            assert!((found / exact + 1.0).abs() < 1e-14, "{found}");
        }
        assert_eq!(middle(0.0, 1.0), None);
        assert_eq!(middle(1.0, f64::INFINITY), None);
        assert_eq!(middle(f64::NAN, 1.0), None);
    }

    #[test]
    fn what_is_not_found_is_not_listed() {
        let chain = GainedChain {
            K: &[1e200, 1e200],
            partials: &[(1e200, 1e200)],
        };
        assert_eq!(chain.eigenvalues(&[1e200]), []);
        assert_eq!(chain.witness(&[1e200]).value, 0.0);
        assert!(!told(&[]).ends_with(' '));
    }
}
