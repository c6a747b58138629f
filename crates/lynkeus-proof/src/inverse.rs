//! Enclosures of inverses: an approximate inverse is a proposal, of which the residual is
//! enclosed (Neumaier 1990, *Interval methods for systems of equations*, section 4.1).
//!
//! [`interval::solve`] encloses the solutions of a system, and so the columns of an inverse.
//! [`Inverse`] keeps A⁻¹ = R(I + E)⁻¹ as a product instead: in B A⁻¹ the numbers of R meet those
//! of B before anything is bounded.

use lynkeus_expr::{Interval, interval};
use nalgebra::DMatrix;

use crate::magnitude::{self, Magnitudes, plus, size, times, total};
use crate::matrix::{IntervalMatrix, points, product, square};

/// Share by which a guessed bound is raised before it is checked.
const RESERVE: f64 = 1e-9;

/// A = (I + E)R⁻¹ with |E| so small that |(I + E)⁻¹| ≤ N, for every A within an interval
/// matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    /// R, an approximate inverse of the middle
    pub R: DMatrix<f64>,
    /// N
    pub N: Magnitudes,
}

impl Inverse {
    /// What is known of A⁻¹ for every A within the square interval matrix: with R ≈ A_c⁻¹,
    /// A_c the middle, and |A R − I| ≤ E of spectral radius below one, |A⁻¹| ≤ |R| (I − E)⁻¹.
    /// That the spectral radius is below one and that the bound is one are checked. None
    /// where this proves nothing.
    ///
    /// ```
    /// use lynkeus_expr::Interval;
    /// use lynkeus_proof::inverse::Inverse;
    ///
    /// let found = Inverse::of(&vec![vec![Interval::new(2.0, 4.0).unwrap()]]).unwrap();
    /// assert!((found.bounds()[0][0] - 0.5).abs() < 1e-8);
    /// assert!(Inverse::of(&vec![vec![Interval::new(-1.0, 1.0).unwrap()]]).is_none());
    /// ```
    pub fn of(A: &IntervalMatrix) -> Option<Self> {
        let n = A.len();
        if A.iter().any(|row| row.len() != n) {
            return None;
        }
        let middle = square(n, |i, j| Interval::point(A[i][j].midpoint()));
        let R = guessed(n, |i, j| A[i][j].midpoint())?;
        let radius = square(n, |i, j| (A[i][j] - middle[i][j]).magnitude());
        let spread = magnitude::product(&radius, &square(n, |i, j| R[(i, j)].abs()));
        let near = product(&middle, &points(&R));
        let E = square(n, |i, j| {
            let rest = near[i][j] - Interval::point(one(i, j));
            plus(rest.magnitude(), spread[i][j])
        });
        let N = raised(&E)?;
        Some(Self { R, N })
    }

    /// Bounds of the entries of A⁻¹ = R(I + E)⁻¹.
    pub fn bounds(&self) -> Magnitudes {
        let sizes = square(self.R.nrows(), |i, j| self.R[(i, j)].abs());
        magnitude::product(&sizes, &self.N)
    }
}

fn one(i: usize, j: usize) -> f64 {
    f64::from(u8::from(i == j))
}

/// N ≥ (I − E)⁻¹ ≥ 0, proved by N − EN ≥ I, where E v < v for some v > 0 proves that the
/// inverse is Neumann's series.
fn raised(E: &Magnitudes) -> Option<Magnitudes> {
    let n = E.len();
    let N = guessed(n, |i, j| one(i, j) - E[i][j])?;
    let v: Vec<f64> = N.row_iter().map(|row| row.sum()).collect();
    let N = square(n, |i, j| N[(i, j)] + RESERVE * v[i]);
    let covers = |i: usize, j: usize| {
        let mapped = total((0..n).map(|k| times(E[i][k], N[k][j])));
        N[i][j] >= 0.0 && (Interval::point(N[i][j]) - size(mapped)).lo() >= one(i, j)
    };
    let shrinks = |i: usize| v[i] > total((0..n).map(|k| times(E[i][k], v[k])));
    (0..n)
        .all(|i| v[i] >= 0.0 && shrinks(i) && (0..n).all(|j| covers(i, j)))
        .then_some(N)
}

/// The inverse, without any guarantee.
fn guessed(n: usize, entry: impl Fn(usize, usize) -> f64) -> Option<DMatrix<f64>> {
    let inverse = DMatrix::from_fn(n, n, entry).try_inverse()?;
    inverse.iter().all(|x| x.is_finite()).then_some(inverse)
}

/// Upper bounds of (S⁻¹)_jj, or none where the enclosure of S⁻¹ is not finite.
pub fn diagonal(matrix: &IntervalMatrix) -> Option<Vec<f64>> {
    let n = matrix.len();
    let flat: Vec<Interval> = matrix.iter().flatten().copied().collect();
    let entry = |j: usize| {
        let right: Vec<Interval> = (0..n).map(|i| Interval::point(one(i, j))).collect();
        let (column, regular) = interval::solve(&flat, &right);
        let bound = column[j].hi();
        (regular && bound.is_finite() && bound > 0.0).then_some(bound)
    };
    (0..n).map(entry).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    fn matrix(ranges: &[[(f64, f64); 2]]) -> IntervalMatrix {
        let entry = |&(low, high): &(f64, f64)| Interval::new(low, high).unwrap();
        let row = |row: &[(f64, f64); 2]| row.iter().map(entry).collect();
        ranges.iter().map(row).collect()
    }

    /// A wide entry beside the diagonal does no harm.
    #[test]
    fn inverses_of_triangular_ranges() {
        let ranges = [[(1.0, 1.0), (0.0, 0.0)], [(-4.5, 4.5), (-3.25, -1.0)]];
        let ranges = matrix(&ranges);
        let found = Inverse::of(&ranges).unwrap().bounds();
        assert!((found[0][0] - 1.0).abs() < 1e-6 && found[0][1] < 1e-6);
        assert!((found[1][0] - 4.5).abs() < 1e-6 && (found[1][1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn singular_ranges_have_no_bound() {
        let ranges = matrix(&[[(1.0, 1.0), (0.9, 1.1)], [(1.0, 1.0), (1.0, 1.0)]]);
        assert_eq!(Inverse::of(&ranges), None);
        assert_eq!(Inverse::of(&vec![vec![Interval::ENTIRE]]), None);
        assert_eq!(Inverse::of(&vec![vec![]]), None);
    }

    #[test]
    fn the_diagonal_of_an_inverse() {
        let found = diagonal(&matrix(&[
            [(2.0, 2.0), (1.0, 1.0)],
            [(1.0, 1.0), (2.0, 2.0)],
        ]))
        .unwrap();
        for bound in found {
            assert!((bound - 2.0 / 3.0).abs() < 1e-12 && bound >= 2.0 / 3.0);
        }
    }
}
