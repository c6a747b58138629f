//! Square roots of covariances: P = S Sᵀ, matrices row by row.

use crate::snapshot::{Damaged, Persist, Walk};

/// A root S of P, n × n. Whatever is done to S, S Sᵀ has no negative eigenvalue.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Root {
    pub n: usize,
    pub entries: Vec<f64>,
}

impl Root {
    /// Of a diagonal covariance.
    pub fn diagonal(variances: &[f64]) -> Self {
        let n = variances.len();
        let mut entries = vec![0.0; n * n];
        for (i, variance) in variances.iter().enumerate() {
            entries[i * n + i] = variance.sqrt();
        }
        Self { n, entries }
    }

    /// Row i of S.
    pub fn row(&self, i: usize) -> &[f64] {
        &self.entries[i * self.n..(i + 1) * self.n]
    }

    /// √P_ii.
    pub fn deviation(&self, i: usize) -> f64 {
        self.row(i).iter().map(|s| s * s).sum::<f64>().sqrt()
    }

    /// Sᵀc.
    pub fn transposed_times(&self, c: &[f64], out: &mut [f64]) {
        out.fill(0.0);
        for (i, c) in c.iter().enumerate().filter(|(_, c)| **c != 0.0) {
            for (out, s) in out.iter_mut().zip(self.row(i)) {
                *out += c * s;
            }
        }
    }

    /// P v = S (Sᵀ v).
    pub fn covariance_times(&self, v: &[f64]) -> Vec<f64> {
        let mut half = vec![0.0; self.n];
        self.transposed_times(v, &mut half);
        (0..self.n).map(|i| dot(self.row(i), &half)).collect()
    }

    /// Potter's update by one reading y = cᵀx + noise of variance `r`: S becomes a root of
    /// (I − k cᵀ) P (I − k cᵀ)ᵀ + r k kᵀ, and the gain k is returned. `projected` is Sᵀc. No
    /// gain where neither the reading nor the estimate has any variance.
    pub fn update(&mut self, projected: &[f64], r: f64) -> Option<Vec<f64>> {
        let mut gain = vec![0.0; self.n];
        self.update_into(projected, r, &mut gain).then_some(gain)
    }

    /// The same with room for the gain; false where there is none.
    pub fn update_into(&mut self, projected: &[f64], r: f64, gain: &mut [f64]) -> bool {
        let variance = dot(projected, projected) + r;
        if variance.is_nan() || variance <= 0.0 {
            return false;
        }
        let shrink = 1.0 / (1.0 + (r / variance).sqrt());
        for (i, k) in gain.iter_mut().enumerate() {
            let row = &mut self.entries[i * self.n..(i + 1) * self.n];
            *k = dot(row, projected) / variance;
            for (s, p) in row.iter_mut().zip(projected) {
                *s -= shrink * *k * p;
            }
        }
        true
    }

    /// The lower triangular root of AᵀA, for the rows A (each of n entries): what is left of A
    /// after Householder's reflections. The diagonal is not negative.
    pub fn of_rows(&mut self, rows: &mut [f64]) {
        self.of_rows_with(rows, &mut vec![0.0; self.n]);
    }

    /// The same with room for n numbers.
    pub fn of_rows_with(&mut self, rows: &mut [f64], room: &mut [f64]) {
        let n = self.n;
        triangularise(rows, n, room);
        self.entries.fill(0.0);
        for i in 0..n.min(rows.len() / n.max(1)) {
            let sign = if rows[i * n + i] < 0.0 { -1.0 } else { 1.0 };
            for j in i..n {
                self.entries[j * n + i] = sign * rows[i * n + j];
            }
        }
    }
}

impl Persist for Root {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(&mut self.entries)
    }
}

pub(crate) fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

/// Reflections that make the first n rows of A upper triangular; row by row, so that
/// memory is read in order.
fn triangularise(rows: &mut [f64], n: usize, sums: &mut [f64]) {
    let count = rows.len() / n.max(1);
    for k in 0..n.min(count) {
        let norm = (k..count)
            .map(|i| rows[i * n + k].powi(2))
            .sum::<f64>()
            .sqrt();
        if norm == 0.0 {
            continue;
        }
        let pivot = rows[k * n + k];
        let head = if pivot > 0.0 { -norm } else { norm };
        // the reflector v = (pivot − head, the rest), H = I − v vᵀ/β
        let v0 = pivot - head;
        let beta = -head * v0;
        rows[k * n + k] = v0;
        sums[k + 1..].fill(0.0);
        for row in rows.chunks_exact(n).skip(k).filter(|row| row[k] != 0.0) {
            for (sum, a) in sums[k + 1..].iter_mut().zip(&row[k + 1..]) {
                *sum += row[k] * a;
            }
        }
        for row in rows.chunks_exact_mut(n).skip(k) {
            let factor = std::mem::take(&mut row[k]) / beta;
            if factor == 0.0 {
                continue;
            }
            for (a, sum) in row[k + 1..].iter_mut().zip(&sums[k + 1..]) {
                *a -= factor * sum;
            }
        }
        rows[k * n + k] = head;
    }
}

