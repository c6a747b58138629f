//! From norms over the box to the constants of (24).

use lynkeus_gain::integrators::Chain;

use crate::Check;
use crate::enclosure::{length, norm, product, times, up};

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
            up(times(w[k], terms.sum()))
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
        let (S2, root) = (Chain::new(q), f64::sqrt);
        let at = |i: usize| root(S2.inverse_diagonal[i]);
        // |e₁| ≤ √2 √V₁, |e¹₂| ≤ θ₁ √V₁; √(1, 0)S₁(1, 0)ᵀ = 1, √(0, 1)S₁(0, 1)ᵀ = √2
        let c1 = up(8f64.sqrt() * (self.N0 + self.turning));
        let N = [self.N.to_vec()];
        let through = product(&N, &self.W[..q.min(2)]);
        let sum: f64 = (0..q.min(2)).map(|i| times(through[0][i], at(i))).sum();
        let c2 = up(2.0 * sum);

        let mut B = product(&self.Ψ, &self.W);
        let back: Vec<f64> = (0..q).map(|k| self.back(&S2, k)).collect();
        for (row, back) in B.iter_mut().zip(&back) {
            row[0] += back;
        }
        let weighted = |k: usize| {
            let terms = (0..q).map(|i| times(B[k][i], at(i)));
            root(S2.diagonal[k]) * terms.sum::<f64>()
        };
        let weighted: f64 = (0..q).map(weighted).sum();
        let κ = up(root(S2.largest / S2.smallest));
        let c4 = up(2.0 * weighted.min(κ * norm(&B)));

        let γ1 = self.γ[0];
        let pushed = product(
            &self.Z,
            &self.Y.iter().map(|&y| vec![y]).collect::<Vec<_>>(),
        );
        let p: Vec<f64> = (0..q).map(|k| pushed[k][0] + times(back[k], γ1)).collect();
        let c5 = up(8f64.sqrt() * (in_S(&S2, &p) + times(self.push(&S2), γ1)));
        Constants { c1, c2, c4, c5 }
    }

    /// √V₂ for Δ₂ times the correction of an innovation of length one, divided by θ₂: √(CS₂⁻¹Cᵀ) = √q, and q
    /// for what a left inverse leaves out, of which V₂ sees the first layer alone.
    pub fn push(&self, S2: &Chain) -> f64 {
        let q = S2.gain.len() as f64;
        if self.tall { q } else { q.sqrt().next_up() }
    }

    /// Σ_{j<k} ‖∂Z_k/∂x^j P_j⁻¹‖ C^j_q: what Λ₂ leaves of the correction beside the
    /// constant gain.
    pub fn back(&self, S2: &Chain, k: usize) -> f64 {
        let terms = (0..k).map(|j| times(self.Z[k][j], self.P_inverse[j]) * S2.gain[j]);
        up(terms.sum())
    }
}

/// A bound of √(pᵀSp) for entries up to p.
pub(super) fn in_S(S: &Chain, p: &[f64]) -> f64 {
    let weighted: f64 = p.iter().zip(&S.diagonal).map(|(p, s)| p * s.sqrt()).sum();
    up(weighted).min(up(S.largest.sqrt() * length(p) * (1.0 + 1e-9)))
}
