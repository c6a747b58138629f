//! The slowest mode of a linear motion, as far as rounding leaves it certain.

use lynkeus_proof::spectrum;
use nalgebra::{Complex, DMatrix, DVector};

use crate::detectability::hidden::Detectability;

/// What counts as zero beside one.
const ZERO: f64 = 1e-8;
/// The same where nothing but rounding is left out.
const ROUNDED: f64 = 1e-13;
/// Real parts further from zero than this share of what is rounded need no condition number.
const AXIS: f64 = 1e-5;
/// The rounding of entries that computed eigenvalues stand for.
const EIGENVALUES: f64 = 10.0 * f64::EPSILON;

/// Steps of inverse iteration; the first finds the digits there are.
const ITERATIONS: usize = 3;
/// What is left of an eigenvector that was found, in units of rounding.
const FOUND: f64 = 1e3;

/// x' = Ax
pub(super) struct Modes {
    pub A: DMatrix<f64>,
    /// the size of the numbers that A was made of: its rounding is a share of this
    pub gross: f64,
}

impl Modes {
    /// The slowest mode that shows in a row, undecided where rounding may carry it across the
    /// imaginary axis, or where it rests on how small a coupling counts as none; with the number of modes that
    /// show. None where its eigenvalues are not found.
    pub fn detectability(&self, row: &DMatrix<f64>) -> Option<(Detectability, usize)> {
        let coarse = self.shown(row, ZERO)?;
        let count = coarse.A.nrows();
        if count == self.A.nrows() {
            return Some((coarse.slowest()?, count));
        }
        let fine = self.shown(row, ROUNDED)?;
        if count == fine.A.nrows() {
            return Some((coarse.slowest()?, count));
        }
        let (coarse, found) = (coarse.slowest()?, fine.slowest()?);
        let agree = std::mem::discriminant(&coarse) == std::mem::discriminant(&found);
        let found = Some(found).filter(|_| agree);
        Some((found.unwrap_or(Detectability::Undecided), fine.A.nrows()))
    }

    /// What shows in a row. In it every eigenvalue has one eigenvector.
    fn shown(&self, row: &DMatrix<f64>, zero: f64) -> Option<Self> {
        let basis = reached(&self.A.transpose(), &row.transpose(), zero)?;
        Some(Self {
            A: basis.transpose() * &self.A * &basis,
            gross: self.gross,
        })
    }

    fn slowest(&self) -> Option<Detectability> {
        let modes = spectrum::eigenvalues(self.A.clone())?;
        let slowest = modes.iter().map(|λ| λ.re).reduce(f64::max)?;
        let doubts = (0..modes.len()).map(|k| self.doubt(&modes, k));
        let (width, is_simple): (Vec<f64>, Vec<bool>) = doubts.unzip();
        let all = || modes.iter().map(|λ| λ.re).zip(&width);
        let growing = all().filter(|(re, width)| *re > **width);
        if let Some(rate) = growing.map(|(re, _)| re).reduce(f64::max) {
            return Some(Detectability::Grows { rate });
        }
        let slow = all().zip(is_simple);
        let mut slow = slow.filter(|((re, width), _)| *re >= -**width).peekable();
        if slow.peek().is_none() {
            return Some(Detectability::Decays {
                rate: -slowest,
                is_proved: false,
            });
        }
        Some(match slow.all(|(_, is_simple)| is_simple) {
            true => Detectability::Stays,
            false => Detectability::Undecided,
        })
    }

    /// The size of what is rounded.
    fn scale(&self) -> f64 {
        self.gross.max(self.A.norm())
    }

    /// How far from where it is computed an eigenvalue may be; and whether it stands alone, so that what does not move
    /// there stays as it is: a multiple one may make errors grow with a power of time.
    fn doubt(&self, modes: &DVector<Complex<f64>>, k: usize) -> (f64, bool) {
        let mode = modes[k];
        let spread = blur(modes, mode, self.scale());
        let broad = AXIS.max(spread) * self.scale();
        if mode.re.abs() > broad {
            return (broad, false);
        }
        let others = (0..modes.len()).filter(|&i| i != k);
        let gap = others
            .map(|i| (modes[i] - mode).norm())
            .fold(f64::INFINITY, f64::min);
        let rounding = self.condition(mode) * EIGENVALUES;
        let width = rounding * self.scale();
        // to first order, which counts where the next mode is far beyond
        match 4.0 * width < gap {
            // of its own block's numbers, too: a fast part elsewhere makes nothing stay
            true => (width, mode.re.abs() <= rounding * self.A.norm()),
            false => (spread.max(radius(2)) * self.scale(), false),
        }
    }

