//! θ₁ and θ₂ from the inequality at the end of the proof of Theorem 1.
//!
//! With e¹ = (x̂₁¹ − x₁¹, G₁¹(v̂ − v)), η = X̃² − X² and ζ_k = P_k η_k, P_k the block k of
//! Λ₂, the error of (14), linearised along the trajectory, obeys
//!
//! ε₁' = −2θ₁ε₁ + e¹₂ + N₀ ε₁ + N₁ ζ₁ + N₂ ζ₂
//! e¹₂' = −θ₁² Π ε₁ + Ġ₁¹(G₁¹)⁺ e¹₂ − G₁¹ v'
//! ζ_k' = ζ_{k+1} − θ₂^k C^k_q (ζ₁ + γ₁ε₁) + Σ_{j≤k} T_kj ζ_j + P_k M_k ε₁
//!
//! (G^k v̂ drops out of η since G^k = γ_k G₁¹; Π projects on the range of G₁¹, which
//! only helps). Scaled by Δ₁ and Δ₂ and measured with S₁ and S₂ this is (24) with
//!
//! c₁ = 2√κ(S₁) max(‖N₀‖, ‖Ġ₁¹(G₁¹)⁺‖)
//! c₂ = 2(√(S₂⁻¹)₁₁ ‖N₁‖ + √(S₂⁻¹)₂₂ ‖N₂‖)     times θ₂, not θ₂^{q−1}: f̃₁¹ reads x² at most
//! c₄ = 2√κ(S₂) ‖T‖
//! c₅ = 2√2(√λ_max(S₂) ‖(P_k M_k)_k‖ + √(S₂⁻¹)₁₁ ‖γ₁‖)
//!
//! for θ₂ ≥ 1, each norm bounded by the enclosures of its entries over the box. The
//! blocks of Λ₂ have to be square: else the correction is Π_k ζ₁, and the step to (24)
//! does not hold as printed.

use lynkeus_expr::{Node, jacobian};
use lynkeus_gain::integrators::Chain;
use lynkeus_structure::{Matrix, Region};

use super::blocks::Shape;
use super::form::Form;
use super::settings::{Thetas, no_theta};
use crate::DesignError;
use crate::enclosure::Enclosure;

/// θ₁ exceeds its bound by this factor.
const MARGIN: f64 = 1.1;
/// Larger gains are not chosen: no integrator follows them.
const LARGEST: f64 = 1e6;

/// θ₁ and θ₂ with what is to be said about them.
pub(super) struct Choice {
    pub thetas: Thetas,
    pub notes: Vec<String>,
}

impl Choice {
    pub fn given(thetas: Thetas) -> Self {
        let notes = vec![];
        Self { thetas, notes }
    }
}

/// The smallest θ₁ that the inequality allows, with θ₂ = max(1, 2c₄), which makes it so.
pub(super) fn thetas(form: &Form<'_, '_>) -> Result<Choice, DesignError> {
    let q = form.q();
    if form.shape() != Shape::Square {
        return Err(missing(
            "Λ₂ has blocks that are not square, which the proof's inequality does not cover",
        ));
    }
    let [c1, c2, c4, c5] = constants(form)?;
    let c = c2 + c5;
    let θ2 = (2.0 * c4).max(1.0);
    let θ1 = MARGIN
        * θ2
            .powi(q as i32 - 1)
            .max(θ2 - c4 + c1)
            .max(c1 + c * c * θ2 * θ2 / (θ2 - c4));
    if !θ1.is_finite() || θ1 > LARGEST {
        let reason = format!(
            "the inequality of the proof of Theorem 1 gives [{θ1:.1e}, {θ2:.1e}] on the declared box, far more than needed and than any integrator follows; start with small ones, θ1 > θ2"
        );
        return Err(no_theta(&reason).into());
    }
    let note = format!(
        "theta: [{θ1:.4e}, {θ2:.4e}] from the inequality at the end of the proof of Theorem 1 with c1 = {c1:.3e}, c2 = {c2:.3e}, c4 = {c4:.3e}, c5 = {c5:.3e}, bounds on the declared box of the error linearised along the trajectory; sufficient, by far not necessary: give theta to amplify noise less"
    );
    Ok(Choice {
        thetas: Thetas { θ1, θ2 },
        notes: vec![note],
    })
}

fn missing(reason: &str) -> DesignError {
    let reason = format!("no bound could be computed from the proof of Theorem 1: {reason}");
    no_theta(&reason).into()
}

