//! Arithmetic of upper bounds of sizes, which are never negative: every result is rounded
//! up, and an infinite bound is one that is not known.

use lynkeus_expr::Interval;

/// Bounds of the absolute values of a matrix, row by row.
pub type Magnitudes = Vec<Vec<f64>>;

/// A bound as an interval: an infinite one bounds nothing.
pub fn size(bound: f64) -> Interval {
    match bound.is_finite() {
        true => Interval::point(bound),
        false => Interval::new(0.0, f64::INFINITY).unwrap_or(Interval::ENTIRE),
    }
}

/// a + b for bounds, rounded up.
pub fn plus(a: f64, b: f64) -> f64 {
    (size(a) + size(b)).hi()
}

/// The sum of bounds, rounded up.
pub fn total(bounds: impl Iterator<Item = f64>) -> f64 {
    bounds.fold(0.0, plus)
}

/// a b for bounds, rounded up, of which 0 · ∞ is 0.
pub fn times(a: f64, b: f64) -> f64 {
    match a == 0.0 || b == 0.0 {
        true => 0.0,
        false => (size(a) * size(b)).hi(),
    }
}

/// √a for a bound, rounded up.
pub fn root(a: f64) -> f64 {
    size(a).sqrt().hi()
}

/// The product of two matrices of bounds.
pub fn product(A: &[Vec<f64>], B: &[Vec<f64>]) -> Magnitudes {
    let columns = B.first().map_or(0, Vec::len);
    let entry = |row: &Vec<f64>, j: usize| {
        let terms = row.iter().zip(B);
        total(terms.map(|(a, b)| times(*a, b[j])))
    };
    let row = |row: &Vec<f64>| (0..columns).map(|j| entry(row, j)).collect();
    A.iter().map(row).collect()
}

/// √(Σ x²)
pub fn length(x: &[f64]) -> f64 {
    root(total(x.iter().map(|x| times(x.abs(), x.abs()))))
}

/// A bound of the spectral norm of every matrix with entries up to these: the
/// smaller of Frobenius' and of √(‖A‖₁ ‖A‖_∞).
pub fn norm(A: &[Vec<f64>]) -> f64 {
    let frobenius = length(&A.concat());
    let columns = A.first().map_or(0, Vec::len);
    let rows = A.iter().map(|row| total(row.iter().copied()));
    let columns = (0..columns).map(|j| total(A.iter().map(|row| row[j])));
    let mixed = times(rows.fold(0.0, f64::max), columns.fold(0.0, f64::max));
    frobenius.min(root(mixed))
}