    /// How far a simple eigenvalue moves per unit of change in A: 1/|uᴴv| of its left and right
    /// eigenvectors of length one (Golub and Van Loan, section 7.2.2). Infinite where inverse
    /// iteration does not find them.
    fn condition(&self, mode: Complex<f64>) -> f64 {
        let n = self.A.nrows();
        if n == 1 {
            return 1.0;
        }
        let A = self.A.map(|x| Complex::new(x, 0.0));
        // beside the mode, so that no pivot is zero
        let shift = mode + EIGENVALUES * self.scale();
        let shifted = A - DMatrix::identity(n, n) * shift;
        let (right, left) = (self.null(&shifted), self.null(&shifted.adjoint()));
        match (left, right) {
            (Some(u), Some(v)) => 1.0 / u.dotc(&v).norm(),
            _ => f64::INFINITY,
        }
    }

    /// The vector of length one that a matrix sends to nearly nothing.
    fn null(&self, matrix: &DMatrix<Complex<f64>>) -> Option<DVector<Complex<f64>>> {
        let solver = matrix.clone().lu();
        let mut v = DVector::from_fn(matrix.nrows(), |i, _| {
            Complex::new(1.0 + (i as f64).sin(), 0.0)
        });
        for _ in 0..ITERATIONS {
            v = solver.solve(&v)?;
            v /= Complex::new(v.norm(), 0.0);
        }
        let rest = (matrix * &v).norm();
        (rest <= FOUND * EIGENVALUES * self.scale()).then_some(v)
    }
}

/// How far rounding spreads a k-fold mode, in units of what is rounded.
fn radius(k: usize) -> f64 {
    EIGENVALUES.powf(1.0 / k as f64)
}

/// How far a mode may be from where it is computed, in units of `scale`: a k-fold one, which
/// rounding spreads over a circle, by the k-th root of the rounding.
fn blur(modes: &DVector<Complex<f64>>, mode: Complex<f64>, scale: f64) -> f64 {
    let near = |k: usize| {
        let across = 2.0 * radius(k) * scale;
        modes
            .iter()
            .filter(|λ| (**λ - mode).norm() <= across)
            .count()
    };
    let folds = (1..=modes.len()).rev().find(|&k| near(k) >= k);
    folds.map_or(0.0, radius)
}

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

/// [left, right]
pub(super) fn beside(left: &DMatrix<f64>, right: &DMatrix<f64>) -> DMatrix<f64> {
    let first = left.ncols();
    DMatrix::from_fn(left.nrows(), first + right.ncols(), |i, j| {
        match j.checked_sub(first) {
            None => left[(i, j)],
            Some(j) => right[(i, j)],
        }
    })
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
        let next = image(&beside(&space, &(A * &space / scale)), zero)?;
        // it never shrinks, but by rounding
        if next.ncols() <= space.ncols() {
            return Some(space);
        }
        space = next;
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The detectability of what `row` shows of x' = Ax, in coordinates that leave no entry of A as it is.
    fn mirrored(A: &DMatrix<f64>, row: &[f64]) -> Detectability {
        let n = A.nrows();
        let v = DMatrix::from_fn(n, 1, |i, _| 1.0 + (i as f64).sin());
        let Q = DMatrix::identity(n, n) - &v * v.transpose() * (2.0 / v.norm_squared());
        let row = DMatrix::from_row_slice(1, n, row) * &Q;
        let A = &Q * A * &Q;
        let modes = Modes { gross: A.norm(), A };
        modes.detectability(&row).unwrap().0
    }

    fn first(n: usize) -> Vec<f64> {
        (0..n).map(|i| f64::from(u8::from(i == 0))).collect()
    }

    /// x_i' = x_{i+1} + r x_i
    fn chain(n: usize, r: f64) -> DMatrix<f64> {
        DMatrix::from_fn(n, n, |i, j| match j.checked_sub(i) {
            Some(0) => r,
            Some(1) => 1.0,
            _ => 0.0,
        })
    }

    /// An n-fold mode is computed with an error of the n-th root of the rounding: of ten states,
    /// 0.03.
    #[test]
    fn a_multiple_mode_near_the_axis_is_undecided() {
        for r in [-0.01, 0.01, -1e-4] {
            let detectability = mirrored(&chain(10, r), &first(10));
            assert!(
                matches!(detectability, Detectability::Undecided),
                "{detectability:?}"
            );
        }
        let detectability = mirrored(&chain(10, -0.5), &first(10));
        assert!(
            matches!(detectability, Detectability::Decays { rate, .. } if rate > 0.3),
            "{detectability:?}"
        );
        let detectability = mirrored(&chain(10, 0.5), &first(10));
        assert!(
            matches!(detectability, Detectability::Grows { .. }),
            "{detectability:?}"
        );
    }

    /// Ten modes that are apart are computed to all digits, however slow the slowest is.
    #[test]
    fn modes_that_are_apart_are_decided() {
        for slowest in [-1e-3, 1e-3] {
            let mut A = chain(10, 0.0);
            for i in 0..10 {
                A[(i, i)] = if i == 6 {
                    slowest
                } else {
                    -0.2 - 0.3 * i as f64
                };
            }
            let detectability = mirrored(&A, &first(10));
            let found = match detectability {
                Detectability::Decays { rate, .. } => -rate,
                Detectability::Grows { rate } => rate,
                other => panic!("{other:?}"),
            };
            assert!((found - slowest).abs() < 1e-9, "{found}");
        }
    }
}
