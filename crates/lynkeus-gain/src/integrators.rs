//! Gains of a chain of integrators: by its poles, by S + AᵀS + SA − CᵀC = 0, and by Lemma 3.2 of
//! Germani and Manes (1999).
//!
//! A_n has ones above its diagonal and zeros else, B_n = (0, …, 0, 1)ᵀ and
//! C_n = (1, 0, …, 0). A_n − K(λ)C_n has the eigenvalues λ and is diagonalised by
//! the Vandermonde matrix V_n(λ) of (2.25), whose row i is (λ_i^{n−1}, …, λ_i, 1).
//!
//! The lemma: for all α, β, γ > 0 there are K and P = (VᵀV)⁻¹ > 0 with
//!
//! (A − KC)P + P(A − KC)ᵀ + β²BBᵀ + 2αP + γ²P² ≤ 0,  (3.16)
//!
//! namely λ = (−σ, −σ², …, −σⁿ) for every σ > 1 with
//!
//! σ ≥ α + nβ²/2 + γ²‖V⁻¹(λ(σ))‖²/2.  (3.20)
//!
//! The print has ‖V⁻¹‖ in (3.20); (3.18), from which it follows, has the square.

use lynkeus_expr::Interval;
use lynkeus_proof::hurwitz::first_column;
use lynkeus_proof::matrix::square;
use lynkeus_proof::metzler::spectral_radius;
use lynkeus_proof::spectrum;
use nalgebra::DMatrix;

/// [`place_all`] for real poles.
pub(crate) fn place(poles: &[f64]) -> Vec<f64> {
    let poles: Vec<Pole> = poles.iter().map(|&λ| Pole::Real(λ)).collect();
    place_all(&poles)
}

/// Eigenvalues of a real matrix: a real one, or two conjugate ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Pole {
    /// λ
    Real(f64),
    /// re ± i im
    Pair {
        /// real part of both
        re: f64,
        /// imaginary part of one of them
        im: f64,
    },
}

impl Pole {
    /// How many eigenvalues it is.
    pub fn count(self) -> usize {
        match self {
            Pole::Real(_) => 1,
            Pole::Pair { .. } => 2,
        }
    }

    /// The real part.
    pub fn re(self) -> f64 {
        match self {
            Pole::Real(re) | Pole::Pair { re, .. } => re,
        }
    }

    /// Multiplied by a number.
    #[must_use]
    pub fn scaled(self, by: f64) -> Self {
        match self {
            Pole::Real(λ) => Pole::Real(by * λ),
            Pole::Pair { re, im } => Pole::Pair {
                re: by * re,
                im: by * im,
            },
        }
    }
}

impl std::fmt::Display for Pole {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Pole::Real(λ) => write!(f, "{λ}"),
            Pole::Pair { re, im } => write!(f, "{re} ± {}i", im.abs()),
        }
    }
}

/// K(λ) with the eigenvalues of A_n − K C_n at `poles`, n of them in all: the coefficients of
/// ∏(s − λ_i) after the leading one.
///
/// ```
/// use lynkeus_gain::integrators::{Pole, place_all};
///
/// // (s + 3)((s + 2)² + 1) = s³ + 7s² + 17s + 15
/// let poles = [Pole::Real(-3.0), Pole::Pair { re: -2.0, im: 1.0 }];
/// assert_eq!(place_all(&poles), [7.0, 17.0, 15.0]);
/// ```
pub fn place_all(poles: &[Pole]) -> Vec<f64> {
    let mut polynomial = vec![1.0];
    for pole in poles {
        // s − λ, or s² + p s + q
        let (p, q) = match *pole {
            Pole::Real(λ) => (-λ, None),
            Pole::Pair { re, im } => (-2.0 * re, Some(re * re + im * im)),
        };
        polynomial.resize(polynomial.len() + pole.count(), 0.0);
        for k in (1..polynomial.len()).rev() {
            let second = q.filter(|_| k > 1).map_or(0.0, |q| q * polynomial[k - 2]);
            polynomial[k] += p * polynomial[k - 1] + second;
        }
    }
    polynomial.split_off(1)
}

/// V_n⁻¹(λ). Its column j holds the coefficients of the Lagrange polynomial
/// ∏_{i≠j} (s − λ_i)/(λ_j − λ_i), so that nothing is inverted; entries are not
/// finite where two poles coincide.
fn inverse(poles: &[f64]) -> DMatrix<f64> {
    let n = poles.len();
    let columns: Vec<Vec<f64>> = (0..n)
        .map(|j| {
            let others: Vec<f64> = (0..n).filter(|&i| i != j).map(|i| poles[i]).collect();
            let scale: f64 = others.iter().map(|λ| poles[j] - λ).product();
            let mut column = vec![1.0];
            column.extend(place(&others));
            column.iter().map(|c| c / scale).collect()
        })
        .collect();
    DMatrix::from_fn(n, n, |i, j| columns[j][i])
}

