//! Whether a given S satisfies (17) for some ρ.
//!
//! Only the first diagonal entry of P(a) knows ρ. With P̂ the rest of the matrix,
//! that is P on the kernel of C, and p the rest of its first column, Schur's
//! complement says that P is negative definite exactly if P̂ is and
//!
//! ρ > P₁₁ + pᵀ(−P̂)⁻¹p,  P₁₁ = 0.
//!
//! So an S whose P̂ has a positive eigenvalue at some vertex of the bounds
//! satisfies the lemma for no ρ, and the eigenvector is the direction that shows it.
//! Both λ_max(P̂(a)) and pᵀ(−P̂)⁻¹p are convex in a: the vertices decide.

use lynkeus_expr::Interval;
use lynkeus_proof::{Bounds, elimination, spectrum, varying, vertices};
use nalgebra::{Cholesky, DMatrix};

use super::{BISECTIONS, Error, VERTICES, check, columns, unforced};
use crate::Tridiagonal;

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
    use crate::lemma1::{RHO, construct, decay};

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
