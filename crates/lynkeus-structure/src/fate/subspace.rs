//! Subspaces by orthonormal bases; singular values within a share `zero` of the largest count as none.

use lynkeus_proof::spectrum;
use nalgebra::DMatrix;

/// An orthonormal basis of the null space; a matrix without rows has all of it. None where no
/// decomposition is found, as here below.
pub(super) fn null_space(a: &DMatrix<f64>, zero: f64) -> Option<DMatrix<f64>> {
    let n = a.ncols();
    if n == 0 {
        return Some(DMatrix::zeros(0, 0));
    }
    // rows of zeros, so that every direction is listed
    let square = DMatrix::from_fn(a.nrows().max(n), n, |i, j| {
        if i < a.nrows() { a[(i, j)] } else { 0.0 }
    });
    let svd = spectrum::singular(square, false, true)?;
    let right = svd.v_t.as_ref()?;
    let unseen: Vec<usize> = (0..n)
        .filter(|&k| {
            svd.singular_values[k] <= zero * svd.singular_values.max().max(f64::MIN_POSITIVE)
        })
        .collect();
    Some(DMatrix::from_fn(n, unseen.len(), |i, k| {
        right[(unseen[k], i)]
    }))
}

/// An orthonormal basis of the space that the columns span.
pub(super) fn image(a: &DMatrix<f64>, zero: f64) -> Option<DMatrix<f64>> {
    let across = null_space(&a.transpose(), zero)?;
    null_space(&across.transpose(), zero)
}

/// An orthonormal basis of the smallest A-invariant space that holds the columns of B.
pub(super) fn reached(A: &DMatrix<f64>, B: &DMatrix<f64>, zero: f64) -> Option<DMatrix<f64>> {
    let n = A.nrows();
    let scale = A.amax().max(f64::MIN_POSITIVE);
    let columns: Vec<_> = B
        .column_iter()
        .filter(|c| c.norm() > zero)
        .map(|c| c.normalize())
        .collect();
    let mut space = image(
        &DMatrix::from_fn(n, columns.len(), |i, k| columns[k][i]),
        zero,
    )?;
    loop {
        let moved = A * &space / scale;
        let both = DMatrix::from_fn(n, 2 * space.ncols(), |i, k| {
            match k.checked_sub(space.ncols()) {
                None => space[(i, k)],
                Some(k) => moved[(i, k)],
            }
        });
        let next = image(&both, zero)?;
        // it never shrinks, but by rounding
        if next.ncols() <= space.ncols() {
            return Some(space);
        }
        space = next;
    }
}
