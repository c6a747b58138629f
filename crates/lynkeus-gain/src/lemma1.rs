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
//!
//! Whether a given S satisfies (17) for some ρ: only the first diagonal entry of P(a) knows ρ.
//! With P̂ the rest of the matrix, that is P on the kernel of C, and p the rest of its first
//! column, Schur's complement says that P is negative definite exactly if P̂ is and
//!
//! ρ > P₁₁ + pᵀ(−P̂)⁻¹p,  P₁₁ = 0.
//!
//! So an S whose P̂ has a positive eigenvalue at some vertex of the bounds
//! satisfies the lemma for no ρ, and the eigenvector is the direction that shows it.
//! Both λ_max(P̂(a)) and pᵀ(−P̂)⁻¹p are convex in a: the vertices decide.

use lynkeus_expr::Interval;
use lynkeus_proof::elimination::{self, Column, Tails};
use lynkeus_proof::search::largest;
use lynkeus_proof::{Bounds, spectrum, varying, vertices};
use nalgebra::{Cholesky, DMatrix};

use crate::{FactorError, Tridiagonal};

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
    /// numbers ran out of range
    #[error(
        "Lemma 1's construction loses definiteness at row {row} in floating point: the bounds are too wide apart; narrow min/max or give S explicitly"
    )]
    Lost {
        /// the row that failed, from 1
        row: usize,
    },
    /// AᵀS + SA has no value
    #[error("the entries of S are so large that AᵀS + SA has no value in floating point")]
    Overflow,
}

/// Partials that vary up to which all of their vertices are visited; beyond, the states are
/// eliminated one by one.
const VERTICES: usize = 10;
/// Bisections of a number that elimination proves.
const BISECTIONS: usize = 60;
/// How far |s_{k−1,k}| lies above its limit, and s_kk above its own. Chosen by
/// a scan over n = 2…7 with a ≡ 1: the pair with the most even error poles.
const MARGIN_OFF_DIAGONAL: f64 = 1.3;
const MARGIN_DIAGONAL: f64 = 3.0;
/// (S, ρ) may be scaled together: ρ = 2 makes the paper's r = ρ/2 equal to 1.
const RHO: f64 = 2.0;

/// S, ρ, η for a chain of `bounds.len() + 1` states.
///
/// # Errors
/// Bounds that are not positive and finite, or so far apart, for a chain so long, that the
/// construction leaves the range of `f64`.
pub fn construct(bounds: &[Bounds]) -> Result<Lemma1, Error> {
    let size = check(bounds)?;
    let w = scale(bounds);
    let scaled = bounds.iter().map(|b| (b.lower * w, b.upper * w).into());
    let scaled: Vec<Bounds> = scaled.collect();
    let (mut diagonal, mut off): (Vec<f64>, Vec<f64>) = (vec![1.0], vec![]);
    let mut pivot = 1.0;
    let mut growth = Growth::new();
    for (k, bound) in scaled.iter().enumerate() {
        let before = off.last().copied().unwrap_or(0.0);
        let worst = growth.cross([before, diagonal[k]]);
        let s: f64 = -MARGIN_OFF_DIAGONAL * 0.5 * bound.upper * worst;
        growth.add([before, diagonal[k], s], *bound);
        off.push(s);
        // s² alone may leave the range of numbers
        diagonal.push(MARGIN_DIAGONAL * s * (s / pivot));
        pivot = (MARGIN_DIAGONAL - 1.0) * s * (s / pivot);
        let sound = pivot.is_finite() && pivot > 0.0 && growth.tails.positive();
        if !sound {
            return Err(Error::Lost { row: k + 2 });
        }
    }
    let lost = Error::Lost { row: size };
    let S = unscaled(diagonal, off, w).map_err(|_| lost.clone())?;
    let η = decay(&S, RHO, bounds);
    match η > 0.0 {
        true => Ok(Lemma1 { S, ρ: RHO, η }),
        false => Err(lost),
    }
}

/// The number of states of a chain with these bounds, if Lemma 1 can treat it.
fn check(bounds: &[Bounds]) -> Result<usize, Error> {
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
    Ok(bounds.len() + 1)
}

