//! Inverses.

use lynkeus_expr::Interval;

use crate::magnitude::{plus, product, size, times, total};

/// Share by which a guessed bound is raised before it is checked.
const RESERVE: f64 = 1e-9;

/// Ã = (I + E)R⁻¹ with |E| so small that |(I + E)⁻¹| ≤ N.
#[derive(Clone, Debug, PartialEq)]
pub struct Inverse {
    /// R, an approximate inverse of the middle
    pub R: Vec<Vec<f64>>,
    /// N
    pub N: Vec<Vec<f64>>,
}

impl Inverse {
    /// Bounds of the entries of Ã⁻¹ = R(I + E)⁻¹.
    pub fn bounds(&self) -> Vec<Vec<f64>> {
        let row = |row: &Vec<f64>| row.iter().map(|x| x.abs()).collect();
        product(&self.R.iter().map(row).collect::<Vec<_>>(), &self.N)
    }
}

/// What is known of A⁻¹ for every A with entries in the ranges: with
/// R ≈ A_c⁻¹, A_c the middle, and |A R − I| ≤ E of spectral radius below one,
/// |A⁻¹| ≤ |R| (I − E)⁻¹. The inverses are only guessed; that the spectral radius
/// is below one and that the bound is one are checked.
pub fn inverse_of_ranges(ranges: &[Vec<(f64, f64)>]) -> Option<Inverse> {
    let n = ranges.len();
    let matrix = |entry: &dyn Fn(usize, usize) -> f64| -> Vec<Vec<f64>> {
        let row = |i| (0..n).map(|j| entry(i, j)).collect();
        (0..n).map(row).collect()
    };
    let one = |i: usize, j: usize| f64::from(u8::from(i == j));
    let middle = matrix(&|i, j| ranges[i][j].0 / 2.0 + ranges[i][j].1 / 2.0);
    let radius = matrix(&|i, j| {
        let (low, high) = ranges[i][j];
        let about = Interval::point(middle[i][j]);
        let (above, below) = (Interval::point(high) - about, about - Interval::point(low));
        above.hi().max(below.hi())
    });
    let R = guessed_inverse(&middle)?;
    let spread = product(&radius, &matrix(&|i, j| R[i][j].abs()));
    let E = matrix(&|i, j| {
        let terms = (0..n).map(|k| Interval::point(middle[i][k]) * Interval::point(R[k][j]));
        let rest = terms.fold(Interval::point(-one(i, j)), |sum, x| sum + x);
        plus(rest.magnitude(), spread[i][j])
    });
    let N = guessed_inverse(&matrix(&|i, j| one(i, j) - E[i][j]))?;
    let v: Vec<f64> = N.iter().map(|row| row.iter().sum()).collect();
    let raised = matrix(&|i, j| N[i][j] + RESERVE * v[i]);
    let positive = v.iter().chain(raised.iter().flatten()).all(|x| *x >= 0.0);
    let covers = |i: usize, j: usize| {
        let mapped = total((0..n).map(|k| times(E[i][k], raised[k][j])));
        (Interval::point(raised[i][j]) - size(mapped)).lo() >= one(i, j)
    };
    let shrinks = |i: usize| v[i] > total((0..n).map(|k| times(E[i][k], v[k])));
    let sure = positive && (0..n).all(|i| shrinks(i) && (0..n).all(|j| covers(i, j)));
    sure.then_some(Inverse { R, N: raised })
}

/// Gauss and Jordan's inverse, without any guarantee.
fn guessed_inverse(A: &[Vec<f64>]) -> Option<Vec<Vec<f64>>> {
    let n = A.len();
    let mut rows: Vec<Vec<f64>> = A.to_vec();
    for (i, row) in rows.iter_mut().enumerate() {
        row.extend((0..n).map(|j| f64::from(u8::from(i == j))));
    }
    for k in 0..n {
        let size = |i: &usize| rows[*i][k].abs();
        let pivot = (k..n).max_by(|i, j| size(i).total_cmp(&size(j)))?;
        rows.swap(k, pivot);
        let lead = rows[k].clone();
        if !(lead[k] != 0.0 && lead[k].is_finite()) {
            return None;
        }
        for (i, row) in rows.iter_mut().enumerate() {
            let factor = row[k] / lead[k];
            for (x, l) in row.iter_mut().zip(&lead) {
                *x = if i == k {
                    *l / lead[k]
                } else {
                    *x - factor * l
                };
            }
        }
    }
    let inverse: Vec<Vec<f64>> = rows.into_iter().map(|row| row[n..].to_vec()).collect();
    let finite = inverse.iter().flatten().all(|x| x.is_finite());
    finite.then_some(inverse)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A wide entry beside the diagonal does no harm.
    #[test]
    fn inverses_of_triangular_ranges() {
        let ranges = [[(1.0, 1.0), (0.0, 0.0)], [(-4.5, 4.5), (-3.25, -1.0)]];
        let ranges = ranges.map(|row| row.to_vec());
        let found = inverse_of_ranges(&ranges).unwrap().bounds();
        assert!((found[0][0] - 1.0).abs() < 1e-6 && found[0][1] < 1e-6);
        assert!((found[1][0] - 4.5).abs() < 1e-6 && (found[1][1] - 1.0).abs() < 1e-6);
    }

    #[test]
    fn singular_ranges_have_no_bound() {
        let ranges = [vec![(1.0, 1.0), (0.9, 1.1)], vec![(1.0, 1.0), (1.0, 1.0)]];
        assert_eq!(inverse_of_ranges(&ranges), None);
        assert_eq!(inverse_of_ranges(&[vec![(-1.0, 1.0)]]), None);
    }

    /// Every matrix of the ranges, at their corners.
    #[test]
    fn inverses_lie_inside() {
        let ranges = [
            vec![(1.0, 1.5), (-0.3, 0.2)],
            vec![(0.1, 0.4), (-2.0, -1.0)],
        ];
        let found = inverse_of_ranges(&ranges).unwrap().bounds();
        for corner in 0..16 {
            let pick = |k: usize, (low, high): (f64, f64)| match corner >> k & 1 {
                0 => low,
                _ => high,
            };
            let a: Vec<f64> = ranges
                .concat()
                .iter()
                .enumerate()
                .map(|(k, &r)| pick(k, r))
                .collect();
            let det = a[0] * a[3] - a[1] * a[2];
            let inverse = [[a[3], -a[1]], [-a[2], a[0]]];
            for (i, row) in inverse.iter().enumerate() {
                for (j, x) in row.iter().enumerate() {
                    assert!((x / det).abs() <= found[i][j], "{corner} {i} {j}");
                }
            }
        }
    }
}
