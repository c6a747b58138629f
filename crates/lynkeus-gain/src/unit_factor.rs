//! S = UᵀDU with a unit upper triangular U and a positive diagonal D.

/// The factors of a symmetric positive definite matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitFactor {
    /// D, all positive
    pub diagonal: Vec<f64>,
    /// row i: U_{i,i+1}, …, U_{i,n−1}; the ones on the diagonal are left out
    pub upper: Vec<Vec<f64>>,
}

/// Why a matrix has no factors.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// rows of other lengths than there are rows
    #[error("{rows} rows, of which row {row} has {entries} entries")]
    NotSquare {
        /// number of rows
        rows: usize,
        /// the row in question, from 1
        row: usize,
        /// its length
        entries: usize,
    },
    /// S_ij ≠ S_ji
    #[error("entry ({0}, {1}) differs from entry ({1}, {0})")]
    NotSymmetric(usize, usize),
    /// a leading block is not positive definite
    #[error("not positive definite: the determinant of the leading {0}×{0} block is not positive")]
    NotPositiveDefinite(usize),
}

impl UnitFactor {
    /// Factors S, given row by row.
    ///
    /// # Errors
    /// A matrix that is not square, symmetric and positive definite.
    pub fn new(S: &[Vec<f64>]) -> Result<Self, FactorError> {
        let n = S.len();
        check_shape(S)?;
        let mut D = vec![0.0; n];
        let mut U = vec![vec![0.0; n]; n];
        for i in 0..n {
            let rest = |j: usize| S[i][j] - (0..i).map(|k| D[k] * U[k][i] * U[k][j]).sum::<f64>();
            let pivot = rest(i);
            let row: Vec<f64> = (i..n).map(|j| rest(j) / pivot).collect();
            // what cancellation leaves of a singular matrix is no pivot; NaN is none either
            let positive = pivot > n as f64 * f64::EPSILON * S[i][i].abs();
            if !positive || row.iter().any(|x| !x.is_finite()) {
                return Err(FactorError::NotPositiveDefinite(i + 1));
            }
            D[i] = pivot;
            U[i][i..].copy_from_slice(&row);
        }
        let strict = |(i, row): (usize, Vec<f64>)| row[i + 1..].to_vec();
        Ok(Self {
            diagonal: D,
            upper: U.into_iter().enumerate().map(strict).collect(),
        })
    }
}

fn check_shape(S: &[Vec<f64>]) -> Result<(), FactorError> {
    let rows = S.len();
    if let Some(i) = S.iter().position(|row| row.len() != rows) {
        return Err(FactorError::NotSquare {
            rows,
            row: i + 1,
            entries: S[i].len(),
        });
    }
    let size = S.iter().flatten().fold(0.0, |m: f64, x| m.max(x.abs()));
    for (i, row) in S.iter().enumerate() {
        if let Some(j) = (0..i).find(|&j| (row[j] - S[j][i]).abs() > 1e-12 * size) {
            return Err(FactorError::NotSymmetric(j + 1, i + 1));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_factors_multiply_to_the_matrix(a in prop::array::uniform9(-1.0..1.0f64)) {
            let S: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| {
                let product: f64 = (0..3).map(|k| a[3 * k + i] * a[3 * k + j]).sum();
                product + f64::from(u8::from(i == j)) * 0.1
            }).collect()).collect();
            let factor = UnitFactor::new(&S).unwrap();
            let U = |i: usize, j: usize| match i.cmp(&j) {
                std::cmp::Ordering::Less => factor.upper[i][j - i - 1],
                std::cmp::Ordering::Equal => 1.0,
                std::cmp::Ordering::Greater => 0.0,
            };
            for (i, row) in S.iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    let product: f64 = (0..3).map(|k| U(k, i) * factor.diagonal[k] * U(k, j)).sum();
                    prop_assert!((product - entry).abs() < 1e-13);
                }
            }
        }
    }

    #[test]
    fn what_cannot_be_factored_is_told() {
        let of = |rows: &[&[f64]]| {
            let S: Vec<Vec<f64>> = rows.iter().map(|row| row.to_vec()).collect();
            UnitFactor::new(&S).unwrap_err()
        };
        let (rows, row, entries) = (2, 2, 1);
        assert_eq!(
            of(&[&[1.0, 0.0], &[0.0]]),
            FactorError::NotSquare { rows, row, entries }
        );
        assert_eq!(
            of(&[&[1.0, 0.5], &[0.0, 1.0]]),
            FactorError::NotSymmetric(1, 2)
        );
        for block in [[1.0, 1.0, 1.0], [1.0, 2.0, 1.0], [1.0, 0.0, f64::NAN]] {
            let [a, b, c] = block;
            let error = of(&[&[a, b], &[b, c]]);
            assert_eq!(error, FactorError::NotPositiveDefinite(2));
        }
    }
}
