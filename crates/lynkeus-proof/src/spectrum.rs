//! Eigenvalues and singular values in a bounded number of sweeps. What is returned is finite.

use nalgebra::linalg::{SVD, Schur};
use nalgebra::{Complex, DMatrix, DVector, Dyn, SymmetricEigen};

/// Sweeps of the QR iteration for a matrix of this size: two or three per eigenvalue are usual,
/// and a matrix whose entries lie hundreds of powers of ten apart may not converge at all.
fn sweeps(size: usize) -> usize {
    100 * size.max(10)
}

/// Whether there are entries, and all are finite.
fn is_sound(matrix: &DMatrix<f64>) -> bool {
    !matrix.is_empty() && matrix.iter().all(|x| x.is_finite())
}

/// The power of two just below a number, or nearest to it in range: dividing by it changes no
/// digit. One for zero.
pub(crate) fn power_of_two(x: f64) -> f64 {
    match x == 0.0 {
        true => 1.0,
        false => x.abs().log2().floor().min(1023.0).exp2(),
    }
}

/// The eigenvalues of a square matrix; none where an entry or an eigenvalue is not finite, or
/// the iteration does not converge.
pub fn eigenvalues(matrix: DMatrix<f64>) -> Option<DVector<Complex<f64>>> {
    if matrix.is_empty() {
        return Some(DVector::zeros(0));
    }
    if !is_sound(&matrix) {
        return None;
    }
    // neither squares nor products of two entries leave the range of numbers
    let unit = power_of_two(matrix.amax());
    let sweeps = sweeps(matrix.nrows());
    let schur = Schur::try_new(matrix / unit, f64::EPSILON, sweeps)?;
    let found = on_the_diagonal(&schur.unpack().1).map(|λ| λ * unit);
    let finite = found.iter().all(|λ| λ.re.is_finite() && λ.im.is_finite());
    finite.then_some(found)
}

/// The eigenvalues of a quasi-triangular matrix. Of a block with a double eigenvalue rounding
/// may make two real ones: [`Schur::complex_eigenvalues`] has NaN there.
fn on_the_diagonal(T: &DMatrix<f64>) -> DVector<Complex<f64>> {
    let n = T.nrows();
    let real = |x: f64| Complex::new(x, 0.0);
    let mut found = DVector::from_fn(n, |i, _| real(T[(i, i)]));
    for i in 1..n {
        let (above, below) = (T[(i - 1, i - 1)], T[(i, i)]);
        if T[(i, i - 1)] == 0.0 {
            continue;
        }
        let half = 0.5 * (above - below);
        let square = T[(i, i - 1)] * T[(i - 1, i)] + half * half;
        let off = real(square).sqrt();
        let middle = real(0.5 * (above + below));
        (found[i - 1], found[i]) = (middle + off, middle - off);
    }
    found
}

/// The singular values of a matrix, the largest first, with the left and the right vectors asked
/// for; none as for [`eigenvalues`], and for a matrix without entries.
pub fn singular(matrix: DMatrix<f64>, left: bool, right: bool) -> Option<SVD<f64, Dyn, Dyn>> {
    if !is_sound(&matrix) {
        return None;
    }
    let sweeps = sweeps(matrix.nrows().max(matrix.ncols()));
    let mut found = SVD::try_new_unordered(matrix, left, right, f64::EPSILON, sweeps)?;
    let vectors = found.u.iter().chain(&found.v_t).flat_map(|v| v.iter());
    let finite = found.singular_values.iter().chain(vectors);
    if !finite.into_iter().all(|x| x.is_finite()) {
        return None;
    }
    found.sort_by_singular_values();
    Some(found)
}

/// The eigenvalues of a symmetric matrix, in no order, with its eigenvectors; none as for
/// [`singular`]. Only the lower triangle is read.
pub fn symmetric(matrix: DMatrix<f64>) -> Option<SymmetricEigen<f64, Dyn>> {
    if !is_sound(&matrix) {
        return None;
    }
    let sweeps = sweeps(matrix.nrows());
    let found = SymmetricEigen::try_new(matrix, f64::EPSILON, sweeps)?;
    let numbers = found.eigenvalues.iter().chain(found.eigenvectors.iter());
    numbers.into_iter().all(|x| x.is_finite()).then_some(found)
}