/// 1/geometric mean of the bounds: w·a is then around one. In the coordinates
/// x_j·w^{1−j} the chain has the partials w·a, and (17) keeps its form and its ρ.
fn scale(bounds: &[Bounds]) -> f64 {
    let logarithms = bounds.iter().map(|b| (b.lower.ln() + b.upper.ln()) / 2.0);
    match bounds.len() {
        0 => 1.0,
        n => (-logarithms.sum::<f64>() / n as f64).exp(),
    }
}

/// S = D S' D with D = diag(1, 1/w, 1/w², …), from the scaled coordinates back.
fn unscaled(diagonal: Vec<f64>, off: Vec<f64>, w: f64) -> Result<Tridiagonal, FactorError> {
    let d = |j: usize| w.powi(-(j as i32));
    let diagonal = diagonal.iter().enumerate().map(|(j, s)| s * d(j) * d(j));
    let off = off.iter().enumerate().map(|(j, s)| s * d(j) * d(j + 1));
    Tridiagonal::new(diagonal.collect(), off.collect())
}

/// The elimination while S grows, each state in a unit in which its column is about one:
/// the numbers of long chains spread over hundreds of decades.
struct Growth {
    tails: Tails,
    /// 1/unit of the last two states
    units: [f64; 2],
}

impl Growth {
    fn new() -> Self {
        Self {
            tails: Tails::start(Interval::point(RHO)),
            units: [0.0, 1.0],
        }
    }

    /// max of cᵀ(−P)⁻¹c over the bounds, c being zero but in its last two entries.
    fn cross(&self, c: [f64; 2]) -> f64 {
        let scaled = |i: usize| Interval::point(c[i]) * Interval::point(self.units[i]);
        self.tails.cross([0, 1].map(scaled))
    }

    /// The column with a·(s_{k−2,k−1}, s_{k−1,k−1}, 2s_{k−1,k}).
    fn add(&mut self, [far, near, s]: [f64; 3], bounds: Bounds) {
        let unit = (-2.0 * s * bounds.upper).sqrt().recip();
        let scaled = |x: f64, unit: f64, other: f64| {
            Interval::point(x) * Interval::point(unit) * Interval::point(other)
        };
        let column = Column {
            far: scaled(far, self.units[0], unit),
            near: scaled(near, self.units[1], unit),
            own: scaled(-2.0 * s, unit, unit),
        };
        self.tails = self.tails.grown(&column, bounds, 0.0);
        self.units = [self.units[1], unit];
    }
}

/// An η > 0 with P(a) ≤ −η I on all of the bounds, or a number ≤ 0 where (17)
/// fails. λ_max is convex in a, so the vertices decide. With D² = diag S the
/// largest eigenvalue −μ of D⁻¹PD⁻¹ gives xᵀPx ≤ −μ|Dx|² ≤ −μ·min(S_ii)·|x|²,
/// and is well conditioned where P itself is not. Of long chains the states are
/// eliminated instead; a number ≤ 0 may then also mean that (17) is not proved, as where it
/// leaves the range of numbers.
pub fn decay(S: &Tridiagonal, ρ: f64, bounds: &[Bounds]) -> f64 {
    let μ = match varying(bounds) > VERTICES {
        true => eliminated_decay(S, ρ, bounds),
        false => least_margin(S, ρ, bounds).unwrap_or(0.0),
    };
    let ends = |f: fn(f64, f64) -> f64, start| S.diagonal().iter().copied().fold(start, f);
    // a negative μ is scaled the other way: P has an eigenvalue above zero anyhow
    match μ > 0.0 {
        true => μ * ends(f64::min, f64::INFINITY),
        false => μ * ends(f64::max, 0.0),
    }
}

/// The largest μ with D⁻¹PD⁻¹ ≤ −μ at every vertex; none where an eigenvalue is not found.
fn least_margin(S: &Tridiagonal, ρ: f64, bounds: &[Bounds]) -> Option<f64> {
    let mut margins = vertices(bounds).map(|a| {
        let eigen = spectrum::symmetric(inequality(S, ρ, &a))?;
        Some(-eigen.eigenvalues.max())
    });
    margins.try_fold(f64::INFINITY, |least, μ| Some(least.min(μ?)))
}

