//! Observer (7)–(8), with the Lyapunov ODE (8) in the factors of S. Its gain
//! θ Δ_θ⁻¹ S⁻¹(t) Cᵀ(u) is no constant, so the reader sees its value at the start.
//!
//! S' = −θ (S + FᵀS + SF − CᵀC) with S = UᵀDU, U unit upper triangular and
//! D = diag(d_1, …, d_n), states in the order of the blocks.
//!
//! *Derivation.* Let R = D^½U, so that S = RᵀR, and M = R'R⁻¹, upper triangular.
//! Multiplying (8) by R⁻ᵀ from the left and R⁻¹ from the right,
//!
//! Mᵀ + M = −θ (I + Gᵀ + G − wwᵀ),  G = RFR⁻¹,  w = R⁻ᵀCᵀ = D^−½v,  v = U⁻ᵀCᵀ.
//!
//! F has its entries above the blocks of the diagonal, so G is strictly upper
//! triangular like F, and the upper triangular M with this symmetric part is
//! M = θ (−½I − G + ½diag(wwᵀ) + up(wwᵀ)), up(·) being what is above the diagonal.
//! By R = D^½U also M = ½D'D⁻¹ + D^½U'U⁻¹D^−½. Diagonal and rest give
//!
//! d_i' = θ (‖v_i‖² − d_i),  U' = θ (−UF + up(D⁻¹vvᵀ) U),
//!
//! v_i being row i of v, one entry per output. v solves the unit triangular
//! Uᵀv = Cᵀ: no division, no inverse. The observer integrates δ_i = ln d_i:
//!
//! δ_i' = θ ((‖v_i‖² + d_least) e^{−δ_i} − 1).
//!
//! *S stays symmetric positive definite* because whatever real numbers stand in
//! U and δ, ξᵀSξ = ‖D^½Uξ‖² with D > 0 and U invertible: no error of an
//! integrator, however large its step, can take it away.
//!
//! d_least = 1e-100 is not in (8). Where nothing excites a direction (8) lets d_i
//! decay like e^{−θt} for good, and after t = 700/θ its inverse overflows; so it
//! decays to d_least. At any d_i above 1e-84 the term is below rounding.
//!
//! The excitation monitor: the smallest eigenvalue of S.
//!
//! By the solution of (8), S(t) is the Gramian of (11) with forgetting, scaled by
//! Δ_θ, plus what is left of S(0):
//!
//! S(t) = e^{−θt} Φ̃ᵀS(0)Φ̃ + θ ∫₀ᵗ e^{−θ(t−s)} Δ_θ⁻¹ Φᵀ(s,t) CᵀC Φ(s,t) Δ_θ⁻¹ ds,
//!
//! and (16) says λ_min(S) ≥ δ_0/(e α(θ)) wherever A4 holds. So a λ_min that keeps
//! falling is the on-line sign that A4 fails.
//!
//! Eigenvalues are no graph operation; traces are. For A = S⁻¹ of size n,
//! λ_max(A)^m ≤ tr(A^m) ≤ n λ_max(A)^m, so with m = 2^K
//!
//! ℓ = tr(A^m)^{−1/m}  satisfies  ℓ ≤ λ_min(S) ≤ n^{1/m} ℓ.
//!
//! K = 7 squarings leave ℓ at most 0.9 % below λ_min for n = 3, 1.8 % for n = 10.
//! Each power is divided by its trace, B_{k+1} = B_k²/t_k with t_k = tr(B_k²) in
//! [1/n, 1], so that nothing overflows; then ℓ = 1/(tr(A) Π_k t_k^{1/2^{k+1}}).

use lynkeus_expr::{Expr, Graph, Node, jacobian};
use lynkeus_gain::UnitFactor;
use lynkeus_proof::matrix::square;
use lynkeus_structure::output_map::Rows;
use lynkeus_structure::{AugmentedPlant, Matrix, Measurement, range};

use super::form::Form;
use super::said::Said;
use super::settings::Settings;
use crate::conditions::names;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed};
use crate::printed::{StartPoint, expressions};
use crate::sparse::{Sparse, minus, sum, times};
use crate::{Design, DesignError, Monitor, ParameterValue, Reason, Signal};

/// The smallest d_i that forgetting leaves.
const D_LEAST: f64 = 1e-100;

/// Squarings K.
const SQUARINGS: i32 = 7;

