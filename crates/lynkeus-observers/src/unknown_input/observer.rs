//! Observer (14) from a form, with its matrices for the reader of a design, and
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

use std::collections::HashMap;

use lynkeus_expr::{Expr, MissingInput, Node};
use lynkeus_gain::integrators::Chain;
use lynkeus_structure::{AugmentedPlant, Matrix, Measurement};

use super::form::{Form, along, column};
use super::said::{Said, Shape};
use super::settings::{Settings, no_theta};
use crate::conditions::names;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed, limited};
use crate::printed::{StartPoint, expressions, is_constant};
use crate::theorem::{Enclosure, undeclared};
use crate::{ChainGain, Design, DesignError, ParameterValue};

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form<'_, '_>>,
) -> Result<Design, DesignError> {
    let form = &form;
    let (thetas, note) = match settings.thetas()? {
        Some(given) => (given, None),
        None => {
            let (found, c) = thetas(form)?;
            (found, Some(Said::Thetas(found, c)))
        }
    };
    let copy = PlantCopy::new(augmented, &settings.common);
    let speeds = speeds(&copy, thetas);
    let derivatives = derivatives(form, &copy, settings, &speeds);
    let start = StartPoint::new(&copy)?;
    let matrices = Matrices::new(form, thetas);
    Ok(Design {
        observer: copy.observer(derivatives)?.tuned_by(&speeds),
        gains: matrices.gains(&start)?,
        parameters: matrices.parameters(&start)?,
        notes: note.into_iter().map(Into::into).collect(),
        examination,
    })
}

/// θ₁ and θ₂ of the observer.
fn speeds(copy: &PlantCopy<'_, '_>, [θ1, θ2]: [f64; 2]) -> [Speed; 2] {
    let speed = |place: usize, value: f64, of: &str| {
        let meaning = format!("θ{place}, of {of}");
        Speed::new(copy, format!("theta[{place}]"), value, meaning)
    };
    let first = "the unknown inputs and of the outputs that show them";
    [speed(1, θ1, first), speed(2, θ2, "the other states")]
}

/// The right-hand side of (14), in the order of the augmented states.
fn derivatives(
    form: &Form<'_, '_>,
    copy: &PlantCopy<'_, '_>,
    settings: &Settings,
    [θ1, θ2]: &[Speed; 2],
) -> Vec<Node> {
    let augmented = form.augmented;
    let (graph, n) = (augmented.graph(), augmented.plant_states());
    let v: Vec<Node> = augmented.symbols().split_off(n);
    let v̂ = column(graph, &copy.at_estimate(&v));
    // s: the measured signals in place of the states they show
    let measured: HashMap<Node, Node> = (0..augmented.outputs.len())
        .filter_map(|i| copy.measured_state(i))
        .map(|(state, y)| (augmented.states[state].node, y))
        .collect();
    let factors = &form.layers.factors;
    let at_s = factors.map(|node| graph.substitute(&[node], &measured)[0]);
    let e1 = column(graph, &innovations(copy, &form.first));
    let e2 = column(graph, &innovations(copy, &form.second));
    let drift = copy.at_estimate(&form.layers.drift);
    let input = at_s.times(&v̂);
    let mut total: Vec<Expr<'_>> = (0..n)
        .map(|i| graph.expr(drift[i]) + graph.expr(input.node(i, 0)))
        .collect();

    let twice = |θ: &Speed| θ.scaled(graph, 2.0 * θ.value(), 1.0);
    for (row, &state) in form.x11().iter().enumerate() {
        total[state] = total[state] - twice(θ1) * graph.expr(e1.node(row, 0));
    }
    // D (9) at s; G at s makes left inverses and products at s
    let at_measured = form.with_factors(at_s);
    let D_e1: Vec<Matrix<'_>> = (1..=form.q())
        .map(|k| at_measured.γ_times(k, &e1))
        .collect();
    let Λ2 = at_tilde(&at_measured, copy, settings, &measured, &D_e1);
    let K = Chain::new(form.q()).gain;
    for k in 1..=form.q() {
        let correction = Λ2[k - 1].left_divide(&e2);
        let gain = θ2.value().powi(k as i32) * K[k - 1];
        let gain = θ2.scaled(graph, gain, k as f64);
        for (row, &state) in form.block(k).iter().enumerate() {
            total[state] = total[state]
                - gain * graph.expr(correction.node(row, 0))
                - twice(θ1) * graph.expr(D_e1[k - 1].node(row, 0));
        }
    }
    let v_correction = at_measured.G11().left_divide(&e1);
    let squared = θ1.scaled(graph, -(θ1.value() * θ1.value()), 2.0);
    total.extend((0..v.len()).map(|j| squared * graph.expr(v_correction.node(j, 0))));
    total.into_iter().map(Expr::node).collect()
}

