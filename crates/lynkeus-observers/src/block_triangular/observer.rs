//! The observers (7) and (3), the latter also in the low-power form: chains of dimension
//! 2n − 2 with gains of at most θ².

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node, jacobian};
use lynkeus_structure::{AugmentedPlant, Blocks, Chain};

use super::form::{Form, chain_rule};
use super::said::Correction;
use super::settings::Settings;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed, prolong};
use crate::peaking::{Part, Transient};
use crate::printed::AtStart;
use crate::{Design, DesignError, estimate, guarantee, peaking, printed};

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    found: Found<Form>,
) -> Result<Design, DesignError> {
    match (settings.lmi()?, settings.remedies.low_power) {
        (Some(lmi), _) => {
            guarantee::design_lmi(augmented, &settings.common, lmi, found.examination)
        }
        (None, true) => low_power(augmented, settings, found),
        (None, false) => observer(augmented, settings, found),
    }
}

/// Observer (7) or (3).
fn observer(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    let graph = augmented.graph();
    let copy = PlantCopy::new(augmented, &settings.common);
    let blocks = &form.blocks;
    let remedies = &settings.remedies;
    let transient = &remedies.transient;
    let (θ, K) = (settings.θ()?, settings.K(&blocks.lengths()));
    let correction = settings.correction;
    let start = AtStart::new(&copy)?;
    let mut parameters = vec![("θ".to_owned(), θ.clone().into())];
    parameters.extend(transient.as_ref().map(Transient::parameter));
    let coefficients = K.iter().enumerate();
    parameters.extend(coefficients.map(|(i, k)| (format!("K{}", i + 1), k.clone().into())));
    let mut derivatives = copy.at_estimate(&augmented.derivatives);
    let mut gains = vec![];
    let speeds = Speed::of_chains(&copy, &θ);
    for (place, (output, chain)) in blocks.order.iter().enumerate() {
        let injected = injected(&copy, blocks, place);
        let Some(innovation) = remedies.innovation(&copy, *output) else {
            continue;
        };
        let power = |(j, k): (usize, &f64)| (θ[*output].powi(j as i32 + 1) * k, (j + 1) as f64);
        let steady: Vec<(f64, f64)> = K[*output].iter().enumerate().map(power).collect();
        let timed = peaking::gains(
            transient.as_ref(),
            &copy,
            *output,
            &speeds[*output],
            &steady,
        );
        let gain = match correction {
            Correction::Classical => timed,
            Correction::Lee => lee(augmented, chain, &timed),
        };
        let gain = copy.at_estimate(&graph.substitute(&gain, &injected));
        let f: Vec<Node> = chain.iter().map(|&i| augmented.derivatives[i]).collect();
        let f = copy.at_estimate(&graph.substitute(&f, &injected));
        for ((&state, f), gain) in chain.iter().zip(f).zip(&gain) {
            derivatives[state] =
                (graph.expr(f) - graph.expr(*gain) * graph.expr(innovation)).node();
        }
        let printed = printed::ChainCorrection {
            output: *output,
            states: chain,
            factors: &gain,
            limited: remedies.limit.is_some(),
        };
        match printed.constant(augmented) {
            Some(constant) => gains.push(constant),
            None => {
                if correction == Correction::Lee {
                    let found = Steps::new(augmented, chain);
                    let L: Vec<_> = found.L.iter().map(|&l| vec![l]).collect();
                    parameters.push((format!("M{}", output + 1), start.table(&found.M(graph))));
                    parameters.push((format!("L{}", output + 1), start.table(&L)));
                }
                let constants: Vec<f64> = steady.iter().map(|gain| gain.0).collect();
                parameters.push((format!("Δ⁻¹K{}", output + 1), constants.into()));
                parameters.extend(printed.expressions(&start));
            }
        }
    }
    for ((_, chain), partials) in blocks.order.iter().zip(&form.partials) {
        prolong(&copy, chain, partials, &mut derivatives)?;
    }
    Ok(Design {
        observer: copy.observer(derivatives)?.tuned_by(&speeds),
        notes: chain_rule(blocks, &θ).into_iter().collect(),
        examination,
        gains,
        parameters,
    })
}

