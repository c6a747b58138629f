//! From norms over the box to the constants of (24).

use crate::Check;
use lynkeus_expr::Interval;
use lynkeus_gain::integrators::Chain;
use lynkeus_proof::magnitude::{length, norm, plus, product, size, times, total};
use lynkeus_proof::matrix::sum;

/// Norms over the box of the matrices above.
pub(super) struct Norms {
    /// N₀
    pub N0: f64,
    /// N₁ and N₂
    pub N: [f64; 2],
    /// Ġ₁¹(G₁¹)⁺
    pub turning: f64,
    /// G₁¹ and its left inverse
    pub G11: f64,
    pub left: f64,
    /// γ_k
    pub γ: Vec<f64>,
    /// ∂Z_k/∂x^j for j ≤ k
    pub Z: Vec<Vec<f64>>,
    /// |η_j| ≤ Σ_i W_ji |e²_i|
    pub W: Vec<Vec<f64>>,
    /// Ψ_kj
    pub Ψ: Vec<Vec<f64>>,
    /// Y_k
    pub Y: Vec<f64>,
    /// 1/P_k at points and for means
    pub P_inverse: Vec<f64>,
    /// whether x₂¹ has more outputs than each layer behind it states
    pub tall: bool,
    /// whether the proof covers the shape of the blocks of Λ₂
    pub blocks: Check,
    /// whether Λ₂ is regular with the signals apart from the states they show
    pub regular: Check,
    /// whether what the proof differentiates has values and does not jump
    pub continuous: Check,
    /// what has no bound on the box
    pub open: Vec<String>,
}

/// c₁, c₂, c₄ and c₅ of (24).
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Constants {
    pub c1: f64,
    pub c2: f64,
    pub c4: f64,
    pub c5: f64,
}

/// W from |η_k| ≤ w_k (|e²_k| + Σ_{j<k} Z_kj |η_j|).
pub(super) fn inverse_triangle(Z: &[Vec<f64>], w: &[f64]) -> Vec<Vec<f64>> {
    let q = w.len();
    let mut W = vec![vec![0.0; q]; q];
    for k in 0..q {
        W[k][k] = w[k];
        let through = |i: usize| {
            let terms = (i..k).map(|j| times(Z[k][j], W[j][i]));
            times(w[k], total(terms))
        };
        let row: Vec<f64> = (0..k).map(through).collect();
        W[k][..k].copy_from_slice(&row);
    }
    W
}

impl Norms {
    /// c₁, c₂, c₄ and c₅ for every θ₂ ≥ 1.
    pub fn constants(&self) -> Constants {
        let q = self.W.len();
        let S2 = Chain::new(q);
        let (two, root8) = (Interval::point(2.0), Interval::point(8.0).sqrt());
        let at = |i: usize| Interval::point(S2.inverse_diagonal[i]).sqrt();
        // |e₁| ≤ √2 √V₁, |e¹₂| ≤ θ₁ √V₁; √(1, 0)S₁(1, 0)ᵀ = 1, √(0, 1)S₁(0, 1)ᵀ = √2
        let c1 = root8 * (size(self.N0) + size(self.turning));
        let N = [self.N.to_vec()];
        let through = product(&N, &self.W[..q.min(2)]);
        let c2 = two * sum((0..q.min(2)).map(|i| size(through[0][i]) * at(i)));

        let mut B = product(&self.Ψ, &self.W);
        let back: Vec<f64> = (0..q).map(|k| self.back(&S2, k)).collect();
        for (row, &back) in B.iter_mut().zip(&back) {
            row[0] = plus(row[0], back);
        }
        let weighted = |k: usize| {
            let terms = sum((0..q).map(|i| size(B[k][i]) * at(i)));
            Interval::point(S2.diagonal[k]).sqrt() * terms
        };
        let κ = (Interval::point(S2.largest) / Interval::point(S2.smallest)).sqrt();
        let c4 = two * sum((0..q).map(weighted)).min(κ * size(norm(&B)));

        let γ1 = self.γ[0];
        let Y: Vec<Vec<f64>> = self.Y.iter().map(|&y| vec![y]).collect();
        let pushed = product(&self.Z, &Y);
        let p = (0..q).map(|k| plus(pushed[k][0], times(back[k], γ1)));
        let p = in_S(&S2, &p.collect::<Vec<_>>());
        let c5 = root8 * size(plus(p, times(self.push(&S2), γ1)));
        let [c1, c2, c4, c5] = [c1, c2, c4, c5].map(|c| c.hi());
        Constants { c1, c2, c4, c5 }
    }

    /// √V₂ for Δ₂ times the correction of an innovation of length one, divided by θ₂: √(CS₂⁻¹Cᵀ) = √q, and q
    /// for what a left inverse leaves out, of which V₂ sees the first layer alone.
    pub fn push(&self, S2: &Chain) -> f64 {
        let q = Interval::point(S2.gain.len() as f64);
        if self.tall { q.hi() } else { q.sqrt().hi() }
    }

    /// Σ_{j<k} ‖∂Z_k/∂x^j P_j⁻¹‖ C^j_q: what Λ₂ leaves of the correction beside the
    /// constant gain.
    pub fn back(&self, S2: &Chain, k: usize) -> f64 {
        let terms = (0..k).map(|j| times(times(self.Z[k][j], self.P_inverse[j]), S2.gain[j]));
        total(terms)
    }
}

/// A bound of √(pᵀSp) for entries up to p.
pub(super) fn in_S(S: &Chain, p: &[f64]) -> f64 {
    let diagonal = S.diagonal.iter().map(|&s| Interval::point(s).sqrt());
    let weighted = sum(p.iter().zip(diagonal).map(|(&p, s)| size(p) * s));
    let whole = Interval::point(S.largest).sqrt() * size(length(p));
    weighted.min(whole).hi()
}
