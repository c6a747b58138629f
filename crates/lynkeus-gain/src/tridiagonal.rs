//! The symmetric tridiagonal S of Hammouri, Targui and Armanet, eq. (7).

/// A symmetric tridiagonal matrix.
#[derive(Clone, Debug, PartialEq)]
pub struct Tridiagonal {
    diagonal: Vec<f64>,
    off_diagonal: Vec<f64>,
}

/// Numbers that do not make a symmetric positive definite tridiagonal matrix.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum TridiagonalError {
    /// wrong lengths
    #[error(
        "diag has {diagonal} entries and off has {off_diagonal}: off needs one entry fewer than diag"
    )]
    Lengths {
        /// entries of the diagonal
        diagonal: usize,
        /// entries beside it
        off_diagonal: usize,
    },
    /// not positive definite
    #[error("S is not positive definite: its leading {size}×{size} block has no positive pivot")]
    Indefinite {
        /// size of the first leading block that fails
        size: usize,
    },
}

impl Tridiagonal {
    /// From the diagonal (n entries) and the entries beside it (n−1).
    ///
    /// # Errors
    /// Wrong lengths, or a matrix that is not positive definite.
    pub fn new(diagonal: Vec<f64>, off_diagonal: Vec<f64>) -> Result<Self, TridiagonalError> {
        if diagonal.is_empty() || off_diagonal.len() + 1 != diagonal.len() {
            return Err(TridiagonalError::Lengths {
                diagonal: diagonal.len(),
                off_diagonal: off_diagonal.len(),
            });
        }
        let matrix = Self {
            diagonal,
            off_diagonal,
        };
        match matrix.pivots().iter().position(|&d| d.is_nan() || d <= 0.0) {
            Some(k) => Err(TridiagonalError::Indefinite { size: k + 1 }),
            None => Ok(matrix),
        }
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

    /// True if every pivot of S = L D Lᵀ is positive.
    pub fn is_positive_definite(&self) -> bool {
        self.pivots().iter().all(|&d| d > 0.0)
    }

    /// The pivots D of S = L D Lᵀ, from the first row down.
    fn pivots(&self) -> Vec<f64> {
        let mut pivots: Vec<f64> = Vec::with_capacity(self.size());
        for (k, &s) in self.diagonal.iter().enumerate() {
            let d = match k {
                0 => s,
                _ => s - self.off_diagonal[k - 1].powi(2) / pivots[k - 1],
            };
            pivots.push(d);
        }
        pivots
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
            TridiagonalError::Lengths {
                diagonal: 2,
                off_diagonal: 0
            }
        );
        let indefinite = Tridiagonal::new(vec![1.0, 1.0], vec![2.0]).unwrap_err();
        assert_eq!(indefinite, TridiagonalError::Indefinite { size: 2 });
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
}