/// The largest μ with D⁻¹PD⁻¹ ≤ −μ that elimination proves, or zero.
fn eliminated_decay(S: &Tridiagonal, ρ: f64, bounds: &[Bounds]) -> f64 {
    let columns = columns(S);
    let first = Interval::point(ρ) / Interval::point(S.get(0, 0));
    let proved = |μ: f64| elimination::positive(first, &columns, bounds, μ);
    largest(first.hi(), proved).unwrap_or(0.0)
}

/// The columns of −D⁻¹PD⁻¹ from the second state on, D² = diag S.
fn columns(S: &Tridiagonal) -> Vec<Column> {
    elimination::columns(S.size(), |i, j| Interval::point(S.get(i, j)))
}

/// D⁻¹(AᵀS + SA − ρCᵀC)D⁻¹ with D² = diag S.
fn inequality(S: &Tridiagonal, ρ: f64, a: &[f64]) -> DMatrix<f64> {
    let mut P = unforced(S, a);
    P[(0, 0)] -= ρ;
    let weight = |i: usize| S.get(i, i).sqrt();
    DMatrix::from_fn(S.size(), S.size(), |i, j| {
        P[(i, j)] / (weight(i) * weight(j))
    })
}

/// A(a)ᵀS + S A(a), where (SA)_ij = S_{i,j−1} a_{j−1}.
fn unforced(S: &Tridiagonal, a: &[f64]) -> DMatrix<f64> {
    let SA = DMatrix::from_fn(S.size(), S.size(), |i, j| match j {
        0 => 0.0,
        _ => S.get(i, j - 1) * a[j - 1],
    });
    &SA + SA.transpose()
}

/// What (17) asks of ρ.
#[derive(Clone, Debug, PartialEq)]
pub enum Kernel {
    /// it holds for every ρ above this one
    Holds {
        /// the least ρ
        ρ: f64,
    },
    /// it holds for no ρ
    Breaks(Breaking),
}

/// Where and in which direction (17) fails for every ρ.
#[derive(Clone, Debug, PartialEq)]
pub struct Breaking {
    /// the partials a₁, a₂, … of the worst vertex
    pub a: Vec<f64>,
    /// largest eigenvalue of P̂ there: what that of P tends to as ρ grows
    pub eigenvalue: f64,
    /// unit eigenvector, its first entry 0, its largest positive
    pub direction: Vec<f64>,
}

/// Decides for which ρ the matrix `S` satisfies (17) on the bounds.
///
/// # Errors
/// Bounds that are not positive and finite or of another number than S has
/// partials for; a long chain of which neither is found; numbers out of range.
pub fn kernel(S: &Tridiagonal, bounds: &[Bounds]) -> Result<Kernel, Error> {
    check(bounds)?;
    let n = S.size();
    if bounds.len() + 1 != n {
        return Err(Error::Lost { row: n });
    }
    if varying(bounds) > VERTICES {
        return eliminated(S, bounds);
    }
    let (mut least, mut worst): (f64, Option<Breaking>) = (0.0, None);
    let mut overflows = false;
    for a in vertices(bounds) {
        let P = unforced(S, &a);
        let Phat = P.view((1, 1), (n - 1, n - 1)).into_owned();
        let p = P.view((1, 0), (n - 1, 1)).into_owned();
        if let Some(factor) = Cholesky::new(-&Phat) {
            let ρ = p.dot(&factor.solve(&p));
            overflows |= !ρ.is_finite() || !P.iter().all(|x| x.is_finite());
            least = least.max(ρ);
            continue;
        }
        let found = breaking(a, Phat);
        overflows |= found.is_none();
        let eigenvalue = |b: &Option<Breaking>| b.as_ref().map(|b| b.eigenvalue);
        if eigenvalue(&found) > eigenvalue(&worst) {
            worst = found;
        }
    }
    match worst {
        Some(found) => Ok(Kernel::Breaks(found)),
        None if overflows => Err(Error::Overflow),
        None => Ok(Kernel::Holds { ρ: least }),
    }
}

