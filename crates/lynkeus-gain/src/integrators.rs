//! The gain of a chain of integrators: S + AᵀS + SA − CᵀC = 0.

use lynkeus_expr::Interval;
use lynkeus_proof::hurwitz::first_column;
use lynkeus_proof::matrix::square;
use lynkeus_proof::metzler::spectral_radius;
use nalgebra::DMatrix;

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
    /// a lower bound of the smallest eigenvalue of S
    pub smallest: f64,
    /// an upper bound of the largest eigenvalue of S
    pub largest: f64,
    /// diagonal of S: the binomial coefficients C^{i−1}_{2i−2}
    pub diagonal: Vec<f64>,
    /// diagonal of S⁻¹: xᵢ² ≤ (S⁻¹)ᵢᵢ xᵀSx
    pub inverse_diagonal: Vec<f64>,
}

impl Chain {
    /// The chain of `n` integrators.
    ///
    /// S is Pascal's symmetric matrix but for signs, S = LLᵀ with L_ij = ±C^j_i and
    /// (L⁻¹)_ij = C^j_i (counted from 0). So (S⁻¹)_ii = Σ_k (C^i_k)² is a whole number, and
    /// S⁻¹ is similar to S: the smallest eigenvalue is one over the largest.
    pub fn new(n: usize) -> Self {
        let S = matrix(n);
        // the signs are those of a change of coordinates
        let largest = spectral_radius(&square(n, |i, j| S[(i, j)].abs()));
        let squares = |i: usize| (i..n).map(move |k| binomial(k, i).powi(2));
        Self {
            diagonal: S.diagonal().iter().copied().collect(),
            gain: (1..=n).map(|i| binomial(n, i)).collect(),
            smallest: (Interval::ONE / Interval::point(largest)).lo(),
            largest,
            inverse_diagonal: (0..n).map(|i| squares(i).sum()).collect(),
        }
    }
}

/// Whether a chain of `k` integrators is stable with the first `k` of the gains of a chain
/// of `n`: an enclosure of the smallest of Routh's numbers of
/// s^k + C¹ₙ s^{k−1} + … + C^kₙ, or of the first that is not positive. Positive: all zeros
/// lie to the left of the imaginary axis; negative: some lie to the right.
///
/// Not every shorter chain is stable: the fifth partial sum of the exponential series, which
/// this is for large n, has zeros to the right.
///
/// ```
/// use lynkeus_gain::integrators::shortened_stability;
/// assert!(shortened_stability(12, 6).is_positive());
/// assert!(shortened_stability(13, 6).is_negative());
/// ```
pub fn shortened_stability(n: usize, k: usize) -> Interval {
    let coefficients = (1..=k).map(|i| Interval::point(binomial(n, i)));
    let column = first_column(&coefficients.collect::<Vec<_>>());
    match column.last() {
        Some(last) if !last.is_positive() => *last,
        _ => column.into_iter().fold(Interval::ONE, Interval::min),
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
            let inverse = S.try_inverse().unwrap();
            for i in 0..n {
                let found = chain.inverse_diagonal[i];
                assert!(
                    (found - inverse[(i, i)]).abs() < 1e-9 * found,
                    "{i}: {found}"
                );
            }
        }
    }

    /// Eigenvalues of Pascal's matrix of ten rows (mpmath, 40 digits):
    /// a solver in double precision has half of the digits of the smallest one.
    #[test]
    fn the_eigenvalues_are_bounds() {
        let chain = Chain::new(10);
        let (largest, smallest) = (64460.88501701745, 1.551_328_374_930_011_5e-5);
        assert!(chain.largest >= largest && chain.largest < largest * (1.0 + 1e-11));
        assert!(chain.smallest <= smallest && chain.smallest > smallest * (1.0 - 1e-11));
    }

    /// The first unstable shortened chain of each length, by NumPy's roots of the
    /// polynomials: the largest real part changes from below −0.01 to above 0.01.
    #[test]
    fn shortened_chains() {
        for (k, first) in [(5, 24), (6, 13), (7, 12), (8, 12), (9, 12), (10, 13)] {
            for n in k..first {
                assert!(shortened_stability(n, k).is_positive(), "{k} of {n}");
            }
            assert!(
                shortened_stability(first, k).is_negative(),
                "{k} of {first}"
            );
        }
        for k in 1..=4 {
            assert!((k..60).all(|n| shortened_stability(n, k).is_positive()));
        }
    }
}
