//! Lyapunov's equation AᵀP + PA = −Q, in floating point: what it returns is a proposal, and
//! [`definite`](crate::definite) or [`decay::holds`](crate::decay::holds) decide what it
//! proves.

use nalgebra::{DMatrix, DVector};

/// The symmetric P with AᵀP + PA = −Q for a square A and a symmetric Q of its size; none
/// where two eigenvalues of A cancel. Nothing is checked of P: it is definite where A is
/// stable, up to rounding.
///
/// ```
/// use lynkeus_proof::lyapunov;
/// use nalgebra::DMatrix;
///
/// let A = DMatrix::from_row_slice(2, 2, &[-2.0, 1.0, -1.0, 0.0]);
/// let P = lyapunov::solve(&A, &DMatrix::identity(2, 2)).unwrap();
/// assert!((A.transpose() * &P + &P * &A + DMatrix::identity(2, 2)).amax() < 1e-12);
/// ```
pub fn solve(A: &DMatrix<f64>, Q: &DMatrix<f64>) -> Option<DMatrix<f64>> {
    let n = A.nrows();
    let unit = DMatrix::<f64>::identity(n, n);
    let system = unit.kronecker(&A.transpose()) + A.transpose().kronecker(&unit);
    let right = -DVector::from_column_slice(Q.as_slice());
    let solution = system.lu().solve(&right)?;
    let P = symmetric(&DMatrix::from_column_slice(n, n, solution.as_slice()));
    P.iter().all(|x| x.is_finite()).then_some(P)
}

/// The P of A(a) − gC with Q = I: the n − 1 partials a stand above the diagonal of A, and
/// C = (1, 0, …, 0).
pub fn of_chain(g: &[f64], a: &[f64]) -> Option<DMatrix<f64>> {
    let n = g.len();
    if a.len() + 1 != n {
        return None;
    }
    let above = |i: usize, j: usize| if j == i + 1 { a[i] } else { 0.0 };
    let A = DMatrix::from_fn(n, n, |i, j| above(i, j) - if j == 0 { g[i] } else { 0.0 });
    solve(&A, &DMatrix::identity(n, n))
}

/// (P + Pᵀ)/2, symmetric to the last bit.
pub(crate) fn symmetric(P: &DMatrix<f64>) -> DMatrix<f64> {
    (P + P.transpose()) * 0.5
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both poles at −1: SciPy's solve_continuous_lyapunov.
    #[test]
    fn two_states() {
        let P = of_chain(&[2.0, 1.0], &[1.0]).unwrap();
        let expected = DMatrix::from_row_slice(2, 2, &[0.5, -0.5, -0.5, 1.5]);
        assert!((P - expected).amax() < 1e-12);
    }

    /// x₂ in units of −2: P scales with T = diag(1, −2).
    #[test]
    fn a_partial_is_a_change_of_units() {
        let P = of_chain(&[2.0, -0.5], &[-2.0]).unwrap();
        let A = DMatrix::from_row_slice(2, 2, &[-2.0, -2.0, 0.5, 0.0]);
        let residual = A.transpose() * &P + &P * A + DMatrix::identity(2, 2);
        assert!(residual.amax() < 1e-12, "{P}");
    }

    #[test]
    fn what_has_no_solution_is_refused() {
        // the eigenvalues ±1 cancel
        let A = DMatrix::from_row_slice(2, 2, &[1.0, 0.0, 0.0, -1.0]);
        assert_eq!(solve(&A, &DMatrix::identity(2, 2)), None);
        assert_eq!(of_chain(&[2.0, 1.0], &[f64::NAN]), None);
        assert_eq!(of_chain(&[2.0, 1.0], &[]), None);
    }
}
