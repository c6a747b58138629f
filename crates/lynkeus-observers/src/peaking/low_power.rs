//! Astolfi and Marconi, *A high-gain nonlinear observer with limited gain power*,
//! IEEE Trans. Automatic Control 60 (2015) 3059–3064.
//!
//! For x_i' = x_{i+1}, x_n' = φ(x) the paper has n − 1 blocks ξ_i ∈ R² with
//! ξ_i' = A ξ_i + N ξ_{i+1} + D₂(ℓ) K_i e_i, D₂ = diag(ℓ, ℓ²), e_1 = y − Cξ_1,
//! e_i = Bᵀξ_{i−1} − Cξ_i: every gain is at most ℓ², where the standard observer has ℓⁿ.
//! The first entry of ξ_i is x̂_i, the second another estimate c_{i+1} of x_{i+1}, and
//! x̂_n = c_n.
//!
//! Here x_i' = f_i(x_1, …, x_{i+1}, u) with partials a_i = ∂f_i/∂x_{i+1}. In the coordinates
//! a_1 ⋯ a_{i−1} x_i the plant is one of integrators up to terms that a large ℓ
//! suppresses; back from there only the second gain of a block keeps a partial, and
//! that is a single one:
//!
//! x̂_i'     = f_i(x̂_1, …, x̂_i, c_{i+1}, u)                + ℓ k_i1 e_i
//! c_{i+1}' = f_{i+1}(x̂_1, …, x̂_i, c_{i+1}, c_{i+2}, u) + ℓ² k_i2/a_i e_i,   e_i = c_i − x̂_i.
//!
//! With `clamp` every c is limited to its range where it drives something else: in f, and in
//! e_{i+1}. Then each block is driven by bounded signals and peaks by a power of ℓ at
//! most one, not n − 1; that is the saturation of Astolfi, Marconi, Praly and Teel, *Low-power
//! peaking-free high-gain observers*, Automatica 98 (2018) 169–179.

use lynkeus_expr::{Graph, Node};
use lynkeus_gain::low_power;
use lynkeus_gain::low_power::Coefficients;

use super::transient;
use super::transient::Transient;
use crate::conditions::Partial;
use crate::estimate::{PlantCopy, Speed};
use crate::{KeySpec, Shape, Signal, Tuning, TuningError, Value};

/// Eigenvalues of M.
pub(super) const POLES: KeySpec = KeySpec {
    name: "low_power_poles",
    shape: Shape::As(
        "one list per chain of 2n − 2 negative numbers",
        &Shape::ROWS,
    ),
    default: "−1, −1, …",
    meaning: "with `form = \"low-power\"`: the eigenvalues of the form's error system",
};

/// The coefficients themselves.
pub(super) const GIVEN: KeySpec = KeySpec {
    name: "low_power_k",
    shape: Shape::As(
        "one list per chain of a pair `[k1, k2]` per state but the last",
        &Shape::List(&Shape::ROWS),
    ),
    default: "by `low_power_poles`",
    meaning: "with `form = \"low-power\"`: its coefficients",
};

/// K_1, …, K_{n−1} of each chain: given, or by the eigenvalues of M, which are all −1 if nothing
/// is given.
pub(super) fn coefficients(
    given: Option<&Value>,
    poles: Option<&Value>,
    lengths: &[usize],
) -> Result<Vec<Coefficients>, TuningError> {
    match (given, poles) {
        (Some(_), Some(_)) => {
            let expected = format!(
                "{} or {}, which both decide the coefficients",
                GIVEN.name, POLES.name
            );
            Err(TuningError::new(POLES.name, expected, "both"))
        }
        (Some(given), None) => explicit(given, lengths),
        (None, Some(poles)) => placed(poles, lengths),
        (None, None) => Ok(lengths.iter().map(|n| low_power::at_one(n - 1)).collect()),
    }
}

/// Refuses given coefficients or poles that no chain could have.
pub(super) fn refuse_unstable(tuning: &Tuning) -> Result<(), TuningError> {
    if let Some(poles) = tuning.values.get(POLES.name) {
        let chains = chains(POLES.name, poles)?;
        chains
            .iter()
            .try_for_each(|chain| negative(chain, poles).map(drop))?;
    }
    if let Some(given) = tuning.values.get(GIVEN.name) {
        let chains = chains(GIVEN.name, given)?;
        chains
            .iter()
            .try_for_each(|chain| stable_pairs(chain, given).map(drop))?;
    }
    Ok(())
}