/// x̂ − y for some measured outputs. The form has only outputs that show a state.
fn innovations(copy: &PlantCopy<'_, '_>, outputs: &[usize]) -> Vec<Node> {
    outputs.iter().filter_map(|&i| copy.innovation(i)).collect()
}

/// Λ₂ at x₁¹ = y₁ and X̃² = X̂² − D (x̂₁¹ − y₁).
fn at_tilde<'p>(
    form: &Form<'_, 'p>,
    copy: &PlantCopy<'_, '_>,
    settings: &Settings,
    measured: &HashMap<Node, Node>,
    D_e1: &[Matrix<'_>],
) -> Vec<Matrix<'p>> {
    let augmented = form.augmented;
    let graph = augmented.graph();
    let mut seen = HashMap::new();
    for state in form.x11() {
        let x = augmented.states[state].node;
        seen.insert(x, measured.get(&x).copied().unwrap_or(x));
    }
    for k in 1..=form.q() {
        for (row, &state) in form.block(k).iter().enumerate() {
            let hat = graph.expr(copy.hats[state].symbol);
            let tilde = (hat - graph.expr(D_e1[k - 1].node(row, 0))).node();
            let variable = &augmented.states[state];
            let image = match settings.common.clamp {
                true => limited(graph, tilde, variable),
                false => tilde,
            };
            seen.insert(variable.node, image);
        }
    }
    let blocks = form.Λ2().into_iter();
    blocks
        .map(|block| block.map(|node| graph.substitute(&[node], &seen)[0]))
        .collect()
}

/// What multiplies the innovations.
struct Matrices<'f, 'e, 'p> {
    form: &'f Form<'e, 'p>,
    θ: [f64; 2],
    /// (G₁¹)⁺
    left: Matrix<'p>,
    /// the blocks of D (9)
    D: Vec<Matrix<'p>>,
    /// the blocks of Λ₂ (13)
    Λ2: Vec<Matrix<'p>>,
}

impl<'f, 'e, 'p> Matrices<'f, 'e, 'p> {
    fn new(form: &'f Form<'e, 'p>, θ: [f64; 2]) -> Self {
        let unit = Matrix::identity(form.augmented.graph(), form.first.len());
        Self {
            form,
            θ,
            left: form.G11().left_divide(&unit),
            D: (1..=form.q()).map(|k| form.γ_times(k, &unit)).collect(),
            Λ2: form.Λ2(),
        }
    }

