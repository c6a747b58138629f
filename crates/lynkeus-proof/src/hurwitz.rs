//! Whether every zero of a polynomial has a negative real part, by Routh's table in
//! interval arithmetic: rounding fakes neither a yes nor a no.

use crate::spectrum;
use lynkeus_expr::Interval;
use nalgebra::DMatrix;

/// What the table says of every polynomial within the enclosures.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stability {
    /// every zero of each of them lies in the open left half-plane
    Stable,
    /// each of them has a zero on or to the right of the imaginary axis
    Unstable,
    /// the enclosures are too wide to tell
    Unknown,
}

/// Decides for sⁿ + c₁sⁿ⁻¹ + … + cₙ.
///
/// ```
/// use lynkeus_expr::Interval;
/// use lynkeus_proof::hurwitz::{Stability, decide};
///
/// let point = |c: [f64; 3]| c.map(Interval::point);
/// assert_eq!(decide(&point([3.0, 3.0, 1.0])), Stability::Stable);
/// assert_eq!(decide(&point([1.0, 1.0, 2.0])), Stability::Unstable);
/// ```
pub fn decide(coefficients: &[Interval]) -> Stability {
    // positive coefficients are necessary
    if coefficients.iter().any(|c| c.hi() <= 0.0) {
        return Stability::Unstable;
    }
    match first_column(coefficients).last() {
        Some(last) if last.hi() <= 0.0 => Stability::Unstable,
        Some(last) if !(last.is_positive() && last.is_defined()) => Stability::Unknown,
        _ => Stability::Stable,
    }
}

/// The first column of Routh's table of sⁿ + c₁sⁿ⁻¹ + … + cₙ below its 1, up to the first
/// entry that is not proved to be positive.
pub fn first_column(coefficients: &[Interval]) -> Vec<Interval> {
    let all = std::iter::once(Interval::ONE).chain(coefficients.iter().copied());
    let (mut above, mut row) = (vec![], vec![]);
    for (i, c) in all.enumerate() {
        if i % 2 == 0 { &mut above } else { &mut row }.push(c);
    }
    let mut found = vec![];
    while let Some(&pivot) = row.first() {
        found.push(pivot);
        if !(pivot.is_positive() && pivot.is_defined()) {
            break;
        }
        let factor = above[0] / pivot;
        let entry = |k: usize| {
            let beside = row.get(k).copied().unwrap_or(Interval::ZERO);
            above[k] - factor * beside
        };
        let next = (1..above.len()).map(entry).collect();
        above = std::mem::replace(&mut row, next);
    }
    found
}

/// The zeros of sⁿ + c₁sⁿ⁻¹ + … + cₙ as (real, imaginary), the rightmost first, in
/// floating point: for the reader, not for a proof. Empty where a coefficient is not
/// finite, or no zeros are found.
pub fn zeros(coefficients: &[f64]) -> Vec<(f64, f64)> {
    if !coefficients.iter().all(|c| c.is_finite()) || coefficients.is_empty() {
        return vec![];
    }
    let n = coefficients.len();
    let unit = unit(coefficients);
    let companion = DMatrix::from_fn(n, n, |i, j| match (i, j) {
        (_, 0) => -(0..=i).fold(coefficients[i], |c, _| c / unit),
        _ => f64::from(u8::from(j == i + 1)),
    });
    let Some(eigenvalues) = spectrum::eigenvalues(companion) else {
        return vec![];
    };
    let scaled = eigenvalues.iter().map(|λ| (λ.re * unit, λ.im * unit));
    let mut found: Vec<(f64, f64)> = scaled.collect();
    if !found.iter().all(|λ| λ.0.is_finite() && λ.1.is_finite()) {
        return vec![];
    }
    found.sort_by(|a, b| b.0.total_cmp(&a.0).then(b.1.total_cmp(&a.1)));
    found
}

/// A power of two in which the zeros are measured: the polynomial of s/unit has no
/// coefficient above one, and its companion matrix no entries of very different size.
fn unit(coefficients: &[f64]) -> f64 {
    let roots = (1..).zip(coefficients).filter(|(_, c)| **c != 0.0);
    let exponents = roots.map(|(k, c)| (c.abs().log2() / f64::from(k)).ceil());
    let largest = exponents.reduce(f64::max).unwrap_or(0.0);
    largest.clamp(-1022.0, 1023.0).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn points(c: &[f64]) -> Vec<Interval> {
        c.iter().map(|&c| Interval::point(c)).collect()
    }

    /// s³ + 3s² + 3a₁s + a₁a₂ is stable exactly for 9 > a₂.
    #[test]
    fn the_border_is_found_from_both_sides() {
        let with = |a: f64| decide(&points(&[3.0, 3.0, a]));
        assert_eq!(with(8.999), Stability::Stable);
        assert_eq!(with(9.001), Stability::Unstable);
        let wide = [
            Interval::point(3.0),
            Interval::point(3.0),
            Interval::new(8.0, 10.0).unwrap(),
        ];
        assert_eq!(decide(&wide), Stability::Unknown);
        // on the imaginary axis is not in the open half-plane
        assert_eq!(decide(&points(&[0.0, 1.0])), Stability::Unstable);
    }

    /// (s + r)(s + 2r)(s + 3r), whose coefficients are up to r³.
    #[test]
    fn zeros_far_from_one_are_found() {
        for r in [1e-90, 1e-6, 1e9, 1e90] {
            let found = zeros(&[6.0 * r, 11.0 * r * r, 6.0 * r * r * r]);
            for (found, exact) in found.iter().zip([-r, -2.0 * r, -3.0 * r]) {
                assert!(
                    (found.0 - exact).abs() < 1e-12 * r && found.1 == 0.0,
                    "{found:?}"
                );
            }
            assert_eq!(found.len(), 3);
        }
        assert_eq!(zeros(&[0.0, 0.0]), [(0.0, 0.0); 2]);
        assert!(zeros(&[f64::INFINITY, 1.0]).is_empty());
    }

    proptest! {
        /// The verdict is that of the zeros the polynomial was made of.
        #[test]
        fn it_agrees_with_the_zeros(
            pairs in prop::collection::vec((-2.0..1.0f64, 0.0..3.0f64), 1..5)
        ) {
            let mut c = vec![1.0];
            for &(re, im) in &pairs {
                let square = [1.0, -2.0 * re, re * re + im * im];
                let mut next = vec![0.0; c.len() + 2];
                for (i, x) in c.iter().enumerate() {
                    square.iter().enumerate().for_each(|(j, y)| next[i + j] += x * y);
                }
                c = next;
            }
            let rightmost = pairs.iter().map(|p| p.0).fold(f64::NEG_INFINITY, f64::max);
            let verdict = decide(&points(&c[1..]));
            if rightmost < -1e-6 {
                prop_assert_eq!(verdict, Stability::Stable);
            }
            if rightmost > 1e-6 {
                prop_assert_eq!(verdict, Stability::Unstable);
            }
            let found = zeros(&c[1..])[0].0;
            // repeated zeros lose digits
            prop_assert!((found - rightmost).abs() < 1e-2, "{} {}", found, rightmost);
        }
    }
}
