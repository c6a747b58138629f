//! Cholesky's factor of a covariance that rounding may have made singular.

use super::root::dot;

/// The lower triangular factor of a matrix that has no negative eigenvalue but by rounding: a
/// pivot that rounding cannot tell from zero has none. What is zero before the first entry of a
/// row stays so, and costs nothing.
pub(crate) fn factor(matrix: &[f64], n: usize) -> Vec<f64> {
    Factor::default().of(matrix, n).to_vec()
}

/// Room for the [factor] of a matrix.
#[derive(Clone, Debug, Default)]
pub(crate) struct Factor {
    lower: Vec<f64>,
    /// where the entries of each row that are not 0 begin
    firsts: Vec<usize>,
}

impl Factor {
    /// As [`factor`].
    pub fn of(&mut self, matrix: &[f64], n: usize) -> &[f64] {
        let Self { lower, firsts } = self;
        let first =
            |(i, row): (usize, &[f64])| row[..i].iter().position(|e| *e != 0.0).unwrap_or(i);
        firsts.clear();
        firsts.extend(matrix.chunks_exact(n.max(1)).enumerate().map(first));
        lower.clear();
        lower.resize(n * n, 0.0);
        for j in 0..n {
            let own = &lower[j * n + firsts[j]..j * n + j];
            let pivot = matrix[j * n + j] - dot(own, own);
            let noise = n as f64 * f64::EPSILON * matrix[j * n + j].abs();
            if pivot.is_nan() || pivot <= noise {
                continue;
            }
            let root = pivot.sqrt();
            lower[j * n + j] = root;
            for i in j + 1..n {
                let begin = firsts[i].max(firsts[j]);
                if firsts[i] > j {
                    continue;
                }
                let known = dot(
                    &lower[i * n + begin..i * n + j],
                    &lower[j * n + begin..j * n + j],
                );
                lower[i * n + j] = (matrix[i * n + j] - known) / root;
            }
        }
        lower
    }
}

/// x with L Lᵀ x = b, in the place of b; components that L does not reach are 0.
pub(crate) fn substitute(lower: &[f64], m: usize, b: &mut [f64]) {
    for i in 0..m {
        let known = dot(&lower[i * m..i * m + i], &b[..i]);
        let pivot = lower[i * m + i];
        b[i] = if pivot > 0.0 {
            (b[i] - known) / pivot
        } else {
            0.0
        };
    }
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m).map(|j| lower[j * m + i] * b[j]).sum();
        let pivot = lower[i * m + i];
        b[i] = if pivot > 0.0 {
            (b[i] - known) / pivot
        } else {
            0.0
        };
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_semidefinite_matrix_has_a_factor() {
        let v = [3.0, 0.0, -2.0];
        let matrix: Vec<f64> = (0..9).map(|k| v[k / 3] * v[k % 3]).collect();
        let lower = factor(&matrix, 3);
        for (k, entry) in matrix.iter().enumerate() {
            let (i, j) = (k / 3, k % 3);
            let found = dot(&lower[3 * i..3 * i + 3], &lower[3 * j..3 * j + 3]);
            assert!((found - entry).abs() <= 1e-14, "{found} against {entry}");
        }
    }
}
