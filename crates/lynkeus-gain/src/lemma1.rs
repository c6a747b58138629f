//! Lemma 1 of Hammouri, Targui and Armanet (2002): one tridiagonal S for every
//! chain whose partial derivatives stay between known bounds.
//!
//! A(a) has a₁ … a_{n−1} above the diagonal and zeros else, C = (1, 0, …, 0).
//! The lemma asks for S > 0 and ρ, η > 0 with
//!
//! Pₙ(a) = A(a)ᵀS + S A(a) − ρ CᵀC ≤ −η I  for all a in the bounds.  (17)
//!
//! It is built one row at a time, as in the paper, but with sharper steps. With
//! c the last column of S_{k−1},
//!
//! P_k = [ P_{k−1}  a c ; a cᵀ  2 s a ],  a = a_{k−1},  s = s_{k−1,k} < 0,
//!
//! which is negative definite exactly if 2|s| > a·cᵀ(−P_{k−1})⁻¹c (Schur). The
//! right-hand side is convex in a₁ … a_{k−2}, so its maximum lies on a vertex of
//! the bounds, and it grows with a. The paper bounds it by ‖S_{k−1}‖²α₂²/(α₁η_{k−1})
//! instead, and its constants explode doubly exponentially with the length. Then
//! s_kk > s²/d_{k−1} (Schur again, d the pivots of S) keeps S positive definite.

use nalgebra::{Cholesky, DMatrix, DVector, SymmetricEigen};

use crate::Tridiagonal;

/// α₁ ≤ a(t) ≤ α₂, both positive: what is known of one partial derivative.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// α₁
    pub lower: f64,
    /// α₂
    pub upper: f64,
}

/// What [`construct`] found.
#[derive(Clone, Debug)]
pub struct Lemma1 {
    /// the matrix, for bounds as given
    pub S: Tridiagonal,
    /// ρ of (17)
    pub ρ: f64,
    /// η of (17)
    pub η: f64,
}

/// Why there is no S.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// bounds that the lemma does not allow
    #[error(
        "partial derivative {index} has bounds [{lower}, {upper}]: Lemma 1 needs 0 < α1 ≤ α2 < ∞"
    )]
    Bounds {
        /// which one, from 1
        index: usize,
        /// α₁
        lower: f64,
        /// α₂
        upper: f64,
    },
    /// too many vertices
    #[error(
        "a chain of {size} is too long for Lemma 1's construction (at most {MAX_SIZE}): give S explicitly"
    )]
    TooLong {
        /// states of the chain
        size: usize,
    },
    /// numbers ran out of range
    #[error(
        "Lemma 1's construction loses definiteness at row {row} in floating point: the bounds are too wide apart; narrow min/max or give S explicitly"
    )]
    Lost {
        /// the row that failed, from 1
        row: usize,
    },
}

/// 2^(n−2) vertices are visited.
const MAX_SIZE: usize = 16;
/// How far |s_{k−1,k}| lies above its limit, and s_kk above its own. Chosen by
/// a scan over n = 2…7 with a ≡ 1: the pair with the most even error poles.
const MARGIN_OFF_DIAGONAL: f64 = 1.3;
const MARGIN_DIAGONAL: f64 = 3.0;
/// (S, ρ) may be scaled together: ρ = 2 makes the paper's r = ρ/2 equal to 1.
const RHO: f64 = 2.0;

/// S, ρ, η for a chain of `bounds.len() + 1` states.
///
/// # Errors
/// Bounds that are not positive and finite, a chain longer than 16, or bounds so
/// far apart that the construction leaves the range of `f64`.
pub fn construct(bounds: &[Bounds]) -> Result<Lemma1, Error> {
    for (index, b) in bounds.iter().enumerate() {
        let fine = b.lower > 0.0 && b.lower <= b.upper && b.upper.is_finite();
        if !fine {
            return Err(Error::Bounds {
                index: index + 1,
                lower: b.lower,
                upper: b.upper,
            });
        }
    }
    let size = bounds.len() + 1;
    if size > MAX_SIZE {
        return Err(Error::TooLong { size });
    }
    let (mut diagonal, mut off) = (vec![1.0], vec![]);
    let mut pivot = 1.0;
    for k in 1..size {
        let worst = worst_cross_term(&diagonal, &off, &bounds[..k - 1])
            .ok_or(Error::Lost { row: k + 1 })?;
        let s: f64 = -MARGIN_OFF_DIAGONAL * 0.5 * bounds[k - 1].upper * worst;
        off.push(s);
        diagonal.push(MARGIN_DIAGONAL * s * s / pivot);
        pivot = (MARGIN_DIAGONAL - 1.0) * s * s / pivot;
    }
    let S = Tridiagonal::new(diagonal, off).map_err(|_| Error::Lost { row: size })?;
    let η = decay(&S, RHO, bounds);
    match η > 0.0 {
        true => Ok(Lemma1 { S, ρ: RHO, η }),
        false => Err(Error::Lost { row: size }),
    }
}