/// The largest real part of an eigenvalue of a square matrix; none as for [`eigenvalues`], and
/// for a matrix without entries.
pub fn abscissa(matrix: DMatrix<f64>) -> Option<f64> {
    eigenvalues(matrix)?.iter().map(|λ| λ.re).reduce(f64::max)
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

    /// The squares of such entries are no numbers.
    #[test]
    fn entries_far_from_one_lose_no_eigenvalue() {
        for size in [1e200, 1e-200] {
            let matrix = [size, -size, size * 1e-10, -3.0 * size];
            let found = abscissa(DMatrix::from_row_slice(2, 2, &matrix)).unwrap();
            // (λ − 1)(λ + 3) = −1e-10
            let exact = size * (-1.0 + (4.0_f64 - 1e-10).sqrt());
            assert!((found - exact).abs() < 1e-14 * size, "{found}");
            // a rotation by entries whose product overflows, beside a third state
            let turning = [0.0, -size, 0.0, size, 0.0, 0.0, 0.0, 0.0, -size];
            let found = eigenvalues(DMatrix::from_row_slice(3, 3, &turning)).unwrap();
            let fastest = found.iter().map(|λ| λ.im).reduce(f64::max).unwrap();
            assert!((fastest - size).abs() < 1e-14 * size, "{found}");
        }
        let largest = DMatrix::from_element(2, 2, f64::MAX);
        // 2·MAX is no number
        assert_eq!(eigenvalues(largest.clone()), None);
        assert!(singular(largest, true, true).is_none());
        assert_eq!(
            abscissa(DMatrix::from_element(1, 1, f64::MAX)),
            Some(f64::MAX)
        );
        assert_eq!(abscissa(DMatrix::from_element(1, 1, 5e-324)), Some(5e-324));
        assert_eq!(abscissa(DMatrix::zeros(2, 2)), Some(0.0));
    }

    #[test]
    fn nothing_has_no_eigenvalue() {
        assert_eq!(eigenvalues(DMatrix::zeros(0, 0)).unwrap().len(), 0);
        assert_eq!(abscissa(DMatrix::zeros(0, 0)), None);
        assert!(symmetric(DMatrix::zeros(0, 0)).is_none());
        assert!(singular(DMatrix::zeros(0, 3), true, true).is_none());
    }

    /// Whatever the entries, everything ends, and what is returned is finite.
    #[test]
    fn wild_matrices_end() {
        let sizes = [
            0.0,
            5e-324,
            1e-310,
            1e-160,
            1.0,
            1e160,
            1e308,
            f64::MAX,
            f64::INFINITY,
            f64::NAN,
        ];
        let mut state = 1_u64;
        let mut draw = |count: usize| {
            state = state
                .wrapping_mul(6_364_136_223_846_793_005)
                .wrapping_add(1);
            (state >> 33) as usize % count
        };
        for _ in 0..3000 {
            let n = 1 + draw(5);
            let kinds = 1 + draw(sizes.len());
            let matrix = DMatrix::from_fn(n, n, |_, _| {
                let sign = if draw(2) == 0 { 1.0 } else { -1.0 };
                sign * sizes[draw(kinds)] * (1.0 + draw(7) as f64 / 8.0)
            });
            let half = (&matrix + matrix.transpose()) * 0.5;
            let found = symmetric(half).map(|found| found.eigenvalues);
            assert!(found.is_none_or(|found| found.iter().all(|x| x.is_finite())));
            let found = eigenvalues(matrix.clone());
            assert!(
                found
                    .is_none_or(|found| found.iter().all(|λ| λ.re.is_finite() && λ.im.is_finite()))
            );
            let found = singular(matrix, true, true).map(|found| found.singular_values);
            assert!(found.is_none_or(|found| found.iter().all(|x| x.is_finite())));
        }
    }

    /// NumPy's eigvalsh: 2 − √2, 2, 2 + √2.
    #[test]
    fn a_symmetric_matrix_has_its_spectrum() {
        let matrix = [2.0, -1.0, 0.0, -1.0, 2.0, -1.0, 0.0, -1.0, 2.0];
        let found = symmetric(DMatrix::from_row_slice(3, 3, &matrix)).unwrap();
        assert!((found.eigenvalues.max() - 2.0 - 2f64.sqrt()).abs() < 1e-14);
        assert!((found.eigenvalues.min() - 2.0 + 2f64.sqrt()).abs() < 1e-14);
    }

    /// What rounding makes of a double eigenvalue.
    #[test]
    fn a_double_eigenvalue_is_a_number() {
        for (square, exact) in [(1e-18, 1e-9), (0.0, 0.0), (-1e-18, 0.0)] {
            let T = DMatrix::from_row_slice(2, 2, &[-3.0, square, 1.0, -3.0]);
            let found = on_the_diagonal(&T);
            assert!((found[0].re + 3.0 - exact).abs() < 1e-15, "{found}");
            assert_eq!(found[0].im > 0.0, square < 0.0);
            assert_eq!(found[0].im, -found[1].im);
        }
        // a chain with two double poles, in coordinates in which all is mixed
        let mut decided = 0;
        for k in 0..400 {
            let x = f64::from(k) * 0.1;
            let A = [
                -6.0,
                1.0,
                0.0,
                0.0,
                -9.0,
                0.0,
                x.sin(),
                0.0,
                0.0,
                0.0,
                -6.0,
                1.0,
                x.cos(),
                0.0,
                -9.0,
                0.0,
            ];
            decided += usize::from(abscissa(DMatrix::from_row_slice(4, 4, &A)).is_some());
        }
        assert_eq!(decided, 400);
    }
}
