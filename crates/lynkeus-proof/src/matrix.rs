//! Matrices of intervals, and what is made of them.

use lynkeus_expr::Interval;

/// A matrix of intervals, row by row.
pub type IntervalMatrix = Vec<Vec<Interval>>;

/// The sum, each addition outward rounded.
pub fn sum(terms: impl Iterator<Item = Interval>) -> Interval {
    terms.fold(Interval::ZERO, |a, b| a + b)
}

/// The n×n table of the entries.
pub fn square<T>(n: usize, entry: impl Fn(usize, usize) -> T) -> Vec<Vec<T>> {
    (0..n)
        .map(|i| (0..n).map(|j| entry(i, j)).collect())
        .collect()
}

/// The upper ends of the entries.
pub fn upper(matrix: &IntervalMatrix) -> Vec<Vec<f64>> {
    let row = |row: &Vec<Interval>| row.iter().map(|x| x.hi()).collect();
    matrix.iter().map(row).collect()
}