/// y_{i+1}, …, y_p in place of the states they show.
fn injected(copy: &PlantCopy<'_, '_>, blocks: &Blocks, place: usize) -> HashMap<Node, Node> {
    let later = blocks.order[place + 1..].iter();
    later
        .filter_map(|(output, _)| copy.measured_state(*output))
        .map(|(state, y)| (copy.augmented.states[state].node, y))
        .collect()
}

/// The observer whose chains have the low-power form.
fn low_power(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    Found { form, examination }: Found<Form>,
) -> Result<Design, DesignError> {
    estimate::refuse(&settings.common, "form = \"low-power\"")?;
    let (blocks, graph) = (&form.blocks, augmented.graph());
    let copy = PlantCopy::new(augmented, &settings.common);
    let θ = settings.θ()?;
    let part = |place: usize| Part {
        output: blocks.order[place].0,
        states: &blocks.order[place].1,
        partials: &form.partials[place],
        δ: 1.0,
    };
    let parts: Vec<Part<'_>> = (0..blocks.order.len()).map(part).collect();
    let derivative = |&state: &usize| augmented.derivatives[state];
    let f = |place: usize| {
        let f: Vec<Node> = parts[place].states.iter().map(derivative).collect();
        graph.substitute(&f, &injected(&copy, blocks, place))
    };
    let advice = Some("declare min and max in the model");
    let remedies = &settings.remedies;
    let mut design = peaking::low_power(&copy, remedies, &θ, &parts, f, advice, examination)?;
    design.notes.extend(chain_rule(blocks, &θ));
    Ok(design)
}

/// M̄, L and W of the five steps: they make the similarity transformation M = W⁻¹M̄ of the error.
pub(super) struct Steps {
    M̄: Vec<Vec<Sparse>>,
    pub L: Vec<Sparse>,
    W: Vec<Vec<Sparse>>,
}

impl Steps {
    pub fn new(augmented: &AugmentedPlant<'_>, chain: &Chain) -> Self {
        let graph = augmented.graph();
        let n = chain.len();
        let F = slopes(augmented, chain, chain);
        // Step 1: M̄ = (C; CF; …; CF^{n−1}), lower triangular, and the next power CFⁿ
        let mut rows = vec![unit(graph, n)];
        for k in 0..n {
            rows.push(times(graph, &rows[k], &F));
        }
        let next = rows.pop().unwrap_or_default();
        let M̄ = rows;
        // Steps 2 and 3: the last row q of M̄FM̄⁻¹ − A solves q M̄ = CFⁿ; L_j = q_{n−j+1}
        let q = solve_left(graph, &M̄, next);
        let L: Vec<Sparse> = q.into_iter().rev().collect();
        // Step 4: W = (C; C(A + LC); …)
        let Ā = |row: &[Sparse]| -> Vec<Sparse> {
            (0..n)
                .map(|j| match j {
                    0 => dot(graph, row, &L),
                    _ => row[j - 1],
                })
                .collect()
        };
        let mut W = vec![unit(graph, n)];
        for k in 1..n {
            W.push(Ā(&W[k - 1]));
        }
        Self { M̄, L, W }
    }

    /// M, row by row; the observer does without.
    pub fn M(&self, graph: &Graph) -> Vec<Vec<Sparse>> {
        solved(graph, &self.W, &self.M̄)
    }

    /// M⁻¹ = M̄⁻¹W.
    pub fn inverse(&self, graph: &Graph) -> Vec<Vec<Sparse>> {
        solved(graph, &self.M̄, &self.W)
    }
}

/// A⁻¹B for a lower triangular A.
fn solved(graph: &Graph, A: &[Vec<Sparse>], B: &[Vec<Sparse>]) -> Vec<Vec<Sparse>> {
    let n = A.len();
    let column = |j: usize| solve_lower(graph, A, B.iter().map(|row| row[j]).collect());
    let columns: Vec<Vec<Sparse>> = (0..n).map(column).collect();
    let row = |i: usize| columns.iter().map(|c| c[i]).collect();
    (0..n).map(row).collect()
}