/// c₁, c₂, c₄, c₅
fn constants(form: &Form<'_, '_>) -> Result<[f64; 4], DesignError> {
    let q = form.q();
    let (S1, S2) = (Chain::new(2), Chain::new(q));
    let κ = |S: &Chain| (S.largest / S.smallest).sqrt();
    let (first, own) = (form.x11(), form.block(1));
    let unit = |n: usize| Matrix::identity(form.extended.graph(), n);
    let γ: Vec<Matrix<'_>> = (1..=q)
        .map(|k| form.γ_times(k, &unit(first.len())))
        .collect();
    let P = form.Λ2();
    let inverse: Vec<Matrix<'_>> = P.iter().map(|P| P.left_divide(&unit(P.rows))).collect();

    let N1 = form.jacobian(&first, &own);
    let mut N0 = form.jacobian(&first, &first).plus(&N1.times(&γ[0]));
    let mut c2 = S2.inverse_diagonal[0].sqrt() * norm(form, &N1)?;
    if q > 1 {
        let A = form.jacobian(&first, &form.block(2));
        N0 = N0.plus(&A.times(&γ[1]));
        c2 += S2.inverse_diagonal[1].sqrt() * norm(form, &A.times(&inverse[1]))?;
    }
    let turning = rate(form, &form.G11())?.times(&form.G11().left_divide(&unit(first.len())));
    let c1 = 2.0 * κ(&S1) * norm(form, &N0)?.max(norm(form, &turning)?);

    let (mut T, mut M) = (0.0, 0.0);
    for k in 1..=q {
        let mut through = J(form, k, &first).minus(&rate(form, &γ[k - 1])?);
        for j in 1..=(k + 1).min(q) {
            let J = J(form, k, &form.block(j));
            through = through.plus(&J.times(&γ[j - 1]));
            if j > k {
                continue;
            }
            let mut block = P[k - 1].times(&J).times(&inverse[j - 1]);
            if j == k {
                block = block.plus(&rate(form, &P[k - 1])?.times(&inverse[k - 1]));
            }
            T += norm(form, &block)?.powi(2);
        }
        M += norm(form, &P[k - 1].times(&through))?.powi(2);
    }
    let c4 = 2.0 * κ(&S2) * T.sqrt();
    let skew = S2.inverse_diagonal[0].sqrt() * norm(form, &γ[0])?;
    let c5 = 8f64.sqrt() * (S2.largest.sqrt() * M.sqrt() + skew);
    Ok([c1, 2.0 * c2, c4, c5])
}

/// ∂f̄_k²/∂x = ∂f̃^k/∂x − γ_k ∂f̃₁¹/∂x
fn J<'p>(form: &Form<'_, 'p>, k: usize, x: &[usize]) -> Matrix<'p> {
    let first = form.jacobian(&form.x11(), x);
    form.jacobian(&form.block(k), x)
        .minus(&form.γ_times(k, &first))
}

/// The derivative of each entry along the solutions of the plant.
fn rate<'p>(form: &Form<'_, 'p>, A: &Matrix<'p>) -> Result<Matrix<'p>, DesignError> {
    let extended = form.extended;
    let graph = extended.graph();
    let used = graph.symbols_of(&A.nonzero());
    if let Some(input) = extended.inputs.iter().find(|i| used.contains(&i.node)) {
        let reason = format!("it needs the derivative of the input {}", input.name);
        return Err(missing(&reason));
    }
    let one = graph.constant(1.0).node();
    let x = [&extended.symbols()[..], &[extended.plant.time]].concat();
    let slopes = [&extended.derivatives[..], &[one]].concat();
    let along = |node: Node| {
        let gradient = jacobian::forward(graph, &[node], &x);
        let terms = gradient
            .row(0)
            .map(|(i, d)| graph.expr(d) * graph.expr(slopes[i]));
        terms
            .reduce(|a, b| a + b)
            .unwrap_or_else(|| graph.constant(0.0))
            .node()
    };
    Ok(A.map(along))
}

/// An upper bound over the box of the Frobenius norm, hence of the spectral norm.
fn norm(form: &Form<'_, '_>, A: &Matrix<'_>) -> Result<f64, DesignError> {
    let region = form.extended.region();
    let box_ = Enclosure::new(form.extended.graph(), &region);
    let mut sum = 0.0;
    for node in A.nonzero() {
        let bound = box_.magnitude(node)?;
        if !bound.is_finite() {
            return Err(unbounded(form, node, &region));
        }
        sum += bound * bound;
    }
    Ok(sum.sqrt())
}

fn unbounded(form: &Form<'_, '_>, node: Node, region: &Region) -> DesignError {
    let graph = form.extended.graph();
    let used = region.restricted(&graph.symbols_of(&[node])).dimensions;
    let open: Vec<String> = used
        .into_iter()
        .filter(|d| d.symbol != form.extended.plant.time)
        .filter(|d| !(d.min.is_finite() && d.max.is_finite()))
        .map(|d| d.name)
        .collect();
    let hint = match open.is_empty() {
        true => String::new(),
        false => format!("; declare min and max of {}", open.join(", ")),
    };
    missing(&format!(
        "{} is not bounded on the box{hint}",
        graph.render(node, 60)
    ))
}