/// What Lemma 3.2 gives.
#[derive(Clone, Debug, PartialEq)]
pub struct Lemma32 {
    /// σ
    pub σ: f64,
    /// λ = (−σ, −σ², …, −σⁿ)
    pub poles: Vec<f64>,
    /// K(λ)
    pub K: Vec<f64>,
    /// √cn(P) = cn(V): the factor by which the error may peak, in the
    /// coordinates of the output's derivatives; infinite where V leaves the range of numbers
    pub peaking: f64,
}

/// Why there is no gain.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum Error {
    /// a number that the lemma does not allow
    #[error("Lemma 3.2 needs positive finite alpha, beta and gamma, found {0}")]
    NotPositive(f64),
    /// σⁿ is out of range
    #[error(
        "Lemma 3.2 needs poles down to −σ^{size} that leave the range of numbers: lower alpha, beta or gamma, or give the poles"
    )]
    TooLarge {
        /// n
        size: usize,
    },
}

/// The smallest σ that satisfies (3.20), with its gain.
///
/// # Errors
/// Numbers that are not positive and finite; a chain so long that σⁿ overflows.
pub fn lemma_3_2(n: usize, α: f64, β: f64, γ: f64) -> Result<Lemma32, Error> {
    if let Some(&x) = [α, β, γ].iter().find(|x| !(**x > 0.0 && x.is_finite())) {
        return Err(Error::NotPositive(x));
    }
    let large = || Error::TooLarge { size: n };
    // ‖V⁻¹‖ falls towards 1 as σ grows, so the excess has one zero
    let floor = α + n as f64 * β * β / 2.0;
    let excess = |σ: f64| {
        let norm = inverse_norm(σ, n)?;
        let excess = σ - floor - γ * γ * norm * norm / 2.0;
        (!excess.is_nan()).then_some(excess)
    };
    let mut low = if n > 1 { floor.max(1.0) } else { floor };
    let mut high = 2.0 * low;
    while excess(high).ok_or_else(large)? < 0.0 {
        (low, high) = (high, 2.0 * high);
    }
    // poles so close that V⁻¹ is out of range: σ is too small
    let [_, high] = bisected([low, high], |σ| excess(σ).is_some_and(|x| x >= 0.0));
    let poles = powers(high, n);
    let inverse_norm = inverse_norm(high, n).ok_or_else(large)?;
    let peaking = norm(vandermonde(&poles)).map_or(f64::INFINITY, |norm| norm * inverse_norm);
    Ok(Lemma32 {
        σ: high,
        K: place(&poles),
        poles,
        peaking,
    })
}

/// Two neighbouring numbers between which a test begins to be passed, by halving.
pub(crate) fn bisected([mut low, mut high]: [f64; 2], passes: impl Fn(f64) -> bool) -> [f64; 2] {
    loop {
        match low + (high - low) / 2.0 {
            middle if middle <= low || middle >= high => return [low, high],
            middle if passes(middle) => high = middle,
            middle => low = middle,
        }
    }
}

fn powers(σ: f64, n: usize) -> Vec<f64> {
    (1..=n).map(|k| -σ.powi(k as i32)).collect()
}

/// ‖V⁻¹(λ(σ))‖, where it is a number.
fn inverse_norm(σ: f64, n: usize) -> Option<f64> {
    norm(inverse(&powers(σ, n)))
}

/// The spectral norm, where it is a number.
fn norm(matrix: DMatrix<f64>) -> Option<f64> {
    let decomposed = spectrum::singular(matrix, false, false)?;
    Some(decomposed.singular_values.max())
}