/// M⁻¹(L + Δ⁻¹K) by the five steps. Since M = W⁻¹M̄, it is M̄⁻¹W(L + Δ⁻¹K): one
/// triangular solve.
fn lee(augmented: &AugmentedPlant<'_>, chain: &Chain, gains: &[Node]) -> Vec<Node> {
    let graph = augmented.graph();
    let Steps { M̄, L, W } = Steps::new(augmented, chain);
    // Step 5, multiplied out
    let v: Vec<Sparse> = L
        .iter()
        .zip(gains)
        .map(|(&l, &k)| sum(graph, l, Some(k)))
        .collect();
    let right: Vec<Sparse> = W.iter().map(|row| dot(graph, row, &v)).collect();
    let zero = graph.constant(0.0).node();
    let gain = solve_lower(graph, &M̄, right);
    gain.into_iter().map(|g| g.unwrap_or(zero)).collect()
}

/// An entry that may be zero everywhere.
pub(super) type Sparse = Option<Node>;

/// ∂f/∂x for the equations of `rows` and the states `columns`, row by row; F_i of a chain and itself.
pub(super) fn slopes(
    augmented: &AugmentedPlant<'_>,
    rows: &[usize],
    columns: &[usize],
) -> Vec<Vec<Sparse>> {
    let f: Vec<Node> = rows.iter().map(|&i| augmented.derivatives[i]).collect();
    let x: Vec<Node> = columns.iter().map(|&i| augmented.states[i].node).collect();
    let jacobian = jacobian::forward(augmented.graph(), &f, &x);
    let row = |i: usize| (0..x.len()).map(|j| jacobian.get(i, j)).collect();
    (0..f.len()).map(row).collect()
}

/// C = (1, 0, …, 0)
fn unit(graph: &Graph, n: usize) -> Vec<Sparse> {
    let one = graph.constant(1.0).node();
    (0..n).map(|j| (j == 0).then_some(one)).collect()
}

fn sum(graph: &Graph, a: Sparse, b: Sparse) -> Sparse {
    match (a, b) {
        (Some(a), Some(b)) => Some((graph.expr(a) + graph.expr(b)).node()),
        (a, b) => a.or(b),
    }
}

fn product<'g>(graph: &'g Graph, a: Sparse, b: Sparse) -> Option<Expr<'g>> {
    Some(graph.expr(a?) * graph.expr(b?))
}

fn dot(graph: &Graph, a: &[Sparse], b: &[Sparse]) -> Sparse {
    let terms = a.iter().zip(b).filter_map(|(&a, &b)| product(graph, a, b));
    terms.reduce(|a, b| a + b).map(Expr::node)
}

fn times(graph: &Graph, row: &[Sparse], F: &[Vec<Sparse>]) -> Vec<Sparse> {
    let column = |j: usize| F.iter().map(|r| r[j]).collect::<Vec<_>>();
    (0..row.len())
        .map(|j| dot(graph, row, &column(j)))
        .collect()
}

/// (right − known)/pivot
fn eliminated(graph: &Graph, right: Sparse, known: Sparse, pivot: Sparse) -> Sparse {
    let numerator = match (right, known) {
        (Some(r), Some(k)) => graph.expr(r) - graph.expr(k),
        (Some(r), None) => graph.expr(r),
        (None, Some(k)) => -graph.expr(k),
        (None, None) => return None,
    };
    Some(match pivot {
        Some(pivot) => (numerator / graph.expr(pivot)).node(),
        None => numerator.node(),
    })
}

/// x with M x = b for a lower triangular M.
fn solve_lower(graph: &Graph, M: &[Vec<Sparse>], b: Vec<Sparse>) -> Vec<Sparse> {
    let mut x: Vec<Sparse> = vec![];
    for (i, right) in b.into_iter().enumerate() {
        let known = dot(graph, &M[i][..i], &x);
        x.push(eliminated(graph, right, known, M[i][i]));
    }
    x
}

/// q with q M = c for a lower triangular M.
fn solve_left(graph: &Graph, M: &[Vec<Sparse>], c: Vec<Sparse>) -> Vec<Sparse> {
    let n = c.len();
    let mut q: Vec<Sparse> = vec![None; n];
    for j in (0..n).rev() {
        let column: Vec<Sparse> = M.iter().map(|row| row[j]).collect();
        let known = dot(graph, &q[j + 1..], &column[j + 1..]);
        q[j] = eliminated(graph, c[j], known, M[j][j]);
    }
    q
}
