//! Matrices of intervals: every operation is outward rounded.

use lynkeus_expr::Interval;
use nalgebra::DMatrix;

use crate::magnitude::Magnitudes;

/// A matrix of intervals, row by row.
pub type IntervalMatrix = Vec<Vec<Interval>>;

/// The sum; zero of no terms.
pub fn sum(terms: impl Iterator<Item = Interval>) -> Interval {
    terms.fold(Interval::ZERO, |a, b| a + b)
}

/// Σ a_k b_k, over as many as both have.
pub fn dot(a: &[Interval], b: &[Interval]) -> Interval {
    sum(a.iter().zip(b).map(|(a, b)| *a * *b))
}

/// A·B
pub fn product(A: &IntervalMatrix, B: &IntervalMatrix) -> IntervalMatrix {
    let columns = B.first().map_or(0, Vec::len);
    let entry = |row: &[Interval], j: usize| sum(row.iter().zip(B).map(|(a, b)| *a * b[j]));
    let row = |row: &Vec<Interval>| (0..columns).map(|j| entry(row, j)).collect();
    A.iter().map(row).collect()
}

/// The n×n table of the entries.
pub fn square<T>(n: usize, entry: impl Fn(usize, usize) -> T) -> Vec<Vec<T>> {
    let row = |i| (0..n).map(|j| entry(i, j)).collect();
    (0..n).map(row).collect()
}

/// The matrix as intervals of one number each.
pub fn points(matrix: &DMatrix<f64>) -> IntervalMatrix {
    let row = |i| matrix.row(i).iter().map(|&x| Interval::point(x)).collect();
    (0..matrix.nrows()).map(row).collect()
}

/// The upper ends of the entries.
pub fn upper(matrix: &IntervalMatrix) -> Magnitudes {
    let row = |row: &Vec<Interval>| row.iter().map(|x| x.hi()).collect();
    matrix.iter().map(row).collect()
}