/// The lower triangular factor of a matrix that has no negative eigenvalue but by rounding: a
/// pivot that rounding cannot tell from zero has none.
pub(crate) fn factor(matrix: &[f64], n: usize) -> Vec<f64> {
    let mut lower = vec![];
    factor_into(matrix, n, &mut lower);
    lower
}

/// The same with room for it.
pub(crate) fn factor_into(matrix: &[f64], n: usize, lower: &mut Vec<f64>) {
    lower.clear();
    lower.resize(n * n, 0.0);
    for j in 0..n {
        let own = &lower[j * n..j * n + j];
        let pivot = matrix[j * n + j] - dot(own, own);
        let noise = n as f64 * f64::EPSILON * matrix[j * n + j].abs();
        if pivot.is_nan() || pivot <= noise {
            continue;
        }
        let root = pivot.sqrt();
        lower[j * n + j] = root;
        for i in j + 1..n {
            let rest = matrix[i * n + j] - dot(&lower[i * n..i * n + j], &lower[j * n..j * n + j]);
            lower[i * n + j] = rest / root;
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn covariance(root: &Root) -> Vec<f64> {
        let n = root.n;
        (0..n * n)
            .map(|k| dot(root.row(k / n), root.row(k % n)))
            .collect()
    }

    fn close(a: &[f64], b: &[f64], tolerance: f64) {
        assert_eq!(a.len(), b.len());
        for (a, b) in a.iter().zip(b) {
            assert!((a - b).abs() <= tolerance, "{a} against {b}");
        }
    }

    #[test]
    fn rows_become_the_lower_root_of_their_sum_of_squares() {
        let rows = [1.0, 2.0, 0.5, -3.0, 0.0, 1.0, 2.0, 2.0, -1.0, 0.0, 0.0, 4.0];
        let expected: Vec<f64> = (0..9)
            .map(|k| {
                (0..4)
                    .map(|r| rows[r * 3 + k / 3] * rows[r * 3 + k % 3])
                    .sum()
            })
            .collect();
        let mut root = Root::diagonal(&[0.0; 3]);
        root.of_rows(&mut rows.clone());
        close(&covariance(&root), &expected, 1e-13);
        assert!(
            (0..3).all(|i| root.row(i)[i] >= 0.0 && root.row(i)[i + 1..].iter().all(|s| *s == 0.0))
        );
        // fewer rows than columns: rank one
        let mut flat = Root::diagonal(&[0.0; 3]);
        flat.of_rows(&mut [1.0, 2.0, 3.0]);
        close(
            &covariance(&flat),
            &[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 3.0, 6.0, 9.0],
            1e-14,
        );
    }

    /// Against P − P c cᵀ P/(cᵀPc + r), by hand for P = [[2, 1], [1, 3]], c = (1, 0), r = 2.
    #[test]
    fn a_reading_takes_what_the_formula_says() {
        let mut root = Root::diagonal(&[0.0; 2]);
        root.entries = factor(&[2.0, 1.0, 1.0, 3.0], 2);
        let mut projected = [0.0; 2];
        root.transposed_times(&[1.0, 0.0], &mut projected);
        let gain = root.update(&projected, 2.0).unwrap();
        close(&gain, &[0.5, 0.25], 1e-15);
        close(&covariance(&root), &[1.0, 0.5, 0.5, 2.75], 1e-15);
        // a perfect reading leaves no variance, and a second one has nothing to say
        root.transposed_times(&[1.0, 0.0], &mut projected);
        root.update(&projected, 0.0).unwrap();
        assert!(root.deviation(0) < 1e-15);
    }

    #[test]
    fn what_has_no_variance_gives_no_gain() {
        let mut root = Root::diagonal(&[0.0, 1.0]);
        assert_eq!(root.update(&[0.0, 0.0], 0.0), None);
        assert_eq!(root.deviation(1), 1.0);
    }

    #[test]
    fn a_semidefinite_matrix_has_a_factor() {
        let v = [3.0, 0.0, -2.0];
        let matrix: Vec<f64> = (0..9).map(|k| v[k / 3] * v[k % 3]).collect();
        let lower = factor(&matrix, 3);
        let root = Root {
            n: 3,
            entries: lower,
        };
        close(&covariance(&root), &matrix, 1e-14);
    }
}