/// The alarm is raised at this fraction of the information that the best
/// excitation could leave in the least visible state.
const ALARM: f64 = 1e-6;

/// Observer (7)–(8).
pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    let graph = augmented.graph();
    let (given, S0) = (settings.θ()?, settings.S0(&form.order)?);
    let copy = PlantCopy::new(augmented, &settings.common);
    let [C, F] = [&form.C, &form.F].map(|A| at_estimate(&copy, A));
    let factor = Factor::new(graph, &names(augmented, &form.order), &S0);
    let mut derivatives = copy.at_estimate(&augmented.derivatives);
    prolong(&copy, &F, &form.order, &mut derivatives);
    let v: Vec<Vec<Sparse<'_>>> = C.iter().map(|row| factor.forward(row)).collect();
    // θΔ_θ⁻¹ = diag(θI, θ²I, …) over the blocks
    let meaning = "the speed θ of the gain and of S".to_owned();
    let θ = Speed::new(&copy, "theta", given, meaning);
    let correction = factor.gain(&v, &innovations(&copy));
    for ((&state, &k), z) in form.order.iter().zip(&form.block).zip(correction) {
        if let Some(z) = z {
            let power = θ.scaled(graph, given.powi(k as i32 + 1), (k + 1) as f64);
            derivatives[state] = (graph.expr(derivatives[state]) - power * z).node();
        }
    }
    derivatives.extend(factor.derivatives(θ.expr(graph), &F, &v));
    let alarm = alarm(augmented, &form, settings)?;
    let mut observer = copy.observer(derivatives)?.tuned_by([&θ]);
    observer.monitors.extend(monitor(&factor, alarm));
    observer.states.extend(factor.states);
    let outside = outside_last(augmented, &form).into_iter();
    Ok(Design {
        observer,
        notes: outside.map(Reason::from).collect(),
        gains: vec![],
        parameters: parameters(
            &copy,
            &form,
            (given, &S0),
            alarm,
            examination.chains.clone(),
        )?,
        examination,
    })
}

/// The paper's prolongation (A2), if the study asks for it: F(u, σ(x̂))x̂ + φ(u, σ(x̂)), which is the
/// plant at σ(x̂) plus F(u, σ(x̂))(x̂ − σ(x̂)); `copy` evaluates everything at σ(x̂). Against a plant in the
/// box what is left is F(u, σ(x̂))e and a difference of f between points of the box, as φ and F read no
/// later block: so every bound of the proof holds wherever x̂ is.
fn prolong<'g>(
    copy: &PlantCopy<'_, 'g>,
    F: &[Vec<Sparse<'g>>],
    order: &[usize],
    derivatives: &mut [Node],
) {
    if !copy.common.prolongs() {
        return;
    }
    let graph: &'g Graph = copy.augmented.graph();
    for (row, &state) in order.iter().enumerate() {
        for (entry, &next) in F[row].iter().zip(order) {
            let Some(entry) = entry else { continue };
            let hat = copy.hats[next].symbol;
            let outside = graph.expr(hat) - graph.expr(copy.seen_as(next, hat));
            derivatives[state] = (graph.expr(derivatives[state]) + *entry * outside).node();
        }
    }
}

/// Below this excitation the flag is raised.
pub(super) fn alarm(
    augmented: &AugmentedPlant<'_>,
    form: &Form,
    settings: &Settings,
) -> Result<f64, DesignError> {
    match settings.alarm()? {
        Some(alarm) => Ok(alarm),
        None => Ok(ALARM * least_reach(augmented, form)?),
    }
}

/// λ_min(S) with the flag that excitation is lost.
fn monitor(factor: &Factor<'_>, alarm_below: f64) -> Option<Monitor> {
    let bound = least_eigenvalue(&factor.inverse_entries())?;
    Some(Monitor {
        name: "excitation".into(),
        node: bound.node(),
        alarm_below,
        meaning: "excitation is lost: the inputs and the estimate do not move enough to distinguish every state (A4), so some states are not corrected any more".into(),
        matrix: None,
    })
}

/// The entries at the estimate.
fn at_estimate<'g>(copy: &PlantCopy<'_, 'g>, A: &Rows) -> Vec<Vec<Sparse<'g>>> {
    let graph: &'g Graph = copy.augmented.graph();
    let entry = |e: &Option<Node>| Some(graph.expr(copy.at_estimate(&[(*e)?])[0]));
    A.iter()
        .map(|row| row.iter().map(entry).collect())
        .collect()
}

