//! The observers (7) and (3), the latter also in the low-power form: chains of dimension
//! 2n − 2 with gains of at most θ².

use std::collections::HashMap;

use lynkeus_expr::{Expr, Node, jacobian};
use lynkeus_structure::{AugmentedPlant, Blocks, Chain};

use super::form::{Form, chain_rule};
use super::said::Correction;
use super::settings::Settings;
use crate::design::Found;
use crate::estimate::{PlantCopy, Speed, prolong};
use crate::peaking::{Part, Transient};
use crate::printed::AtStart;
use crate::sparse::{Sparse, dot, minus, sum};
use crate::{Design, DesignError, estimate, guarantee, peaking, printed};

pub(super) fn design(
    augmented: &AugmentedPlant<'_>,
    settings: &Settings,
    found: Found<Form>,
) -> Result<Design, DesignError> {
    match (settings.lmi()?, settings.remedies.low_power) {
        (true, _) => guarantee::design_lmi(augmented, &settings.common, found.examination),
        (false, true) => low_power(augmented, settings, found),
        (false, false) => observer(augmented, settings, found),
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
                    let L: Vec<_> = found.L.iter().map(|l| vec![l.map(Expr::node)]).collect();
                    parameters.push((format!("M{}", output + 1), start.table(&found.M())));
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
pub(super) struct Steps<'g> {
    M̄: Vec<Vec<Sparse<'g>>>,
    pub L: Vec<Sparse<'g>>,
    W: Vec<Vec<Sparse<'g>>>,
}

impl<'g> Steps<'g> {
    pub fn new(augmented: &AugmentedPlant<'g>, chain: &Chain) -> Self {
        let n = chain.len();
        let F = slopes(augmented, chain, chain);
        // C = (1, 0, …, 0)
        let one = augmented.graph().constant(1.0);
        let C: Vec<Sparse<'g>> = (0..n).map(|j| (j == 0).then_some(one)).collect();
        // Step 1: M̄ = (C; CF; …; CF^{n−1}), lower triangular, and the next power CFⁿ
        let mut rows = vec![C.clone()];
        for k in 0..n {
            let column = |j: usize| F.iter().map(|row| row[j]).collect::<Vec<_>>();
            let next = (0..n).map(|j| dot(&rows[k], &column(j))).collect();
            rows.push(next);
        }
        let next = rows.pop().unwrap_or_default();
        let M̄ = rows;
        // Steps 2 and 3: the last row q of M̄FM̄⁻¹ − A solves q M̄ = CFⁿ; L_j = q_{n−j+1}
        let q = solve_left(&M̄, &next);
        let L: Vec<Sparse<'g>> = q.into_iter().rev().collect();
        // Step 4: W = (C; C(A + LC); …)
        let mut W = vec![C];
        for k in 1..n {
            let row = &W[k - 1];
            let next = std::iter::once(dot(row, &L)).chain(row.iter().copied());
            W.push(next.take(n).collect());
        }
        Self { M̄, L, W }
    }

    /// M, row by row; the observer does without.
    pub fn M(&self) -> Vec<Vec<Option<Node>>> {
        solved(&self.W, &self.M̄)
    }

    /// M⁻¹ = M̄⁻¹W.
    pub fn inverse(&self) -> Vec<Vec<Option<Node>>> {
        solved(&self.M̄, &self.W)
    }
}

/// A⁻¹B for a lower triangular A.
fn solved(A: &[Vec<Sparse<'_>>], B: &[Vec<Sparse<'_>>]) -> Vec<Vec<Option<Node>>> {
    let n = A.len();
    let column = |j: usize| solve_lower(A, B.iter().map(|row| row[j]).collect());
    let columns: Vec<Vec<Sparse<'_>>> = (0..n).map(column).collect();
    let row = |i: usize| columns.iter().map(|c| c[i].map(Expr::node)).collect();
    (0..n).map(row).collect()
}

/// M⁻¹(L + Δ⁻¹K) by the five steps. Since M = W⁻¹M̄, it is M̄⁻¹W(L + Δ⁻¹K): one
/// triangular solve.
fn lee(augmented: &AugmentedPlant<'_>, chain: &Chain, gains: &[Node]) -> Vec<Node> {
    let graph = augmented.graph();
    let Steps { M̄, L, W } = Steps::new(augmented, chain);
    // Step 5, multiplied out
    let pairs = L.iter().zip(gains);
    let v: Vec<Sparse<'_>> = pairs
        .map(|(&l, &k)| sum([l, Some(graph.expr(k))]))
        .collect();
    let right: Vec<Sparse<'_>> = W.iter().map(|row| dot(row, &v)).collect();
    let zero = graph.constant(0.0);
    let gain = solve_lower(&M̄, right);
    gain.into_iter().map(|g| g.unwrap_or(zero).node()).collect()
}

/// ∂f/∂x for the equations of `rows` and the states `columns`, row by row; F_i of a chain and itself.
pub(super) fn slopes<'g>(
    augmented: &AugmentedPlant<'g>,
    rows: &[usize],
    columns: &[usize],
) -> Vec<Vec<Sparse<'g>>> {
    let graph = augmented.graph();
    let f: Vec<Node> = rows.iter().map(|&i| augmented.derivatives[i]).collect();
    let x: Vec<Node> = columns.iter().map(|&i| augmented.states[i].node).collect();
    let jacobian = jacobian::forward(graph, &f, &x);
    let entry = |i: usize, j: usize| Some(graph.expr(jacobian.get(i, j)?));
    let row = |i: usize| (0..x.len()).map(|j| entry(i, j)).collect();
    (0..f.len()).map(row).collect()
}

/// (right − known)/pivot
fn eliminated<'g>(right: Sparse<'g>, known: Sparse<'g>, pivot: Sparse<'g>) -> Sparse<'g> {
    let numerator = minus(right, known)?;
    Some(pivot.map_or(numerator, |pivot| numerator / pivot))
}

/// x with M x = b for a lower triangular M.
fn solve_lower<'g>(M: &[Vec<Sparse<'g>>], b: Vec<Sparse<'g>>) -> Vec<Sparse<'g>> {
    let mut x: Vec<Sparse<'g>> = vec![];
    for (i, right) in b.into_iter().enumerate() {
        let known = dot(&M[i][..i], &x);
        x.push(eliminated(right, known, M[i][i]));
    }
    x
}

/// q with q M = c for a lower triangular M.
fn solve_left<'g>(M: &[Vec<Sparse<'g>>], c: &[Sparse<'g>]) -> Vec<Sparse<'g>> {
    let n = c.len();
    let mut q: Vec<Sparse<'g>> = vec![None; n];
    for j in (0..n).rev() {
        let column: Vec<Sparse<'g>> = M.iter().map(|row| row[j]).collect();
        let known = dot(&q[j + 1..], &column[j + 1..]);
        q[j] = eliminated(c[j], known, M[j][j]);
    }
    q
}