/// What the lists under the two keys hold, in words.
const PAIRS: &str = "one list per chain of a pair [k1, k2] per state but the last";

const NUMBERS: &str = "one list per chain of 2n − 2 negative numbers, n being its states";

/// Lists of pairs (k_i1, k_i2), one list per chain.
fn explicit(given: &Value, lengths: &[usize]) -> Result<Vec<Coefficients>, TuningError> {
    let chains = rows(GIVEN.name, given, lengths.len(), PAIRS)?;
    let mut found = vec![];
    for (chain, n) in chains.iter().zip(lengths) {
        rows(GIVEN.name, chain, n - 1, PAIRS)?;
        found.push(stable_pairs(chain, given)?);
    }
    Ok(found)
}

/// The pairs of a chain, if M is stable with them.
fn stable_pairs(chain: &Value, given: &Value) -> Result<Coefficients, TuningError> {
    let pair = |pair: &Value| match pair.list()? {
        [a, b] => Some([a.number()?, b.number()?]),
        _ => None,
    };
    let wrong = || TuningError::new(GIVEN.name, PAIRS, given);
    let coefficients: Coefficients = chain.all(pair).ok_or_else(wrong)?;
    let abscissa = low_power::abscissa(&coefficients);
    // a chain of one state has no block, hence no eigenvalue
    if coefficients.is_empty() || abscissa < 0.0 {
        return Ok(coefficients);
    }
    let expected = "coefficients that make M stable, every eigenvalue with a negative real part";
    let found = format!("{chain}, with an eigenvalue of real part {abscissa:.4}");
    Err(TuningError::new(GIVEN.name, expected, found))
}

/// Lists of 2n − 2 negative numbers, one list per chain.
fn placed(given: &Value, lengths: &[usize]) -> Result<Vec<Coefficients>, TuningError> {
    let chains = rows(POLES.name, given, lengths.len(), NUMBERS)?;
    let mut found = vec![];
    for (chain, n) in chains.iter().zip(lengths) {
        rows(POLES.name, chain, 2 * (n - 1), NUMBERS)?;
        let poles = negative(chain, given)?;
        let beyond = "poles whose coefficients stay in the range of numbers";
        let K =
            low_power::place(&poles).ok_or_else(|| TuningError::new(POLES.name, beyond, chain))?;
        found.push(K);
    }
    Ok(found)
}

/// The poles of a chain.
fn negative(chain: &Value, given: &Value) -> Result<Vec<f64>, TuningError> {
    let poles = chain.all(|pole| pole.number().filter(|pole| *pole < 0.0));
    poles.ok_or_else(|| TuningError::new(POLES.name, NUMBERS, given))
}

fn chains<'v>(key: &str, value: &'v Value) -> Result<&'v [Value], TuningError> {
    let wrong = || TuningError::new(key, "one list per chain", value);
    value.list().ok_or_else(wrong)
}

/// Whether the form's stability is not proved where the partials, with sizes in `bounds`, move and the
/// gain does not.
pub(super) fn varies(bounds: &[(f64, f64)], K: &[[f64; 2]]) -> bool {
    // to the geometric mean, which the gain is made for
    let ratio = |&(low, high): &(f64, f64)| {
        let half = (high / low).sqrt();
        (1.0 / half, half)
    };
    let ratios: Vec<(f64, f64)> = bounds.iter().map(ratio).collect();
    !bounds.is_empty() && !low_power::tolerates(K, &ratios)
}

fn rows<'v>(
    key: &str,
    value: &'v Value,
    count: usize,
    expected: &str,
) -> Result<&'v [Value], TuningError> {
    match value {
        Value::List(rows) if rows.len() == count => Ok(rows),
        _ => Err(TuningError::new(
            key,
            format!("{expected} ({count} here)"),
            value,
        )),
    }
}

/// A chain to be put in this form.
pub(crate) struct Part<'a> {
    /// place of its output
    pub output: usize,
    /// places of its states, sensor end first
    pub states: &'a [usize],
    pub partials: &'a [Partial],
    /// ℓ = θ^δ
    pub δ: f64,
}

/// A chain with what corrects it.
pub(super) struct Blocks<'a> {
    pub part: &'a Part<'a>,
    /// f_1, …, f_n over the plant's symbols
    pub f: &'a [Node],
    /// what the second gain of each block is divided by, over the plant's symbols
    pub divisors: &'a [Node],
    /// x̂_1 − y
    pub innovation: Node,
    pub K: &'a [[f64; 2]],
    pub θ: &'a Speed,
}

