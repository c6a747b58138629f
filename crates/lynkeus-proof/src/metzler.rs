//! Comparison matrices: symmetric, nothing negative off the diagonal (Berman and Plemmons
//! 1979, *Nonnegative matrices in the mathematical sciences*, chapter 6).
//!
//! If |z|ᵀM|z| bounds a quadratic form from above and M v < 0 for one positive
//! vector v, then M is negative definite (−M is an M-matrix), and so is the form.
//! A vector is found in floating point and checked in interval arithmetic, so that
//! a yes is a proof whatever the rounding on the way to v.

use lynkeus_expr::Interval;

use crate::magnitude::{self, Magnitudes, root};
use crate::matrix::sum;

/// Proves that M is negative definite; `false` where it is not or nearly not.
pub fn is_negative_definite(M: &Magnitudes) -> bool {
    let Some(v) = witness(M) else { return false };
    M.iter().all(|row| product(row, &v).hi() < 0.0)
}

/// A bound of the largest eigenvalue of a matrix without negative entries, not
/// necessarily symmetric: max_i (M v)_i/v_i for a positive v (Collatz, Wielandt).
pub fn spectral_radius(M: &Magnitudes) -> f64 {
    let n = M.len();
    let scale = M.iter().flatten().fold(0.0, |m: f64, &x| m.max(x));
    if scale == 0.0 || !scale.is_finite() {
        return scale;
    }
    let mut v = vec![1.0; n];
    let mut least = f64::INFINITY;
    for _ in 0..200 {
        let image: Vec<Interval> = M.iter().map(|row| product(row, &v)).collect();
        let ratios = image
            .iter()
            .zip(&v)
            .map(|(w, &v)| (*w / Interval::point(v)).hi());
        least = least.min(ratios.fold(0.0, f64::max));
        let largest = image.iter().fold(0.0, |m: f64, w| m.max(w.hi()));
        // the mean keeps v positive where M is reducible or has a period
        v = v
            .iter()
            .zip(&image)
            .map(|(v, w)| 0.5 * v + 0.5 * w.hi() / largest)
            .collect();
    }
    least
}

/// A bound of the spectral norm of every matrix with entries up to those of M, which are
/// not negative: ‖M‖² is the spectral radius of MᵀM.
pub fn spectral_norm(M: &Magnitudes) -> f64 {
    let columns = M.first().map_or(0, Vec::len);
    let transposed = |j: usize| M.iter().map(|row| row[j]).collect();
    let transposed: Magnitudes = (0..columns).map(transposed).collect();
    root(spectral_radius(&magnitude::product(&transposed, M)))
}

fn product(row: &[f64], v: &[f64]) -> Interval {
    let terms = row.iter().zip(v);
    sum(terms.map(|(&m, &v)| Interval::point(m) * Interval::point(v)))
}

/// v with M v = −1, by elimination; positive exactly where −M is an M-matrix.
fn witness(M: &Magnitudes) -> Option<Vec<f64>> {
    let n = M.len();
    let mut a: Vec<Vec<f64>> = M
        .iter()
        .map(|row| row.iter().map(|x| -x).collect())
        .collect();
    let mut b = vec![1.0; n];
    for k in 0..n {
        if !(a[k][k] > 0.0 && a[k][k].is_finite()) {
            return None;
        }
        let (above, below) = a.split_at_mut(k + 1);
        for (i, row) in below.iter_mut().enumerate() {
            let factor = row[k] / above[k][k];
            for (entry, pivot) in row.iter_mut().zip(&above[k]).skip(k) {
                *entry -= factor * pivot;
            }
            b[k + 1 + i] -= factor * b[k];
        }
    }
    for k in (0..n).rev() {
        let known: f64 = (k + 1..n).map(|j| a[k][j] * b[j]).sum();
        b[k] = (b[k] - known) / a[k][k];
    }
    b.iter().all(|v| *v > 0.0 && v.is_finite()).then_some(b)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn definite_up_to_rounding() {
        let with = |c: f64| vec![vec![-1.0, c], vec![c, -4.0]];
        assert!(
            is_negative_definite(&with(1.999_999))
                && !is_negative_definite(&with(2.0))
                && !is_negative_definite(&with(2.1))
        );
    }

    #[test]
    fn the_radius_is_bounded_from_above_and_tightly() {
        let golden = (1.0 + 5f64.sqrt()) / 2.0;
        let found = spectral_radius(&vec![vec![1.0, 1.0], vec![1.0, 0.0]]);
        assert!(found >= golden && found < golden + 1e-12, "{found}");
        let period = spectral_radius(&vec![vec![0.0, 4.0], vec![1.0, 0.0]]);
        assert!((2.0..2.0 + 1e-12).contains(&period), "{period}");
        assert_eq!(spectral_radius(&vec![vec![0.0]]), 0.0);
        // triangular: v₂/v₁ has to shrink towards zero, so the bound is a little high
        let triangular = spectral_radius(&vec![vec![1.0, 1.0], vec![0.0, 0.5]]);
        assert!((1.0..1.01).contains(&triangular), "{triangular}");
    }
}
