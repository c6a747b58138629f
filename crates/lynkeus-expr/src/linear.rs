//! A x = b over `f64` by Householder QR with column pivoting: it reveals the
//! rank, so that the answer stays bounded where A is close to singular.

/// Pivots smaller than this fraction of the largest count as zero.
const RANK_TOLERANCE: f64 = 1e-13;

/// Solves A x = b in place: `b` (n) becomes x, `a` (n×n row by row) is consumed.
/// Returns the ratio of the smallest to the largest pivot, an estimate of
/// 1/cond(A). Where it is below [`RANK_TOLERANCE`] the components along the
/// lost directions are set to zero, so that x stays bounded.
///
/// Nothing is allocated: what is needed later stands in `a` where zeros would.
pub(crate) fn solve(a: &mut [f64], b: &mut [f64]) -> f64 {
    let n = b.len();
    for k in 0..n {
        let pivot = largest_column(a, n, k);
        swap_columns(a, n, k, pivot);
        reflect(a, b, n, k);
        if k + 1 < n {
            // the last column has no choice of pivot, and no place for it
            a[(k + 1) * n + k] = pivot as f64;
        }
    }
    let largest = if n == 0 { 1.0 } else { a[0].abs() };
    let rank = (0..n)
        .take_while(|&k| a[k * n + k].abs() > RANK_TOLERANCE * largest)
        .count();
    for k in (rank..n).rev() {
        // A NaN in the data must reach the answer; only a true rank loss is cut.
        b[k] = if b[k].is_nan() || a[k * n + k].is_nan() {
            f64::NAN
        } else {
            0.0
        };
    }
    for k in (0..rank).rev() {
        let tail: f64 = (k + 1..n).map(|j| a[k * n + j] * b[j]).sum();
        b[k] = (b[k] - tail) / a[k * n + k];
    }
    for k in (1..n).rev() {
        b.swap(k - 1, a[k * n + k - 1] as usize);
    }
    let smallest = if n == 0 { 1.0 } else { a[n * n - 1].abs() };
    if largest > 0.0 {
        (smallest / largest).min(1.0)
    } else {
        0.0
    }
}

/// The column of the remaining block with the largest norm.
fn largest_column(a: &[f64], n: usize, k: usize) -> usize {
    let norm = |j: usize| (k..n).map(|i| a[i * n + j].powi(2)).sum::<f64>();
    let mut best = (k, norm(k));
    for j in k + 1..n {
        let norm = norm(j);
        if norm > best.1 {
            best = (j, norm);
        }
    }
    best.0
}

fn swap_columns(a: &mut [f64], n: usize, j: usize, k: usize) {
    if j != k {
        for i in 0..n {
            a.swap(i * n + j, i * n + k);
        }
    }
}

/// Householder reflection that zeroes column k below the diagonal; its vector is left there.
fn reflect(a: &mut [f64], b: &mut [f64], n: usize, k: usize) {
    let scale = (k..n).fold(0.0, |m: f64, i| m.max(a[i * n + k].abs()));
    if scale == 0.0 {
        return;
    }
    let norm = scale
        * (k..n)
            .map(|i| (a[i * n + k] / scale).powi(2))
            .sum::<f64>()
            .sqrt();
    let corner = a[k * n + k];
    let alpha = if corner > 0.0 { -norm } else { norm };
    let first = corner / scale - alpha / scale;
    let v = |a: &[f64], i: usize| if i == k { first } else { a[i * n + k] };
    // the column itself first: its place below the diagonal then takes the vector
    let mut own = first * corner;
    let mut vv = first * first;
    for i in k + 1..n {
        let entry = a[i * n + k];
        let scaled = entry / scale;
        own += scaled * entry;
        vv += scaled * scaled;
        a[i * n + k] = scaled;
    }
    if vv == 0.0 {
        return;
    }
    a[k * n + k] -= 2.0 * own / vv * first;
    for j in k + 1..n {
        let dot: f64 = (k..n).map(|i| v(a, i) * a[i * n + j]).sum();
        for i in k..n {
            a[i * n + j] -= 2.0 * dot / vv * v(a, i);
        }
    }
    let dot: f64 = (k..n).map(|i| v(a, i) * b[i]).sum();
    for (i, b) in b.iter_mut().enumerate().skip(k) {
        *b -= 2.0 * dot / vv * v(a, i);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_singular_system_has_a_bounded_answer_and_says_so() {
        let mut b = [1.0, 2.0];
        let rcond = solve(&mut [1.0, 1.0, 1.0, 1.0], &mut b);
        assert!(rcond < 1e-15);
        // the least-squares answer along the direction that is left
        assert!((b[0] + b[1] - 1.5).abs() < 1e-15);
    }

    #[test]
    fn nan_in_the_data_reaches_the_answer() {
        let mut b = [1.0, 2.0];
        solve(&mut [f64::NAN, 0.0, 0.0, 1.0], &mut b);
        assert!(b.iter().any(|x| x.is_nan()));
    }

    proptest! {
        #[test]
        fn residuals_vanish(a in prop::array::uniform9(-1.0..1.0), x in prop::array::uniform3(-1.0..1.0)) {
            let b: [f64; 3] = std::array::from_fn(|i| (0..3).map(|j| a[3 * i + j] * x[j]).sum());
            let mut solution = b;
            let rcond = solve(&mut a.to_vec(), &mut solution);
            prop_assume!(rcond > 1e-6);
            for i in 0..3 {
                let residual: f64 = (0..3).map(|j| a[3 * i + j] * solution[j]).sum::<f64>() - b[i];
                prop_assert!(residual.abs() < 1e-12);
            }
        }
    }
}