/// The observer, of dimension Σ max(1, 2n − 2), while its chains are added.
pub(super) struct Run<'c, 'e, 'p> {
    pub copy: &'c PlantCopy<'e, 'p>,
    pub transient: Option<&'c Transient>,
    pub starts: Vec<f64>,
    pub derivatives: Vec<Node>,
    /// c with its start and its derivative
    pub copies: Vec<((Signal, f64), Node)>,
}

impl Run<'_, '_, '_> {
    /// Corrects one chain; the steady gains with the states that they act on.
    pub fn add(&mut self, blocks: &Blocks<'_>) -> Vec<(String, f64)> {
        let part = blocks.part;
        let n = part.states.len();
        let constants = constants(blocks);
        let gains = transient::gains(self.transient, self.copy, part.output, blocks.θ, &constants);
        let graph = self.copy.augmented.graph();
        let signals: Vec<Signal> = (0..n).map(|j| self.second(part, j)).collect();
        let mut names = vec![];
        // a chain of one state has no block: its correction is ℓ e_1
        for i in 0..n.max(2) - 1 {
            let e = self.innovation(blocks, &signals, i);
            let here = self.seen(part, &signals, &[i + 1]);
            let f = self.copy.at_estimate_with(&blocks.f[i..=i], &here)[0];
            self.derivatives[part.states[i]] = plus(graph, f, gains[2 * i], e);
            names.push(self.copy.hats[part.states[i]].name.clone());
            if i + 1 == n {
                break;
            }
            let divisor = self.copy.at_estimate_with(&blocks.divisors[i..=i], &here)[0];
            let gain = graph.expr(gains[2 * i + 1]) / graph.expr(divisor);
            let next = self.seen(part, &signals, &[i + 1, i + 2]);
            let f = self.copy.at_estimate_with(&blocks.f[i + 1..=i + 1], &next)[0];
            let derivative = plus(graph, f, gain.node(), e);
            names.push(signals[i + 1].name.clone());
            if i + 2 == n {
                self.derivatives[part.states[n - 1]] = derivative;
            } else {
                let start = self.starts[part.states[i + 1]];
                self.copies
                    .push(((signals[i + 1].clone(), start), derivative));
            }
        }
        let steady = constants.iter().map(|c| c.0);
        names.into_iter().zip(steady).collect()
    }

    /// c_{j+1}, counted from 0: x̂_n for the last.
    fn second(&self, part: &Part<'_>, j: usize) -> Signal {
        let hat = &self.copy.hats[part.states[j]];
        if j + 1 == part.states.len() {
            return hat.clone();
        }
        let name = format!("second estimate of {}", hat.name);
        let symbol = self.copy.augmented.graph().fresh(&name).node();
        Signal { name, symbol }
    }

    /// y − x̂_1, then c_i − x̂_i.
    fn innovation(&self, blocks: &Blocks<'_>, signals: &[Signal], i: usize) -> Node {
        let graph = self.copy.augmented.graph();
        match i {
            0 => (-graph.expr(blocks.innovation)).node(),
            _ => {
                let state = blocks.part.states[i];
                let c = self.copy.seen_as(state, signals[i].symbol);
                (graph.expr(c) - graph.expr(self.copy.hats[state].symbol)).node()
            }
        }
    }

    /// x_{j+1} as c_{j+1} for the given j, counted from 0.
    fn seen(&self, part: &Part<'_>, signals: &[Signal], places: &[usize]) -> Vec<(usize, Node)> {
        let inside = places.iter().filter(|&&j| j < part.states.len());
        inside
            .map(|&j| (part.states[j], signals[j].symbol))
            .collect()
    }
}

/// (ℓk_i1, 1), (ℓ²k_i2, 2), … with their powers of ℓ as powers of θ.
fn constants(Blocks { part, K, θ, .. }: &Blocks<'_>) -> Vec<(f64, f64)> {
    let (L, δ) = (θ.value().powf(part.δ), part.δ);
    if K.is_empty() {
        return vec![(L, δ)];
    }
    let block = |k: &[f64; 2]| [(L * k[0], δ), (L * L * k[1], 2.0 * δ)];
    K.iter().flat_map(block).collect()
}

fn plus(graph: &Graph, f: Node, gain: Node, e: Node) -> Node {
    (graph.expr(f) + graph.expr(gain) * graph.expr(e)).node()
}