/// C(u)x̂ − y, one per output.
fn innovations<'g>(copy: &PlantCopy<'_, 'g>) -> Vec<Expr<'g>> {
    let augmented = copy.augmented;
    let graph: &'g Graph = augmented.graph();
    let hats = augmented.states.iter().zip(&copy.hats);
    let unlimited = hats.map(|(state, hat)| (state.node, hat.symbol)).collect();
    let innovation = |(o, y): (&Measurement, &Signal)| {
        let h = graph.substitute(&[o.variable.node], &unlimited)[0];
        graph.expr(h) - graph.expr(y.symbol)
    };
    augmented
        .outputs
        .iter()
        .zip(&copy.measured)
        .map(innovation)
        .collect()
}

/// How large the diagonal of S could be at best for the least visible state:
/// g = 1 for an output, g_j = Σ_i g_i max|F_ij|² for a state. It carries the units
/// of F, so that the alarm does not depend on them. Unbounded entries count as 1.
fn least_reach(augmented: &AugmentedPlant<'_>, form: &Form) -> Result<f64, DesignError> {
    let (graph, region) = (augmented.graph(), augmented.region());
    let mut reach = vec![1.0; augmented.outputs.len()];
    let mut least = f64::INFINITY;
    for factor in &form.blocks.factors {
        let mut next = vec![0.0; factor.columns.len()];
        for &(i, j, node) in &factor.entries {
            let found = range(graph, node, &region)?.enclosure;
            let size = found.hi().max(-found.lo());
            next[j] += reach[i] * if size.is_finite() { size * size } else { 1.0 };
        }
        let positive = next.iter().copied().filter(|g| *g > 0.0);
        least = positive.fold(least, f64::min);
        reach = next;
    }
    Ok(if least.is_finite() { least } else { 1.0 })
}

/// (1) has ε in the last block only. Elsewhere its trace in the blocks behind
/// does not shrink as θ grows: worth a note, no reason to refuse.
fn outside_last(augmented: &AugmentedPlant<'_>, form: &Form) -> Option<Said> {
    let plant = augmented.plant;
    let last = form.blocks.declared().last()?;
    let known = |v: &lynkeus_model::Variable| {
        augmented.inputs.iter().any(|i| i.node == v.node)
            || augmented.state_index(&v.name).is_some()
    };
    let ε: Vec<Node> = plant
        .inputs
        .iter()
        .filter(|v| !known(v))
        .map(|v| v.node)
        .collect();
    let pattern = jacobian::pattern(augmented.graph(), &plant.derivatives, &ε);
    let acts = |&i: &usize| {
        let unknown_input = i >= augmented.plant_states();
        !last.contains(&i) && (unknown_input || !pattern[i].is_empty())
    };
    let states: Vec<usize> = (0..augmented.states.len()).filter(acts).collect();
    (!states.is_empty()).then(|| Said::OutsideLast {
        states: names(augmented, &states),
        last: names(augmented, &last),
    })
}

fn parameters(
    copy: &PlantCopy<'_, '_>,
    form: &Form,
    (θ, S0): (f64, &UnitFactor),
    alarm: f64,
    chains: Vec<Vec<String>>,
) -> Result<Vec<(String, ParameterValue)>, DesignError> {
    let augmented = copy.augmented;
    let [C, F] = [&form.C, &form.F].map(|A| {
        let size = (A.len(), form.order.len());
        Matrix::from_fn(augmented.graph(), size, |i, j| A[i][j])
    });
    let gain = gain(&StartPoint::new(copy)?.values(&C)?, form, θ, S0);
    let mut found: Vec<(String, ParameterValue)> = vec![("θ".into(), θ.into())];
    let mut add = |name: &str, value| found.push((name.to_owned(), value));
    add("blocks", ParameterValue::Blocks(chains));
    add("alarm", ParameterValue::Alarm(alarm));
    add("rows", names(augmented, &form.order).into());
    add("C(u)", expressions(&C));
    if form.blocks.factors.len() > 1 {
        add("F(u, x)", expressions(&F));
    }
    add("S(0)", ParameterValue::Matrix(product(S0)));
    add("θΔ⁻¹S⁻¹Cᵀ at the start", ParameterValue::Matrix(gain));
    Ok(found)
}

