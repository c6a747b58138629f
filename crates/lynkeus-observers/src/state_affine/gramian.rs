//! S(t) of (8) from above and, where F and C are numbers, from below.

use lynkeus_expr::Interval;
use lynkeus_gain::UnitFactor;
use lynkeus_proof::definite::least_eigenvalue;
use lynkeus_proof::matrix::{IntervalMatrix, square, sum, upper};
use lynkeus_proof::metzler;

/// After this many 1/θ the past is forgotten but for e^{−τ}.
pub(super) const TAU: f64 = 10.0;

/// |S_ij(t)| ≤ B_ij for all t. Entry by entry (8) is S_ij' = −θ(S_ij − r_ij), so
/// |S_ij| ≤ max(|S_ij(0)|, sup|r_ij|), and r_ij = (CᵀC − FᵀS − SF)_ij has entries of S
/// of earlier blocks only. `block` is the block of each place, from 0; `C` and `F`
/// bound the entries. The paper adds where this takes the larger.
pub(super) fn above(
    S0: &UnitFactor,
    C: &[Vec<f64>],
    F: &[Vec<f64>],
    block: &[usize],
) -> Vec<Vec<f64>> {
    let n = block.len();
    let start = product(S0);
    let mut B = vec![vec![Interval::ZERO; n]; n];
    let mut pairs: Vec<(usize, usize)> = (0..n).flat_map(|i| (i..n).map(move |j| (i, j))).collect();
    pairs.sort_by_key(|&(i, j)| block[i] + block[j]);
    for (i, j) in pairs {
        let point = Interval::point;
        let measured = sum(C.iter().map(|row| point(row[i]) * point(row[j])));
        let right = sum((0..n).map(|k| B[i][k] * point(F[k][j])));
        let left = sum((0..n).map(|k| point(F[k][i]) * B[k][j]));
        B[i][j] = start[i][j].abs().max(measured + right + left);
        B[j][i] = B[i][j];
    }
    upper(&B)
}

/// UᵀDU
fn product(S0: &UnitFactor) -> IntervalMatrix {
    let n = S0.diagonal.len();
    let U = |k: usize, j: usize| match j.cmp(&k) {
        std::cmp::Ordering::Less => Interval::ZERO,
        std::cmp::Ordering::Equal => Interval::ONE,
        std::cmp::Ordering::Greater => Interval::point(S0.upper[k][j - k - 1]),
    };
    square(n, |i, j| {
        sum((0..n).map(|k| U(k, i) * Interval::point(S0.diagonal[k]) * U(k, j)))
    })
}

/// An upper bound of the largest eigenvalue of every S(t).
pub(super) fn largest_eigenvalue(B: &Vec<Vec<f64>>) -> f64 {
    metzler::spectral_radius(B)
}

/// A lower bound of the least eigenvalue of S(t) for t ≥ TAU/θ where F and C are
/// numbers: F is nilpotent, and
///
/// S(t) ≥ ∫₀^τ e^{−s} e^{−Fᵀs} CᵀC e^{−Fs} ds = Σ_ab (−1)^{a+b}/(a! b!) I_{a+b} (CF^a)ᵀCF^b,
///
/// I_m = ∫₀^τ e^{−s} s^m ds = m I_{m−1} − e^{−τ} τ^m.
pub(super) fn below(C: &[Vec<f64>], F: &[Vec<f64>], blocks: usize) -> Option<f64> {
    let n = F.len();
    let τ = Interval::point(TAU);
    let left = (-τ).exp();
    let mut integrals = vec![Interval::ONE - left];
    for m in 1..2 * blocks {
        let before = integrals[m - 1];
        integrals.push(Interval::point(m as f64) * before - left * τ.powi(m as i32));
    }
    // (−1)^a CF^a/a!
    let mut rows: Vec<Vec<Vec<Interval>>> = vec![
        C.iter()
            .map(|row| row.iter().map(|&c| Interval::point(c)).collect())
            .collect(),
    ];
    for a in 1..blocks {
        let step = |row: &Vec<Interval>| -> Vec<Interval> {
            let entry = |j: usize| sum((0..n).map(|k| row[k] * Interval::point(F[k][j])));
            (0..n)
                .map(|j| -entry(j) / Interval::point(a as f64))
                .collect()
        };
        let next = rows[a - 1].iter().map(step).collect();
        rows.push(next);
    }
    let G = square(n, |i, j| {
        let terms = (0..blocks).flat_map(|a| (0..blocks).map(move |b| (a, b)));
        sum(terms.map(|(a, b)| {
            let outer = sum(rows[a].iter().zip(&rows[b]).map(|(x, y)| x[i] * y[j]));
            integrals[a + b] * outer
        }))
    });
    least_eigenvalue(&G, f64::INFINITY)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two integrators: S(∞) = [1, −1; −1, 2], least eigenvalue (3 − √5)/2; a little
    /// less is left after ten time constants. Then two coupled entries of |S|.
    #[test]
    fn two_integrators() {
        let (C, F) = (vec![vec![1.0, 0.0]], vec![vec![0.0, 1.0], vec![0.0, 0.0]]);
        let found = below(&C, &F, 2).unwrap();
        let limit = (3.0 - 5f64.sqrt()) / 2.0;
        assert!(
            found < limit && found > 0.98 * limit,
            "{found} against {limit}"
        );
        let S0 = UnitFactor::new(&[vec![3.0, 0.0], vec![0.0, 1.0]]).unwrap();
        let B = above(&S0, &C, &F, &[0, 1]);
        assert_eq!(B, [[3.0, 3.0], [3.0, 6.0]].map(|r| r.to_vec()));
    }
}