/// max over the vertices of cᵀ(−P)⁻¹c with c the last column of S.
fn worst_cross_term(diagonal: &[f64], off: &[f64], bounds: &[Bounds]) -> Option<f64> {
    let n = diagonal.len();
    let entry = |i: usize, j: usize| match i.abs_diff(j) {
        0 => diagonal[i],
        1 => off[i.min(j)],
        _ => 0.0,
    };
    let c = DVector::from_fn(n, |i, _| entry(i, n - 1));
    let mut worst: f64 = 0.0;
    for a in vertices(bounds) {
        let factor = Cholesky::new(-inequality(n, entry, RHO, &a))?;
        worst = worst.max(c.dot(&factor.solve(&c)));
    }
    worst.is_finite().then_some(worst)
}

/// The largest η with P(a) ≤ −η I on all of the bounds; negative where (17)
/// fails. λ_max is convex in a, so the vertices decide.
pub fn decay(S: &Tridiagonal, ρ: f64, bounds: &[Bounds]) -> f64 {
    vertices(bounds)
        .map(|a| {
            let p = inequality(S.size(), |i, j| S.get(i, j), ρ, &a);
            -SymmetricEigen::new(p).eigenvalues.max()
        })
        .fold(f64::INFINITY, f64::min)
}

/// P(a) = AᵀS + SA − ρCᵀC, with (SA)_ij = S_{i,j−1} a_{j−1}.
fn inequality(n: usize, s: impl Fn(usize, usize) -> f64, ρ: f64, a: &[f64]) -> DMatrix<f64> {
    let sa = DMatrix::from_fn(
        n,
        n,
        |i, j| if j == 0 { 0.0 } else { s(i, j - 1) * a[j - 1] },
    );
    let mut p = &sa + sa.transpose();
    p[(0, 0)] -= ρ;
    p
}

/// Every choice of one end per bound; ends that coincide count once.
fn vertices(bounds: &[Bounds]) -> impl Iterator<Item = Vec<f64>> {
    let open: Vec<usize> = (0..bounds.len())
        .filter(|&i| bounds[i].lower < bounds[i].upper)
        .collect();
    let lower: Vec<f64> = bounds.iter().map(|b| b.lower).collect();
    let bounds = bounds.to_vec();
    (0..1usize << open.len()).map(move |choice| {
        let mut a = lower.clone();
        for (bit, &i) in open.iter().enumerate() {
            if choice >> bit & 1 == 1 {
                a[i] = bounds[i].upper;
            }
        }
        a
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// n = 2 by hand: P = [−ρ, a; a, 2sa] with s₁₁ = 1 is negative definite iff
    /// 2|s|ρ > a; the construction takes 1.3 times the limit at a = α₂.
    #[test]
    fn two_states_by_hand() {
        let found = construct(&[Bounds {
            lower: 1.0,
            upper: 3.0,
        }])
        .unwrap();
        let s = -1.3 * 3.0 / 4.0;
        assert!((found.S.off_diagonal()[0] - s).abs() < 1e-15);
        assert!((found.S.diagonal()[1] - 3.0 * s * s).abs() < 1e-14);
    }

    /// The S printed in the paper satisfies (17) for no ρ: the largest eigenvalue
    /// of P tends to a positive limit as ρ grows (NOTES (d): +8.7).
    #[test]
    fn the_printed_matrix_fails_its_own_lemma() {
        let s = Tridiagonal::new(
            vec![1.5, 2.0, 4.0, 8.0, 10.5, 15.5, 17.5],
            vec![-0.5, -1.5, -2.0, -3.0, -4.0, -5.0],
        )
        .unwrap();
        let one = [Bounds {
            lower: 1.0,
            upper: 1.0,
        }; 6];
        let limit = decay(&s, 1e9, &one);
        assert!((limit + 8.7).abs() < 0.05, "{limit}");
        assert!(decay(&s, 2.0, &one) < limit);
    }

    #[test]
    fn bounds_that_reach_zero_are_refused() {
        let error = construct(&[Bounds {
            lower: 0.0,
            upper: 1.0,
        }])
        .unwrap_err();
        assert!(matches!(error, Error::Bounds { index: 1, .. }));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(40))]
        /// Inside the bounds too, not only on their vertices.
        #[test]
        fn the_inequality_holds_for_every_chain_in_the_bounds(
            chain in prop::collection::vec((0.3..1.0f64, 1.0..2.0f64, 0.0..1.0f64), 1..6)
        ) {
            let bounds: Vec<_> = chain
                .iter()
                .map(|&(low, factor, _)| Bounds { lower: low, upper: low * factor })
                .collect();
            let a: Vec<f64> = chain.iter().map(|&(low, factor, t)| low * (1.0 + t * (factor - 1.0))).collect();
            let found = construct(&bounds).unwrap();
            let p = inequality(a.len() + 1, |i, j| found.S.get(i, j), found.ρ, &a);
            let largest = SymmetricEigen::new(p).eigenvalues.max();
            prop_assert!(largest <= -found.η * (1.0 - 1e-6), "{largest} against {}", -found.η);
        }
    }
}