/// S = UᵀDU
fn product(S: &UnitFactor) -> Vec<Vec<f64>> {
    square(S.diagonal.len(), |i, j| {
        let terms = (0..=i.min(j)).map(|k| S.U(k, i) * S.diagonal[k] * S.U(k, j));
        terms.sum()
    })
}

/// θ Δ_θ⁻¹ S(0)⁻¹ Cᵀ: by Uᵀv = Cᵀ and then Uz = D⁻¹v, as the observer has it.
fn gain(C: &[Vec<f64>], form: &Form, θ: f64, S: &UnitFactor) -> Vec<Vec<f64>> {
    let n = S.diagonal.len();
    let column = |c: &Vec<f64>| {
        let mut v = c.clone();
        for i in 0..n {
            let known: f64 = (0..i).map(|k| S.U(k, i) * v[k]).sum();
            v[i] -= known;
        }
        for i in (0..n).rev() {
            let known: f64 = (i + 1..n).map(|k| S.U(i, k) * v[k]).sum();
            v[i] = v[i] / S.diagonal[i] - known;
        }
        v
    };
    let columns: Vec<Vec<f64>> = C.iter().map(column).collect();
    let powers = form.block.iter().map(|&k| θ.powi(k as i32 + 1));
    powers
        .enumerate()
        .map(|(i, power)| columns.iter().map(|z| power * z[i]).collect())
        .collect()
}

/// The states of the factors as symbols.
struct Factor<'g> {
    graph: &'g Graph,
    /// ln d_i
    pub δ: Vec<Expr<'g>>,
    /// U row by row, dense; the diagonal and below are not used
    U: Vec<Vec<Sparse<'g>>>,
    /// with their starts, in the order of [`Factor::derivatives`]
    pub states: Vec<(Signal, f64)>,
}

impl<'g> Factor<'g> {
    /// Symbols for the factors of S, named after the states and starting at S(0).
    pub fn new(graph: &'g Graph, names: &[String], start: &UnitFactor) -> Self {
        let n = names.len();
        let mut states = vec![];
        let mut state = |name: String, start: f64| {
            let expr = graph.fresh(format!("factor {name}"));
            let symbol = expr.node();
            states.push((Signal { name, symbol }, start));
            expr
        };
        let δ = (0..n)
            .map(|i| state(format!("ln d({})", names[i]), start.diagonal[i].ln()))
            .collect();
        let mut U = vec![vec![None; n]; n];
        for i in 0..n {
            for j in i + 1..n {
                let name = format!("u({}, {})", names[i], names[j]);
                U[i][j] = Some(state(name, start.upper[i][j - i - 1]));
            }
        }
        Self {
            graph,
            δ,
            U,
            states,
        }
    }

