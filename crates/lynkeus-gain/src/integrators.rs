//! The gain of a chain of integrators: S + AᵀS + SA − CᵀC = 0.

use nalgebra::{DMatrix, SymmetricEigen};

/// The solution S of S + AᵀS + SA − CᵀC = 0 for x₁' = x₂, …, xₙ' = 0, y = x₁, and what
/// proofs need of it. A − S⁻¹CᵀC has all its eigenvalues at −1.
///
/// ```
/// let chain = lynkeus_gain::integrators::Chain::new(3);
/// assert_eq!(chain.gain, [3.0, 3.0, 1.0]);
/// assert!(chain.smallest > 0.0);
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Chain {
    /// S⁻¹Cᵀ: the binomial coefficients C¹ₙ, …, Cⁿₙ
    pub gain: Vec<f64>,
    /// smallest eigenvalue of S
    pub smallest: f64,
    /// largest eigenvalue of S
    pub largest: f64,
    /// diagonal of S: the binomial coefficients C^{i−1}_{2i−2}
    pub diagonal: Vec<f64>,
    /// diagonal of S⁻¹: xᵢ² ≤ (S⁻¹)ᵢᵢ xᵀSx
    pub inverse_diagonal: Vec<f64>,
}

impl Chain {
    /// The chain of `n` integrators.
    pub fn new(n: usize) -> Self {
        let S = matrix(n);
        let values = SymmetricEigen::new(S.clone()).eigenvalues;
        let inverse = S.clone().cholesky().map(|c| c.inverse());
        let inverse_diagonal = inverse.map_or(vec![f64::INFINITY; n], |inverse| {
            inverse.diagonal().iter().copied().collect()
        });
        Self {
            diagonal: S.diagonal().iter().copied().collect(),
            gain: (1..=n).map(|i| binomial(n, i)).collect(),
            smallest: values.iter().copied().fold(f64::INFINITY, f64::min),
            largest: values.iter().copied().fold(0.0, f64::max),
            inverse_diagonal,
        }
    }
}

/// S_ij = (−1)^{i+j} C^{j−1}_{i+j−2}
fn matrix(n: usize) -> DMatrix<f64> {
    DMatrix::from_fn(n, n, |i, j| {
        let sign = if (i + j) % 2 == 0 { 1.0 } else { -1.0 };
        sign * binomial(i + j, j)
    })
}

fn binomial(n: usize, k: usize) -> f64 {
    (0..k).fold(1.0, |product, i| product * (n - i) as f64 / (i + 1) as f64)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Equations (5) and (8) of Farza, M'Saad, Liu and Targui.
    #[test]
    fn the_lyapunov_equation_and_its_gain() {
        for n in 1..=6 {
            let S = matrix(n);
            let A = DMatrix::from_fn(n, n, |i, j| f64::from(u8::from(j == i + 1)));
            let mut C = DMatrix::zeros(1, n);
            C[(0, 0)] = 1.0;
            let residual = &S + A.transpose() * &S + &S * &A - C.transpose() * &C;
            assert!(residual.amax() < 1e-9, "{residual}");
            let chain = Chain::new(n);
            let back = &S * DMatrix::from_column_slice(n, 1, &chain.gain) - C.transpose();
            assert!(back.amax() < 1e-9, "{back}");
            assert!((chain.inverse_diagonal[0] - n as f64).abs() < 1e-6);
        }
    }
}
