//! Eigenvalues and singular values in a bounded number of sweeps.

use nalgebra::linalg::{SVD, Schur};
use nalgebra::{Complex, DMatrix, DVector, Dyn};

/// Sweeps of the QR iteration: two or three per eigenvalue are usual, and a matrix whose entries
/// lie hundreds of powers of ten apart may not converge at all.
const SWEEPS: usize = 10_000;

/// The eigenvalues of a square matrix; none where an entry is not finite or the iteration does
/// not converge.
pub fn eigenvalues(matrix: DMatrix<f64>) -> Option<DVector<Complex<f64>>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    let schur = Schur::try_new(matrix, f64::EPSILON, SWEEPS)?;
    Some(schur.complex_eigenvalues())
}

/// The singular values of a matrix, with the left and the right vectors asked for; none as for
/// [`eigenvalues`].
pub fn singular(matrix: DMatrix<f64>, left: bool, right: bool) -> Option<SVD<f64, Dyn, Dyn>> {
    if !matrix.iter().all(|x| x.is_finite()) {
        return None;
    }
    SVD::try_new(matrix, left, right, f64::EPSILON, SWEEPS)
}

/// The largest real part of an eigenvalue of a square matrix; none as for [`eigenvalues`].
pub fn abscissa(matrix: DMatrix<f64>) -> Option<f64> {
    let eigenvalues = eigenvalues(matrix)?;
    let largest = eigenvalues
        .iter()
        .map(|λ| λ.re)
        .fold(f64::NEG_INFINITY, f64::max);
    largest.is_finite().then_some(largest)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A flow over a sampling interval, of which the QR iteration finds no eigenvalue.
    #[test]
    fn an_iteration_that_does_not_converge_ends() {
        #[rustfmt::skip]
        let flow = [
            1.0e+00, 3.8e-04, 5.4e-07, 7.0e-10, 8.7e-13, 1.1e-15, 1.5e-18, 2.2e-21, 2.2e-32, 9.4e-44, 2.0e-55, -1.0e-32, 9.6e-34,
            5.9e-12, 1.0e+00, 2.8e-03, 5.5e-06, 9.2e-09, 1.5e-11, 2.4e-14, 4.0e-17, 4.6e-28, 2.2e-39, 5.2e-51, -2.2e-28, 2.0e-29,
            -6.2e-12, 9.9e-12, 1.0e+00, 3.8e-03, 9.6e-06, 2.1e-08, 4.3e-11, 8.5e-14, 1.1e-24, 6.2e-36, 1.6e-47, -5.3e-25, 4.9e-26,
            -6.1e-12, 4.9e-23, 9.9e-12, 1.0e+00, 5.0e-03, 1.6e-05, 4.4e-08, 1.1e-10, 1.8e-21, 1.1e-32, 3.4e-44, -8.2e-22, 7.7e-23,
            -6.9e-12, 6.9e-34, 4.9e-23, 9.9e-12, 9.9e-01, 6.5e-03, 2.6e-05, 8.8e-08, 1.8e-18, 1.4e-29, 4.7e-41, -8.2e-19, 7.6e-20,
            -6.8e-12, 2.1e-31, 4.1e-34, 4.9e-23, 9.9e-12, 9.9e-01, 8.1e-03, 4.0e-05, 1.1e-15, 1.0e-26, 4.4e-38, -5.1e-16, 4.7e-17,
            -6.8e-12, -4.3e-31, -4.2e-34, 1.6e-34, 4.9e-23, 9.8e-12, 9.9e-01, 9.9e-03, 4.0e-13, 5.1e-24, 2.7e-35, -1.9e-13, 1.7e-14,
            -3.4e-23, -1.5e-42, -2.3e-45, 4.0e-46, 1.6e-34, 4.9e-23, 9.8e-12, 9.9e-01, 8.0e-11, 1.5e-21, 1.1e-32, -3.7e-11, 3.5e-12,
            -1.5e-34, -5.7e-54, -8.3e-57, 1.1e-57, 5.4e-46, 2.2e-34, 6.6e-23, 1.3e-11, 1.0e+00, 3.8e-11, 4.0e-22, -2.4e-11, 2.3e-23,
            -5.1e-46, -1.8e-65, -3.0e-68, 2.4e-69, 1.5e-57, 7.3e-46, 3.0e-34, 8.9e-23, 1.3e-11, 1.0e+00, 2.1e-11, -1.7e-11, 1.0e-34,
            -1.4e-57, -6.6e-77, -1.1e-79, 4.5e-81, 3.2e-69, 2.0e-57, 9.9e-46, 4.0e-34, 9.0e-23, 1.3e-11, 1.0e+00, 3.6e-12, 3.5e-46,
            -3.0e-70, -2.2e-89, -3.6e-92, 7.3e-94, 6.2e-82, 4.4e-70, 2.7e-58, 1.3e-46, 4.0e-35, 9.0e-24, 1.3e-12, 1.0e+00, 9.4e-59,
            1.0e-97, -1.5e-101, 3.0e-104, 0.0e+00, 8.7e-109, -3.9e-97, 1.1e-84, 6.1e-73, 3.4e-61, 4.6e-50, 6.4e-39, -4.8e-11, 1.0e+00,
        ];
        assert_eq!(eigenvalues(DMatrix::from_row_slice(13, 13, &flow)), None);
    }

    #[test]
    fn a_rotation_that_shrinks_has_its_spectrum() {
        let matrix = DMatrix::from_row_slice(2, 2, &[-0.5, -2.0, 2.0, -0.5]);
        let found = eigenvalues(matrix.clone()).unwrap();
        assert!(
            found
                .iter()
                .all(|λ| (λ.norm() - 4.25_f64.sqrt()).abs() < 1e-14)
        );
        assert!((abscissa(matrix).unwrap() + 0.5).abs() < 1e-14);
        assert_eq!(eigenvalues(DMatrix::from_element(2, 2, f64::NAN)), None);
    }
}