/// Powers of two that ρ is sought among.
const DOUBLINGS: i32 = 400;

/// The same by elimination, for chains with many vertices.
fn eliminated(S: &Tridiagonal, bounds: &[Bounds]) -> Result<Kernel, Error> {
    let columns = columns(S);
    let lowest = Interval::point(bounds[0].lower) * columns[0].own;
    // the second state is the first on the kernel of C, and the larger its partial the better
    let definite =
        lowest.is_positive() && elimination::positive(lowest, &columns[1..], &bounds[1..], 0.0);
    if !definite {
        let found = ascended(S, bounds).ok_or(Error::Overflow)?;
        return match found.eigenvalue > 0.0 {
            true => Ok(Kernel::Breaks(found)),
            false => Err(Error::Lost { row: S.size() }),
        };
    }
    let holds = |ρ: f64| {
        let first = Interval::point(ρ) / Interval::point(S.get(0, 0));
        elimination::positive(first, &columns, bounds, 0.0)
    };
    let power = |k: i32| 2f64.powi(k);
    let Some(k) = (-DOUBLINGS..DOUBLINGS).find(|&k| holds(power(k))) else {
        return Err(Error::Lost { row: S.size() });
    };
    let mut ends = (power(k - 1), power(k));
    for _ in 0..BISECTIONS {
        let middle = 0.5 * (ends.0 + ends.1);
        match holds(middle) {
            true => ends.1 = middle,
            false => ends.0 = middle,
        }
    }
    Ok(Kernel::Holds { ρ: ends.1 })
}

/// Steps uphill; a few are usual.
const STEPS: usize = 100;

/// A vertex with a large eigenvalue, by steps uphill from the upper ends. λ_max(P̂(a)) is the
/// largest vᵀP̂(a)v, each linear in a: at the ends that make that of the present eigenvector v
/// largest λ_max is as large or larger. None where an eigenvalue is not found.
fn ascended(S: &Tridiagonal, bounds: &[Bounds]) -> Option<Breaking> {
    let n = S.size();
    let at = |a: Vec<f64>| {
        let Phat = unforced(S, &a).view((1, 1), (n - 1, n - 1)).into_owned();
        breaking(a, Phat)
    };
    let mut best = at(bounds.iter().map(|b| b.upper).collect())?;
    for _ in 0..STEPS {
        let a = (0..bounds.len()).map(|i| match slope(S, &best.direction, i + 1) >= 0.0 {
            true => bounds[i].upper,
            false => bounds[i].lower,
        });
        let found = at(a.collect())?;
        if found.eigenvalue <= best.eigenvalue {
            break;
        }
        best = found;
    }
    Some(best)
}

/// ½ ∂(vᵀPv)/∂a_{j−1} = v_j Σ_i v_i S_{i,j−1}
fn slope(S: &Tridiagonal, v: &[f64], j: usize) -> f64 {
    let near = j.saturating_sub(2)..=j;
    v[j] * near.map(|i| v[i] * S.get(i, j - 1)).sum::<f64>()
}