/// V_n(λ) of (2.25).
fn vandermonde(poles: &[f64]) -> DMatrix<f64> {
    let n = poles.len();
    DMatrix::from_fn(n, n, |i, j| poles[i].powi((n - 1 - j) as i32))
}

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
    use nalgebra::SymmetricEigen;
    use proptest::prelude::*;

    /// A − KC of (2.24)
    fn companion(K: &[f64]) -> DMatrix<f64> {
        let n = K.len();
        DMatrix::from_fn(n, n, |i, j| {
            f64::from(u8::from(j == i + 1)) - if j == 0 { K[i] } else { 0.0 }
        })
    }

    /// One state by hand: V = 1, so σ = α + β²/2 + γ²/2.
    #[test]
    fn one_state_by_hand() {
        let found = lemma_3_2(1, 0.3, 0.2, 0.4).unwrap();
        assert!((found.σ - (0.3 + 0.02 + 0.08)).abs() < 1e-15);
        assert_eq!(found.K, [found.σ]);
    }

    /// V holds σ^{n(n−1)}, here beyond 1e312, while σⁿ and V⁻¹ stay in range.
    #[test]
    fn a_matrix_out_of_range_ends() {
        let found = lemma_3_2(10, 3e3, 1.0, 1.0).unwrap();
        // ‖V⁻¹‖ is one there, as near as σ is to its limit
        assert!((found.σ - (3e3 + 5.0 + 0.5)).abs() < 1e-2, "{}", found.σ);
        assert!(found.K.iter().all(|k| k.is_finite()));
        assert_eq!(found.peaking, f64::INFINITY);
        let long = lemma_3_2(20, 10.0, 0.1, 0.1).unwrap();
        assert!(long.σ > 10.1 && long.σ < 10.2, "{}", long.σ);
        assert_eq!(long.peaking, f64::INFINITY);
    }

    #[test]
    fn numbers_the_lemma_does_not_allow() {
        assert_eq!(lemma_3_2(2, 1.0, 0.0, 1.0), Err(Error::NotPositive(0.0)));
        assert!(matches!(
            lemma_3_2(3, 1e300, 1.0, 1.0),
            Err(Error::TooLarge { size: 3 })
        ));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(60))]
        /// The characteristic polynomial of A − KC has every pole, complex ones too, as a root.
        #[test]
        fn complex_poles_are_eigenvalues(
            real in prop::collection::vec(-5.0..-0.1f64, 0..4),
            pairs in prop::collection::vec((-3.0..-0.1f64, 0.1..4.0f64), 0..3)
        ) {
            let mut poles: Vec<Pole> = real.iter().map(|&λ| Pole::Real(λ)).collect();
            poles.extend(pairs.iter().map(|&(re, im)| Pole::Pair { re, im }));
            let K = place_all(&poles);
            prop_assert_eq!(K.len(), poles.iter().map(|p| p.count()).sum::<usize>());
            for pole in poles {
                let (re, im) = match pole {
                    Pole::Real(λ) => (λ, 0.0),
                    Pole::Pair { re, im } => (re, im),
                };
                // Horner's rule over complex numbers
                let (mut value, mut size) = ((1.0, 0.0), 1.0f64);
                for k in &K {
                    value = (value.0 * re - value.1 * im + k, value.0 * im + value.1 * re);
                    size = size * re.hypot(im) + k.abs();
                }
                prop_assert!(value.0.hypot(value.1) < 1e-12 * size);
            }
        }

        /// (2.26): V(A − KC) = ΛV.
        #[test]
        fn the_vandermonde_matrix_diagonalises(poles in prop::collection::vec(-5.0..-0.1f64, 1..7)) {
            let V = vandermonde(&poles);
            let Λ = DMatrix::from_diagonal(&poles.clone().into());
            let scale = V.amax() * 5.0;
            let difference = &V * companion(&place(&poles)) - Λ * &V;
            prop_assert!(difference.amax() < 1e-12 * scale, "{difference}");
        }

        /// The Riccati inequality itself, multiplied by V from both sides as in
        /// (3.17) so that its numbers stay near one, and (3.20) with equality.
        #[test]
        fn the_inequality_holds_at_the_smallest_σ(
            n in 1usize..4, α in 0.1..5.0f64, β in 0.1..3.0f64, γ in 0.1..3.0f64
        ) {
            let found = lemma_3_2(n, α, β, γ).unwrap();
            let inverse = inverse(&found.poles);
            let identity = DMatrix::identity(n, n);
            let residual = (&inverse * vandermonde(&found.poles) - &identity).amax();
            prop_assert!(residual < 1e-6, "V⁻¹V − I = {residual}");
            let Λ = DMatrix::from_diagonal(&found.poles.clone().into());
            let ones = DMatrix::from_element(n, n, 1.0);
            let left = Λ * 2.0 + ones * (β * β) + identity * (2.0 * α)
                + inverse.transpose() * &inverse * (γ * γ);
            let largest = SymmetricEigen::new(left).eigenvalues.max();
            prop_assert!(largest <= 1e-9 * found.σ, "{largest}");
            let norm = inverse.singular_values().max();
            let right = α + n as f64 * β * β / 2.0 + γ * γ * norm * norm / 2.0;
            prop_assert!((found.σ - right).abs() < 1e-9 * found.σ || found.σ <= 1.0 + 1e-9);
        }

        /// The norm falls with σ: the bisection finds the smallest σ.
        #[test]
        fn the_norm_falls_with_σ(n in 2usize..9, σ in 1.05..6.0f64, step in 1.01..2.0f64) {
            let norm = |σ| inverse_norm(σ, n).unwrap();
            prop_assert!(norm(σ * step) <= norm(σ) * (1.0 + 1e-9));
        }
    }

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