    /// 1/d_i
    fn inverse(&self, i: usize) -> Expr<'g> {
        (-self.δ[i]).exp()
    }

    /// v with Uᵀv = c, for one row c of C.
    pub fn forward(&self, c: &[Sparse<'g>]) -> Vec<Sparse<'g>> {
        let mut v: Vec<Sparse<'g>> = vec![];
        for (i, &c) in c.iter().enumerate() {
            let known = sum((0..i).map(|k| times(self.U[k][i], v[k])));
            v.push(minus(c, known));
        }
        v
    }

    /// z = S⁻¹Cᵀe from v = U⁻ᵀCᵀ, one row per output: b = D⁻¹ve, then Uz = b.
    pub fn gain(&self, v: &[Vec<Sparse<'g>>], e: &[Expr<'g>]) -> Vec<Sparse<'g>> {
        let n = self.δ.len();
        let mut z: Vec<Sparse<'g>> = vec![None; n];
        for i in (0..n).rev() {
            let ve = sum(v.iter().zip(e).map(|(v, &e)| times(v[i], Some(e))));
            let b = times(ve, Some(self.inverse(i)));
            let known = sum((i + 1..n).map(|k| times(self.U[i][k], z[k])));
            z[i] = minus(b, known);
        }
        z
    }

    /// δ' and U', in the order of `states`.
    pub fn derivatives(
        &self,
        θ: Expr<'g>,
        F: &[Vec<Sparse<'g>>],
        v: &[Vec<Sparse<'g>>],
    ) -> Vec<Node> {
        let n = self.δ.len();
        let δ = (0..n).map(|i| {
            let square = sum(v.iter().map(|v| v[i].map(|x| x.powi(2))));
            let new = square.map_or(self.graph.constant(D_LEAST), |s| s + D_LEAST);
            θ * (new * self.inverse(i) - 1.0)
        });
        let above = (0..n).flat_map(|i| (i + 1..n).map(move |j| (i, j)));
        let zero = self.graph.constant(0.0);
        let U = above.map(|(i, j)| self.slope_above(i, j, F, v).map_or(zero, |s| θ * s));
        δ.chain(U).map(Expr::node).collect()
    }

    /// −UF + up(D⁻¹vvᵀ)U at (i, j); rows i and j of U have their ones at i and j.
    fn slope_above(
        &self,
        i: usize,
        j: usize,
        F: &[Vec<Sparse<'g>>],
        v: &[Vec<Sparse<'g>>],
    ) -> Sparse<'g> {
        let w = |k: usize| {
            let vv = sum(v.iter().map(|v| times(v[i], v[k])));
            times(vv, Some(self.inverse(i)))
        };
        let UF = (i + 1..j).map(|k| times(self.U[i][k], F[k][j]));
        let wU = (i + 1..j).map(|k| times(w(k), self.U[k][j]));
        minus(sum(wU.chain([w(j)])), sum(UF.chain([F[i][j]])))
    }

    /// The entries (i, j), j ≥ i, of S⁻¹ = U⁻¹D⁻¹U⁻ᵀ: for its trace, not for the gain.
    pub fn inverse_entries(&self) -> Vec<Vec<Expr<'g>>> {
        let n = self.δ.len();
        let Y: Vec<Vec<Sparse<'g>>> = (0..n).map(|i| self.inverse_row(i)).collect();
        let entry = |i: usize, j: usize| {
            let terms = (j..n).map(|k| {
                let product = times(Y[i][k], Y[j][k]);
                times(product, Some(self.inverse(k)))
            });
            sum(terms).unwrap_or(self.graph.constant(0.0))
        };
        (0..n)
            .map(|i| (i..n).map(|j| entry(i, j)).collect())
            .collect()
    }

    /// Row i of U⁻¹.
    fn inverse_row(&self, i: usize) -> Vec<Sparse<'g>> {
        let mut row: Vec<Sparse<'g>> = vec![None; i];
        row.push(Some(self.graph.constant(1.0)));
        for j in i + 1..self.δ.len() {
            let known = sum((i..j).map(|k| times(row[k], self.U[k][j])));
            row.push(known.map(|x| -x));
        }
        row
    }
}

/// ℓ for A = S⁻¹, whose rows start at the diagonal.
fn least_eigenvalue<'g>(A: &[Vec<Expr<'g>>]) -> Option<Expr<'g>> {
    let trace = trace(A)?;
    let mut B = divided(A, trace);
    let mut bound = 1.0 / trace;
    let graph = trace.graph();
    let [least, most] = [1.0 / A.len() as f64, 1.0].map(|t| graph.constant(t));
    for k in 0..SQUARINGS {
        let square = squared(&B);
        // t is in [1/n, 1]: what encloses it would not know
        let t = self::trace(&square)?.max(least).min(most);
        // t^{1/2^{k+1}} by square roots
        let root = (0..=k).fold(t, |t, _| t.sqrt());
        bound = bound / root;
        B = divided(&square, t);
    }
    Some(bound)
}

fn trace<'g>(A: &[Vec<Expr<'g>>]) -> Option<Expr<'g>> {
    A.iter().map(|row| row[0]).reduce(|a, b| a + b)
}

fn divided<'g>(A: &[Vec<Expr<'g>>], by: Expr<'g>) -> Vec<Vec<Expr<'g>>> {
    let row = |row: &Vec<Expr<'g>>| row.iter().map(|&a| a / by).collect();
    A.iter().map(row).collect()
}

fn squared<'g>(B: &[Vec<Expr<'g>>]) -> Vec<Vec<Expr<'g>>> {
    let n = B.len();
    let at = |i: usize, j: usize| B[i.min(j)][i.max(j) - i.min(j)];
    let entry = |i: usize, j: usize| {
        let rest = (1..n).map(|k| at(i, k) * at(k, j));
        rest.fold(at(i, 0) * at(0, j), |a, b| a + b)
    };
    (0..n)
        .map(|i| (i..n).map(|j| entry(i, j)).collect())
        .collect()
}
