//! AᵀP + PA = −I, for a P that other means verify.

use lynkeus_expr::{Interval, interval};

/// The symmetric P of A(a) − gC with the n − 1 partials a above the diagonal of A, in
/// floating point; none where the equation has no unique solution. A proof has to check it.
pub fn chain(g: &[f64], a: &[f64]) -> Option<Vec<Vec<f64>>> {
    let n = g.len();
    let above = |i: usize, j: usize| {
        if j == i + 1 {
            a.get(i).copied().unwrap_or(f64::NAN)
        } else {
            0.0
        }
    };
    let A = |i: usize, j: usize| above(i, j) - if j == 0 { g[i] } else { 0.0 };
    let place = |i: usize, j: usize| i * n + j;
    let mut system = vec![vec![0.0; n * n]; n * n];
    let mut right = vec![0.0; n * n];
    for i in 0..n {
        for j in 0..n {
            let row = &mut system[place(i, j)];
            for k in 0..n {
                row[place(k, j)] += A(k, i);
                row[place(i, k)] += A(k, j);
            }
            right[place(i, j)] = if i == j { -1.0 } else { 0.0 };
        }
    }
    let points = |x: &[f64]| x.iter().map(|&x| Interval::point(x)).collect::<Vec<_>>();
    let flat: Vec<f64> = system.concat();
    let (P, regular) = interval::solve(&points(&flat), &points(&right));
    let entry = |i: usize, j: usize| {
        let (a, b) = (P[place(i, j)].midpoint(), P[place(j, i)].midpoint());
        0.5 * (a + b)
    };
    let row = |i: usize| (0..n).map(|j| entry(i, j)).collect::<Vec<f64>>();
    let rows: Vec<Vec<f64>> = (0..n).map(row).collect();
    (regular && rows.iter().flatten().all(|x| x.is_finite())).then_some(rows)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Both poles at −1: SciPy's solve_continuous_lyapunov.
    #[test]
    fn two_states() {
        let P = chain(&[2.0, 1.0], &[1.0]).unwrap();
        let expected = [[0.5, -0.5], [-0.5, 1.5]];
        for (row, expected) in P.iter().flatten().zip(expected.iter().flatten()) {
            assert!((row - expected).abs() < 1e-12, "{P:?}");
        }
    }

    /// x₂ in units of −2: P scales with T = diag(1, −2).
    #[test]
    fn a_partial_is_a_change_of_units() {
        let P = chain(&[2.0, -0.5], &[-2.0]).unwrap();
        let residual = |i: usize, j: usize| -> f64 {
            let A = [[-2.0, -2.0], [0.5, 0.0]];
            (0..2).map(|k| A[k][i] * P[k][j] + P[i][k] * A[k][j]).sum()
        };
        for (i, j) in [(0, 0), (0, 1), (1, 0), (1, 1)] {
            let expected = if i == j { -1.0 } else { 0.0 };
            assert!((residual(i, j) - expected).abs() < 1e-12, "{P:?}");
        }
    }
}
