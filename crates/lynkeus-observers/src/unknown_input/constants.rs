//! The constants of the proof of Theorem 1, for errors of any size inside the box.
//!
//! With e¹ = (e₁, G₁¹(v̂ − v)), e₁ = x̂₁¹ − x₁¹, the point X̃² = X̂² − D e₁ moves like
//! X̃²' = f̄(x̂) + D x₁¹' − Ḋ e₁ − gain, free of v̂; so does X² with f̄(x), f̄_k = f̃^k − γ_k f̃₁¹.
//! In the coordinates Z₁ = x₂¹, Z_k = P_{k−1} f̄_{k−1}, P_k the block k of Λ₂, where
//! ∂Z_k/∂x^k = P_k and the signals s, x₁¹, t and their slopes are the same for both,
//! e²_k = Z_k(X̃²) − Z_k(X²) obeys
//!
//! e₁'   = −2θ₁e₁ + e¹₂ + N₀e₁ + Σ_j N_j η_j,                        η = X̃² − X²
//! e¹₂'  = −θ₁² Π e₁ + Ġ₁¹(G₁¹)⁺ e¹₂ − G₁¹ v'
//! e²_k' = e²_{k+1} + Σ_{j≤k} Ψ_kj η_j + Σ_{j≤k} ∂Z_k/∂x^j Y_j e₁
//!         − Σ_{j≤k} ∂Z_k/∂x^j P_j⁻¹ θ₂^j C^j_q (e²_1 + γ₁e₁)
//!
//! by the mean value theorem, each matrix a mean over a line inside the box. As
//! η_k = P̄_k⁻¹ (e²_k − Σ_{j<k} ∂Z_k/∂x^j η_j), bounds of the entries bound everything.
//! Π projects on the range of G₁¹; it only adds −2θ₁|e₁ − Πe₁|² to V̇₁.
//! The norms over the box give the constants of (24).

use std::collections::HashMap;

use lynkeus_expr::{Interval, MissingInput, Node};
use lynkeus_gain::integrators::Chain;
use lynkeus_proof::magnitude::{length, norm, plus, product, size, times, total};
use lynkeus_proof::matrix::sum;
use lynkeus_structure::{AugmentedPlant, Matrix, rank, regularity, sign};

use super::form::{Form, along, column, covered};
use super::said::{Said, Shape};
use crate::statement::{proved, undecided};
use crate::theorem::Enclosure;
use crate::{Assumptions, Check, DesignError, Farza, Statement};

/// The form at the signals that the observer knows, and how these move.
struct Signals<'e, 'p> {
    form: Form<'e, 'p>,
    /// (signal, slope)
    slopes: Vec<(Node, Node)>,
    box_: Enclosure<'p>,
}