    /// Λ₂⁺, block k from 0.
    fn Λ2_left(&self, k: usize) -> Matrix<'p> {
        let P = &self.Λ2[k];
        P.left_divide(&Matrix::identity(P.graph(), P.rows))
    }

    /// K of x̂' = f(x̂, u) − K(ŷ − y), where (14) is of that form with numbers for K: G, Λ₂
    /// and the slopes of the outputs are numbers.
    fn gains(&self, start: &StartPoint<'_>) -> Result<Vec<ChainGain>, MissingInput> {
        let (form, [θ1, θ2]) = (self.form, self.θ);
        let Some(slopes) = self.slopes() else {
            return Ok(vec![]);
        };
        let numbers = [&form.layers.factors].into_iter().chain(&self.Λ2);
        if !numbers.into_iter().all(is_constant) {
            return Ok(vec![]);
        }
        let C = Chain::new(form.q()).gain;
        let mut K = vec![vec![0.0; form.augmented.outputs.len()]; form.augmented.states.len()];
        let mut add = |states: &[usize], outputs: &[usize], block: Vec<Vec<f64>>, factor: f64| {
            for (&state, row) in states.iter().zip(block) {
                for (&output, entry) in outputs.iter().zip(row) {
                    K[state][output] += factor * entry / slopes[output];
                }
            }
        };
        let one = Matrix::identity(form.augmented.graph(), form.first.len());
        add(&form.x11(), &form.first, start.values(&one)?, 2.0 * θ1);
        let unknown: Vec<usize> =
            (form.augmented.plant_states()..form.augmented.states.len()).collect();
        add(&unknown, &form.first, start.values(&self.left)?, θ1 * θ1);
        for (k, c) in C.iter().take(form.q()).enumerate() {
            let states = form.block(k + 1);
            add(&states, &form.first, start.values(&self.D[k])?, 2.0 * θ1);
            let left = start.values(&self.Λ2_left(k))?;
            add(&states, &form.second, left, θ2.powi(k as i32 + 1) * c);
        }
        let state = |i: usize| form.augmented.states[i].name.clone();
        let output = |j: usize| ChainGain {
            output: form.augmented.outputs[j].variable.name.clone(),
            entries: (0..K.len())
                .filter(|&i| K[i][j] != 0.0)
                .map(|i| (state(i), K[i][j]))
                .collect(),
        };
        Ok((0..slopes.len()).map(output).collect())
    }

    /// The outputs' slopes in the states that they show, where they are numbers.
    fn slopes(&self) -> Option<Vec<f64>> {
        let graph = self.form.augmented.graph();
        let outputs = self.form.augmented.outputs.iter();
        let slope = |output: &Measurement| graph.constant_value(output.state?.1);
        outputs.map(slope).collect()
    }

    /// Everything that (14) multiplies the innovations with.
    fn parameters(
        &self,
        start: &StartPoint<'_>,
    ) -> Result<Vec<(String, ParameterValue)>, MissingInput> {
        let (form, [θ1, θ2]) = (self.form, self.θ);
        let augmented = form.augmented;
        let outputs = form.first.iter();
        let outputs = outputs.map(|&i| augmented.outputs[i].variable.name.clone());
        let outputs: Vec<String> = outputs.collect();
        let mut found: Vec<(String, ParameterValue)> =
            vec![("θ1".into(), θ1.into()), ("θ2".into(), θ2.into())];
        let mut add = |name: &str, value| found.push((name.to_owned(), value));
        add("partition", outputs.into());
        add("x₁¹", names(augmented, &form.x11()).into());
        for k in 1..=form.q() {
            add(&format!("X² {k}"), names(augmented, &form.block(k)).into());
        }
        let gain = |n: usize| ParameterValue::Matrix(vec![Chain::new(n).gain]);
        add("S₁⁻¹C₁ᵀ", gain(2));
        add("S₂⁻¹C₂ᵀ", gain(form.q()));
        add("G₁¹", expressions(&form.G11()));
        add("(G₁¹)⁺ at the start", start.shown(&self.left)?);
        for k in 1..=form.q() {
            let G = form.factors(&form.block(k));
            add(&format!("G² {k}"), expressions(&G));
            add(
                &format!("D at the start, {k}"),
                start.shown(&self.D[k - 1])?,
            );
        }
        for k in 2..=form.q() {
            add(&format!("Λ₂ {k}"), expressions(&self.Λ2[k - 1]));
            let left = self.Λ2_left(k - 1);
            add(&format!("Λ₂⁺ at the start, {k}"), start.shown(&left)?);
        }
        Ok(found)
    }
}

/// θ₁ exceeds its bound by this factor.
const MARGIN: f64 = 1.1;

/// Larger gains are not chosen: no integrator follows them.
const LARGEST: f64 = 1e6;

/// The smallest θ₁ that the inequality allows, with θ₂ = max(1, 2c₄), which makes it so; with
/// c₁, c₂, c₄ and c₅.
pub(super) fn thetas(form: &Form<'_, '_>) -> Result<([f64; 2], [f64; 4]), DesignError> {
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
    Ok(([θ1, θ2], [c1, c2, c4, c5]))
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
    let unit = |n: usize| Matrix::identity(form.augmented.graph(), n);
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
    let augmented = form.augmented;
    let graph = augmented.graph();
    let used = graph.symbols_of(&A.nonzero());
    if let Some(input) = augmented.inputs.iter().find(|i| used.contains(&i.node)) {
        let reason = format!("it needs the derivative of the input {}", input.name);
        return Err(missing(&reason));
    }
    let states = augmented.symbols().into_iter();
    let mut moving: Vec<(Node, Node)> = states.zip(augmented.derivatives.clone()).collect();
    moving.push((augmented.plant.time, graph.constant(1.0).node()));
    Ok(along(A, &moving))
}

/// An upper bound over the box of the Frobenius norm, hence of the spectral norm.
fn norm(form: &Form<'_, '_>, A: &Matrix<'_>) -> Result<f64, DesignError> {
    let region = form.augmented.region();
    let box_ = Enclosure::new(form.augmented, &region);
    let mut sum = 0.0;
    for node in A.nonzero() {
        let bound = box_.magnitude(node)?;
        if !bound.is_finite() {
            let open = undeclared(form.augmented, &[node], &region);
            let hint = match open.is_empty() {
                true => String::new(),
                false => format!("; declare min and max of {}", open.join(", ")),
            };
            let shown = A.graph().render(node, 60);
            return Err(missing(&format!("{shown} is not bounded on the box{hint}")));
        }
        sum += bound * bound;
    }
    Ok(sum.sqrt())
}
