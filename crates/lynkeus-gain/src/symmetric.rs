//! Symmetric positive definite matrices with their factors: the tridiagonal S of Hammouri, Targui
//! and Armanet, eq. (7), and S = UᵀDU with a unit upper triangular U and a positive diagonal D.

/// A symmetric tridiagonal matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Tridiagonal {
    diagonal: Vec<f64>,
    off_diagonal: Vec<f64>,
}

impl Tridiagonal {
    /// From the diagonal (n entries) and the entries beside it (n−1).
    ///
    /// # Errors
    /// Wrong lengths, or a matrix that is not positive definite.
    pub fn new(diagonal: Vec<f64>, off_diagonal: Vec<f64>) -> Result<Self, FactorError> {
        if diagonal.is_empty() || off_diagonal.len() + 1 != diagonal.len() {
            return Err(FactorError::Lengths {
                diagonal: diagonal.len(),
                off_diagonal: off_diagonal.len(),
            });
        }
        // the pivots D of S = L D Lᵀ, from the first row down
        let mut left = 0.0;
        for (i, &entry) in diagonal.iter().enumerate() {
            let pivot = entry - left;
            if pivot.is_nan() || pivot <= 0.0 {
                return Err(FactorError::Indefinite { size: i + 1 });
            }
            left = off_diagonal.get(i).map_or(0.0, |off| off.powi(2) / pivot);
        }
        Ok(Self {
            diagonal,
            off_diagonal,
        })
    }

    /// Number of rows.
    pub fn size(&self) -> usize {
        self.diagonal.len()
    }

    /// The diagonal.
    pub fn diagonal(&self) -> &[f64] {
        &self.diagonal
    }

    /// The entries beside the diagonal.
    pub fn off_diagonal(&self) -> &[f64] {
        &self.off_diagonal
    }

    /// Entry (i, j).
    pub fn get(&self, i: usize, j: usize) -> f64 {
        match i.abs_diff(j) {
            0 => self.diagonal[i],
            1 => self.off_diagonal[i.min(j)],
            _ => 0.0,
        }
    }

    /// S⁻¹Cᵀ with C = (1, 0, …, 0): the first column of the inverse. With
    /// S = U D Uᵀ eliminated from the last row up, Uᵀx = D⁻¹U⁻¹e₁ = e₁/d₁.
    pub fn gain(&self) -> Vec<f64> {
        let n = self.size();
        let mut pivots = self.diagonal.clone();
        for k in (0..n - 1).rev() {
            pivots[k] -= self.off_diagonal[k].powi(2) / pivots[k + 1];
        }
        let mut gain = vec![1.0 / pivots[0]];
        for k in 1..n {
            gain.push(-self.off_diagonal[k - 1] / pivots[k] * gain[k - 1]);
        }
        gain
    }
}

/// The factors of a symmetric positive definite matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct UnitFactor {
    /// D, all positive
    pub diagonal: Vec<f64>,
    /// row i: U_{i,i+1}, …, U_{i,n−1}; the ones on the diagonal are left out
    pub upper: Vec<Vec<f64>>,
}

/// Why a matrix has no factors: numbers that do not make a symmetric positive definite one.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum FactorError {
    /// a diagonal and entries beside it of lengths that do not fit
    #[error(
        "diag has {diagonal} entries and off has {off_diagonal}: off needs one entry fewer than diag"
    )]
    Lengths {
        /// entries of the diagonal
        diagonal: usize,
        /// entries beside it
        off_diagonal: usize,
    },
    /// a tridiagonal matrix that is not positive definite
    #[error("S is not positive definite: its leading {size}×{size} block has no positive pivot")]
    Indefinite {
        /// size of the first leading block that fails
        size: usize,
    },
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

    /// An entry of U.
    pub fn U(&self, i: usize, j: usize) -> f64 {
        match i.cmp(&j) {
            std::cmp::Ordering::Less => self.upper[i][j - i - 1],
            std::cmp::Ordering::Equal => 1.0,
            std::cmp::Ordering::Greater => 0.0,
        }
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

    /// The two matrices printed in the paper, and the gains that belong to them
    /// (the second printed gain repeats the first six of the first).
    #[test]
    fn gains_of_the_column() {
        let diagonal = [1.5, 2.0, 4.0, 8.0, 10.5, 15.5, 17.5];
        let off = [-0.5, -1.5, -2.0, -3.0, -4.0, -5.0];
        let s1 = Tridiagonal::new(diagonal.to_vec(), off.to_vec()).unwrap();
        let s2 = Tridiagonal::new(diagonal[..6].to_vec(), off[..5].to_vec()).unwrap();
        let expected1 = [0.7610, 0.2830, 0.1237, 0.0352, 0.0113, 0.0032, 0.0009];
        let expected2 = [0.7610, 0.2830, 0.1237, 0.0351, 0.0111, 0.0029];
        for (s, expected) in [(s1, &expected1[..]), (s2, &expected2[..])] {
            for (found, expected) in s.gain().iter().zip(expected) {
                assert!(
                    (found - expected).abs() < 5.1e-5,
                    "{found} against {expected}"
                );
            }
        }
    }

    #[test]
    fn wrong_numbers_are_refused() {
        let lengths = Tridiagonal::new(vec![1.0, 1.0], vec![]).unwrap_err();
        assert_eq!(
            lengths,
            FactorError::Lengths {
                diagonal: 2,
                off_diagonal: 0
            }
        );
        let indefinite = Tridiagonal::new(vec![1.0, 1.0], vec![2.0]).unwrap_err();
        assert_eq!(indefinite, FactorError::Indefinite { size: 2 });
    }

    proptest! {
        #[test]
        fn the_gain_solves_its_equation(
            diagonal in prop::collection::vec(2.0..4.0, 5),
            off in prop::collection::vec(-1.0..1.0, 4),
        ) {
            let s = Tridiagonal::new(diagonal, off).unwrap();
            let x = s.gain();
            for i in 0..5 {
                let row: f64 = (0..5).map(|j| s.get(i, j) * x[j]).sum();
                prop_assert!((row - f64::from(u8::from(i == 0))).abs() < 1e-14);
            }
        }
    }

    proptest! {
        #[test]
        fn the_factors_multiply_to_the_matrix(a in prop::array::uniform9(-1.0..1.0f64)) {
            let S: Vec<Vec<f64>> = (0..3).map(|i| (0..3).map(|j| {
                let product: f64 = (0..3).map(|k| a[3 * k + i] * a[3 * k + j]).sum();
                product + f64::from(u8::from(i == j)) * 0.1
            }).collect()).collect();
            let factor = UnitFactor::new(&S).unwrap();
            for (i, row) in S.iter().enumerate() {
                for (j, entry) in row.iter().enumerate() {
                    let product: f64 = (0..3).map(|k| factor.U(k, i) * factor.diagonal[k] * factor.U(k, j)).sum();
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