pub(super) fn norms<'p>(
    form: &Form<'_, 'p>,
    assumptions: &Assumptions,
) -> Result<Norms, DesignError> {
    let signals = Signals::new(form, assumptions)?;
    let (form, box_) = (&signals.form, &signals.box_);
    let q = form.q();
    let (first, own) = (form.x11(), form.block(1));
    let one = |n: usize| Matrix::identity(form.augmented.graph(), n);
    let γ: Vec<Matrix<'_>> = (1..=q)
        .map(|k| form.γ_times(k, &one(first.len())))
        .collect();
    let left = form.G11().left_divide(&one(first.len()));

    let N1 = form.jacobian(&first, &own);
    let mut N0 = form.jacobian(&first, &first).plus(&N1.times(&γ[0]));
    let mut N = [box_.norm(&N1)?, 0.0];
    if q > 1 {
        let N2 = form.jacobian(&first, &form.block(2));
        N0 = N0.plus(&N2.times(&γ[1]));
        N[1] = box_.norm(&N2)?;
    }
    let P = form.Λ2();
    let tall = form.shape() == Shape::Tall;
    let each = |matrices: &[Matrix<'_>]| -> Result<Vec<f64>, MissingInput> {
        matrices.iter().map(|A| box_.norm(A)).collect()
    };
    let straight = tall && !form.bends();
    let P_inverse: Vec<f64> = match straight {
        true => {
            let inverse = P.iter().map(|P| P.left_divide(&one(P.rows)));
            each(&inverse.collect::<Vec<_>>())?
        }
        false => {
            let inverse = P.iter().map(|P| box_.inverse_norm(P));
            inverse.collect::<Result<_, _>>()?
        }
    };
    // where they are unbounded, so is every constant that has Ψ, ∂Z/∂x or Y in it
    let bounded = P_inverse.iter().all(|inverse| inverse.is_finite());
    let (Ψ, Z) = match (bounded, straight) {
        (false, _) => (unbounded(q), unbounded(q)),
        // ζ_k = P_k η_k where P does not read X²: ∂ζ_k/∂x^k = P_k alone
        (true, true) => {
            let own = |k: usize, j: usize| (j == k).then(|| P[k].clone());
            let ψ = |k: usize, j: usize| Some(signals.straight_remainder(&P[k], k, j));
            (signals.lower(ψ)?, signals.lower(own)?)
        }
        (true, false) => {
            let Z = signals.coordinates(&P);
            let ψ = signals.remainders(&P, &Z, &γ);
            let slopes = |A: &[Matrix<'p>], k: usize, j: usize| signals.slopes_in(&A[k], j + 1);
            (
                signals.lower(|k, j| Some(slopes(&ψ, k, j)))?,
                signals.lower(|k, j| Some(slopes(&Z, k, j)))?,
            )
        }
    };
    let Y = match bounded {
        true => each(&(1..=q).map(|k| signals.Y(k, &γ)).collect::<Vec<_>>())?,
        false => vec![f64::INFINITY; q],
    };
    let turning = along(&form.G11(), &signals.slopes).times(&left);
    Ok(Norms {
        N0: box_.norm(&N0)?,
        N,
        turning: box_.norm(&turning)?,
        G11: box_.norm(&form.G11())?,
        left: box_.norm(&left)?,
        γ: each(&γ)?,
        W: inverse_triangle(&Z, &P_inverse),
        Z,
        Ψ,
        Y,
        P_inverse,
        tall,
        checks: [
            covered(form, box_.region())?,
            signals.regular(&P)?,
            signals.continuous(&P)?,
        ],
        open: box_.open(),
    })
}

/// Norms of matrices k, j of which none is bounded.
fn unbounded(q: usize) -> Vec<Vec<f64>> {
    vec![vec![f64::INFINITY; q]; q]
}

impl<'e, 'p> Signals<'e, 'p> {
    /// A symbol for each measured signal that G reads, apart from the state that it
    /// shows: a mean over states does not move the signal.
    fn new(form: &Form<'e, 'p>, assumptions: &Assumptions) -> Result<Self, MissingInput> {
        let augmented: &'e AugmentedPlant<'p> = form.augmented;
        let graph = augmented.graph();
        let mut box_ = Enclosure::new(augmented, &assumptions.region);
        let mut slopes = vec![(augmented.plant.time, graph.constant(1.0).node())];
        let mut measured = HashMap::new();
        for &state in &form.layers.layers[0] {
            let variable = &augmented.states[state];
            // white noise has no bound: then G and Λ₂, which follow the signal, turn at no bounded speed
            let drift = match assumptions.process_noise.get(state) {
                Some(density) if *density > 0.0 => f64::INFINITY,
                _ => assumptions.drift.get(state).copied().unwrap_or(0.0),
            };
            let slope = slope(augmented, state, drift, &mut box_)?;
            let label = format!("{} as measured", variable.name);
            let symbol = graph.fresh(&label).node();
            let (min, max) = box_.side(variable.node);
            box_.add(label, symbol, min, max);
            measured.insert(variable.node, symbol);
            slopes.push((symbol, slope));
            // x₁¹ is a signal wherever it stands
            if form.x11().contains(&state) {
                slopes.push((variable.node, slope));
            }
        }
        // (H3): inputs whose derivative the study bounds
        for (j, input) in augmented.inputs.iter().enumerate() {
            let name = format!("the derivative of {}", input.name);
            let slope = box_.within(name, assumptions.input_derivative(j, 1));
            slopes.push((input.node, slope));
        }
        let factors = &form.layers.factors;
        let factors = factors.map(|node| graph.substitute(&[node], &measured)[0]);
        let form = form.with_factors(factors);
        Ok(Self { form, slopes, box_ })
    }

    /// f̄_k
    fn reduced(&self, k: usize) -> Matrix<'p> {
        let form = &self.form;
        let graph = form.augmented.graph();
        let first = column(graph, &form.drift(&form.x11()));
        column(graph, &form.drift(&form.block(k))).minus(&form.γ_times(k, &first))
    }

    /// Z₁, …, Z_q
    fn coordinates(&self, P: &[Matrix<'p>]) -> Vec<Matrix<'p>> {
        let graph = self.form.augmented.graph();
        let first = column(graph, &self.form.symbols(&self.form.block(1)));
        let further = (1..self.form.q()).map(|k| P[k - 1].times(&self.reduced(k)));
        std::iter::once(first).chain(further).collect()
    }

    /// ∂(column)/∂x^j
    fn slopes_in(&self, column: &Matrix<'p>, j: usize) -> Matrix<'p> {
        let x = self.form.symbols(&self.form.block(j));
        Matrix::jacobian(column.graph(), &column.dense(), &x)
    }

    /// Norms of matrices k, j for j ≤ k, 0 where there is none.
    fn lower(
        &self,
        entry: impl Fn(usize, usize) -> Option<Matrix<'p>>,
    ) -> Result<Vec<Vec<f64>>, MissingInput> {
        let one = |k: usize, j: usize| match (j <= k).then(|| entry(k, j)).flatten() {
            Some(A) => self.box_.norm(&A),
            None => Ok(0.0),
        };
        let q = self.form.q();
        let row = |k| (0..q).map(|j| one(k, j)).collect();
        (0..q).map(row).collect()
    }

    /// Ψ_kj = P_k ∂f̄_k/∂x^j, with P_k' where j = k; k and j from 0.
    fn straight_remainder(&self, P: &Matrix<'p>, k: usize, j: usize) -> Matrix<'p> {
        let block = P.times(&self.slopes_in(&self.reduced(k + 1), j + 1));
        match j == k {
            true => block.plus(&along(P, &self.slopes)),
            false => block,
        }
    }

    /// The proof follows G₁¹, Λ₂ and the coordinates Z along the plant: as states, signals,
    /// inputs and time move. A jump would be missing in each of their derivatives.
    fn continuous(&self, P: &[Matrix<'p>]) -> Result<Check, MissingInput> {
        let Z = self.coordinates(P);
        let G11 = self.form.G11();
        let all = P.iter().chain(&Z).chain([&G11]);
        let nodes: Vec<Node> = all.flat_map(Matrix::nonzero).collect();
        let region = self.box_.region();
        let graph = self.form.augmented.graph();
        let found = regularity(graph, &nodes, &region.symbols(), region)?;
        Ok(Statement::from(Farza::Continuous).with(found))
    }

    /// (11) asks for Λ₂ at one x; the proof needs it where x̃ has left the measured
    /// signals. That it is singular there refutes the proof, not the observer.
    fn regular(&self, P: &[Matrix<'p>]) -> Result<Check, DesignError> {
        let graph = self.form.augmented.graph();
        for (k, P) in P.iter().enumerate().skip(1) {
            let region = self.box_.region();
            let found = match P.rows == P.columns {
                true => {
                    let det = P.determinant();
                    let det = det.unwrap_or_else(|| graph.constant(0.0).node());
                    sign::keeps_sign(graph, det, region)?.finding
                }
                false => rank::full_column_rank(P, region)?,
            };
            if !found.is_proved() {
                return Ok(undecided(Farza::Regular, Said::Block(k + 1, found)));
            }
        }
        Ok(proved(Farza::Regular, Said::FullColumnRank))
    }

    /// ψ_k = Z_k' − Z_{k+1}, where X² moves by f̄ + D x₁¹' and the signals by their slopes.
    fn remainders(&self, P: &[Matrix<'p>], Z: &[Matrix<'p>], γ: &[Matrix<'p>]) -> Vec<Matrix<'p>> {
        let q = self.form.q();
        let slope = |state: usize| {
            let x = self.form.augmented.states[state].node;
            let found = self.slopes.iter().find(|s| s.0 == x);
            found.map_or(x, |s| s.1)
        };
        let first: Vec<Node> = self.form.x11().into_iter().map(slope).collect();
        let first = column(self.form.augmented.graph(), &first);
        let moved = |j: usize| self.reduced(j).plus(&γ[j - 1].times(&first));
        let one = |k: usize| {
            let mut sum = along(&Z[k - 1], &self.slopes);
            for j in 1..k {
                sum = sum.plus(&self.slopes_in(&Z[k - 1], j).times(&moved(j)));
            }
            let last = match k == q {
                true => moved(k),
                false => γ[k - 1].times(&first),
            };
            sum.plus(&P[k - 1].times(&last))
        };
        (1..=q).map(one).collect()
    }

    /// Y_k = ∂f̄_k/∂x₁¹ + Σ_j ∂f̄_k/∂x^j γ_j − γ_k': what e₁ does to X̃².
    fn Y(&self, k: usize, γ: &[Matrix<'p>]) -> Matrix<'p> {
        let reduced = self.reduced(k);
        let x = self.form.symbols(&self.form.x11());
        let direct = Matrix::jacobian(reduced.graph(), &reduced.dense(), &x);
        let mut sum = direct.minus(&along(&γ[k - 1], &self.slopes));
        for j in 1..=(k + 1).min(self.form.q()) {
            sum = sum.plus(&self.slopes_in(&reduced, j).times(&γ[j - 1]));
        }
        sum
    }
}

/// A symbol with the range of x', drift included.
fn slope(
    augmented: &AugmentedPlant<'_>,
    state: usize,
    drift: f64,
    box_: &mut Enclosure<'_>,
) -> Result<Node, MissingInput> {
    let name = &augmented.states[state].name;
    // what is open here must not be mixed up with what was before
    let inside = Enclosure::new(augmented, box_.region());
    let (low, high) = inside.range(augmented.derivatives[state])?;
    let open = inside.open();
    let label = match open.is_empty() {
        true => format!("the slope of {name}"),
        false => open.join(", "),
    };
    let symbol = augmented.graph().fresh(format!("slope of {name}")).node();
    box_.add(label, symbol, low - drift, high + drift);
    Ok(symbol)
}

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
    /// that the proof covers the shape of the blocks of Λ₂, that Λ₂ is regular with the signals
    /// apart from the states they show, that what is differentiated has values and does not jump
    pub checks: [Check; 3],
    /// what has no bound on the box
    pub open: Vec<String>,
}

/// W from |η_k| ≤ w_k (|e²_k| + Σ_{j<k} Z_kj |η_j|).
fn inverse_triangle(Z: &[Vec<f64>], w: &[f64]) -> Vec<Vec<f64>> {
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
    pub fn constants(&self) -> [f64; 4] {
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
        [c1, c2, c4, c5].map(|c| c.hi())
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