/// None where the eigenvalues are not found.
fn breaking(a: Vec<f64>, Phat: DMatrix<f64>) -> Option<Breaking> {
    let eigen = spectrum::symmetric(Phat)?;
    let place = eigen.eigenvalues.imax();
    let column = eigen.eigenvectors.column(place);
    // a direction has no sign; the largest entry is shown as positive
    let sign = column[column.iamax()].signum();
    let direction = std::iter::once(0.0).chain(column.iter().map(|x| sign * x));
    Some(Breaking {
        a,
        eigenvalue: eigen.eigenvalues[place],
        direction: direction.collect(),
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::SymmetricEigen;
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
        // coordinates are scaled by w = 1/√3 first, and back by 1/w after
        let s = -1.3 * 3.0 / 4.0;
        assert!((found.S.off_diagonal()[0] - s).abs() < 1e-15);
        assert!((found.S.diagonal()[1] - 3.0 * s * s).abs() < 1e-14);
    }

    /// The S printed in the paper satisfies (17) for no ρ: the largest eigenvalue
    /// of P tends to a positive limit as ρ grows, about 8.7.
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
        let unscaled = |ρ: f64| {
            let d = |i: usize| s.get(i, i).sqrt();
            let p = inequality(&s, ρ, &[1.0; 6]);
            let p = DMatrix::from_fn(7, 7, |i, j| d(i) * p[(i, j)] * d(j));
            SymmetricEigen::new(p).eigenvalues.max()
        };
        assert!((unscaled(1e9) - 8.7).abs() < 0.05, "{}", unscaled(1e9));
        for ρ in [0.1, 2.0, 1e3, 1e9] {
            assert!(unscaled(ρ) > 8.0 && decay(&s, ρ, &one) < 0.0);
        }
    }

    /// Six partials that vary by a factor of 5.5, as in a column on its whole box:
    /// the numbers spread over 14 decades and the inequality still holds.
    #[test]
    fn a_long_chain_with_wide_bounds_keeps_definite() {
        let mut bounds = [Bounds {
            lower: 4.4,
            upper: 24.0,
        }; 6];
        bounds[0] = Bounds {
            lower: 0.44,
            upper: 2.4,
        };
        let found = construct(&bounds).unwrap();
        assert!(found.η > 0.0);
    }

    /// a·s overflows: no η is claimed.
    #[test]
    fn what_leaves_the_range_of_numbers_does_not_hold() {
        let S = Tridiagonal::new(vec![1.0, 1e300], vec![-1e100]).unwrap();
        let bounds = [Bounds {
            lower: 1e250,
            upper: 1e250,
        }];
        let η = decay(&S, 2.0, &bounds);
        assert!(η <= 0.0, "{η}");
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

    /// Twenty states, beyond any list of vertices: (17) at random choices of the ends, by
    /// eigenvalues.
    #[test]
    fn twenty_states_hold_at_random_vertices() {
        let bounds = [Bounds {
            lower: 0.95,
            upper: 1.05,
        }; 19];
        let found = construct(&bounds).unwrap();
        assert!(found.η > 0.0);
        let mut choice = 12_345_u64;
        for _ in 0..200 {
            let mut end = || {
                choice = choice
                    .wrapping_mul(6_364_136_223_846_793_005)
                    .wrapping_add(1);
                if choice >> 63 == 0 { 0.95 } else { 1.05 }
            };
            let a: Vec<f64> = (0..19).map(|_| end()).collect();
            let P = inequality(&found.S, found.ρ, &a);
            let smallest = found
                .S
                .diagonal()
                .iter()
                .copied()
                .fold(f64::INFINITY, f64::min);
            let μ = -SymmetricEigen::new(P).eigenvalues.max();
            assert!(μ * smallest >= found.η * (1.0 - 1e-9), "{μ} {}", found.η);
        }
        let Kernel::Holds { ρ } = kernel(&found.S, &bounds).unwrap() else {
            panic!()
        };
        assert!(ρ < RHO, "{ρ}");
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
            let inner: Vec<_> = a.iter().map(|&a| Bounds { lower: a, upper: a }).collect();
            let η = decay(&found.S, found.ρ, &inner);
            prop_assert!(η >= found.η * (1.0 - 1e-6), "{η} against {}", found.η);
        }
    }

    const ONE: Bounds = Bounds {
        lower: 1.0,
        upper: 1.0,
    };

    /// Against NumPy's eigvalsh of the 6×6 and the 5×5 matrix on the kernel of C.
    #[test]
    fn the_printed_matrices_break_for_every_ρ() {
        let diagonal = [1.5, 2.0, 4.0, 8.0, 10.5, 15.5, 17.5];
        let off = [-0.5, -1.5, -2.0, -3.0, -4.0, -5.0];
        for (n, expected) in [(7, 8.747_348_170_830_902), (6, 5.751_599_097_749_908)] {
            let S = Tridiagonal::new(diagonal[..n].to_vec(), off[..n - 1].to_vec()).unwrap();
            let found = kernel(&S, &vec![ONE; n - 1]).unwrap();
            let Kernel::Breaks(found) = found else {
                panic!("{found:?}")
            };
            assert!(
                (found.eigenvalue - expected).abs() < 1e-9,
                "{}",
                found.eigenvalue
            );
            assert_eq!((found.direction.len(), found.direction[0]), (n, 0.0));
        }
    }

    /// n = 2: P = [−ρ, a; a, 2sa] asks for ρ > a/(2|s|), at worst a = α₂.
    #[test]
    fn the_least_ρ_by_hand() {
        let S = Tridiagonal::new(vec![1.0, 3.0], vec![-0.8]).unwrap();
        let bounds = Bounds {
            lower: 0.5,
            upper: 2.0,
        };
        let Kernel::Holds { ρ } = kernel(&S, &[bounds]).unwrap() else {
            panic!()
        };
        assert!((ρ - 2.0 / 1.6).abs() < 1e-14, "{ρ}");
        assert!(decay(&S, ρ * 1.001, &[bounds]) > 0.0 && decay(&S, ρ * 0.999, &[bounds]) < 0.0);
    }

    /// Eleven partials, of which the best of all vertices is known: steps uphill lead near to it.
    #[test]
    fn steps_uphill_find_a_large_eigenvalue() {
        let n = 12;
        for seed in 0..3 {
            let shaken = |i: usize| (7 * i + 5 * seed + 1) as f64 * 0.618_033_988_749_894_9 % 1.0;
            let off = (0..n - 1).map(|i| -0.3 - shaken(i)).collect();
            let diagonal = (0..n).map(|i| 3.0 + shaken(i + n)).collect();
            let S = Tridiagonal::new(diagonal, off).unwrap();
            let bounds: Vec<Bounds> = (0..n - 1)
                .map(|i| (0.5, 0.5 + 1.5 * shaken(i + 2 * n)).into())
                .collect();
            let found = ascended(&S, &bounds).unwrap();
            let eigenvalue = |a: &[f64]| {
                let P = unforced(&S, a).view((1, 1), (n - 1, n - 1)).into_owned();
                P.symmetric_eigenvalues().max()
            };
            assert!((eigenvalue(&found.a) - found.eigenvalue).abs() < 1e-12);
            let best = vertices(&bounds)
                .map(|a| eigenvalue(&a))
                .fold(0.0, f64::max);
            assert!(
                found.eigenvalue > 0.95 * best,
                "{} {best}",
                found.eigenvalue
            );
            assert!(matches!(kernel(&S, &bounds), Ok(Kernel::Breaks(_))));
        }
    }

    /// Of a hundred states with every partial open, in the time of a few decompositions.
    #[test]
    fn long_chains_are_climbed_in_a_few_steps() {
        let n = 100;
        let S = Tridiagonal::new(vec![3.0; n], vec![-0.5; n - 1]).unwrap();
        let bounds = Bounds {
            lower: 0.5,
            upper: 2.0,
        };
        let Kernel::Breaks(found) = kernel(&S, &vec![bounds; n - 1]).unwrap() else {
            panic!()
        };
        assert!(found.eigenvalue > 0.0 && found.direction.len() == n);
    }

    /// 2sa overflows: neither a least ρ nor a direction is claimed.
    #[test]
    fn what_leaves_the_range_of_numbers_is_told() {
        let S = Tridiagonal::new(vec![1.0, 1e300], vec![-1e100]).unwrap();
        let bounds = Bounds {
            lower: 1e250,
            upper: 1e250,
        };
        assert_eq!(kernel(&S, &[bounds]), Err(Error::Overflow));
        let long = Tridiagonal::new(vec![1.0; 13], vec![-0.4; 12]).unwrap();
        let wide = Bounds {
            lower: 1.0,
            upper: f64::MAX,
        };
        assert!(kernel(&long, &[wide; 12]).is_err());
    }

    /// The construction keeps its own ρ above the least one.
    #[test]
    fn lemma_1_satisfies_itself() {
        let bounds = [Bounds {
            lower: 0.5,
            upper: 1.5,
        }; 4];
        let found = construct(&bounds).unwrap();
        let Kernel::Holds { ρ } = kernel(&found.S, &bounds).unwrap() else {
            panic!()
        };
        assert!(ρ < RHO, "{ρ}");
    }
}
