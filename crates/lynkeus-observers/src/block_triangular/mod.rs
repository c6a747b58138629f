//! Lee, Yee and Park, *Nonlinear observer design for multi-output systems in
//! block-triangular form* (2000).
//!
//! x_i' = A_i x_i + g_i(x_1, …, x_i; u; y_{i+1}, …, y_p), y_i = C_i x_i (2), or its
//! generalisation in Remark 3 with ∂f_ij/∂x_{i,j+1} ≠ 1. With F_i = ∂f_i/∂x_i,
//! the observer (7)
//!
//! x̂_i' = f_i(x̂_1, …, x̂_i; u; y_{i+1}, …, y_p) + M_i⁻¹ [L_i + Δ_θi⁻¹ K_i] (y_i − C_i x̂_i)
//!
//! or, with M = I and L = 0, the classical observer (3).
//!
//! The rule for θ. Lemma 2 bounds θ_k^m/θ_j^l for every block k before j with
//! 1 ≤ m ≤ n_k, 1 ≤ l ≤ n_j; its worst case is m = n_k, l = 1, so for chains of any
//! lengths it asks for 1 ≤ θ_i and θ_{i−1}^{n_{i−1}} ≤ θ_i. The rule between
//! neighbours suffices: θ_k^{n_k} ≤ θ_{k+1} ≤ θ_{k+1}^{n_{k+1}} ≤ θ_{k+2} ≤ ….

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Node, jacobian};
use lynkeus_structure::{Blocks, Chain, Extended, blocks};

use crate::conditions::{chain_request, fit, lipschitz, names, output_slope, partial};
use crate::estimate::Copy;
use crate::{ChainGain, Design, DesignError, Examination, Family, Fit, Tuning, TuningError, Value};

const NAME: &str = "block-triangular";

/// The family `block-triangular`.
#[derive(Clone, Copy, Debug)]
pub struct BlockTriangular;

impl Family for BlockTriangular {
    fn name(&self) -> &'static str {
        NAME
    }

    fn paper(&self) -> &'static str {
        "Lee, Yee, Park 2000, observers (3) and (7)"
    }

    fn keys(&self) -> &'static [&'static str] {
        &["theta", "k", "k_poles", "correction", "chains"]
    }

    fn examine(
        &self,
        extended: &Extended<'_>,
        tuning: &Tuning,
    ) -> Result<Examination, DesignError> {
        Ok(match form(extended, tuning)? {
            Ok((_, examination)) | Err(examination) => examination,
        })
    }

    fn design(&self, extended: &Extended<'_>, tuning: &Tuning) -> Result<Design, DesignError> {
        match form(extended, tuning)? {
            Ok((blocks, examination)) if examination.fit != Fit::DoesNotFit => {
                Ok(assemble(extended, tuning, &blocks, examination)?)
            }
            Ok((_, examination)) | Err(examination) => {
                Err(DesignError::Refused(Box::new(examination)))
            }
        }
    }
}

/// The first arrangement into blocks that no condition refutes.
fn form(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Result<(Blocks, Examination), Examination>, DesignError> {
    let lengths = given(tuning)?.map(|k| k.iter().map(Vec::len).collect());
    let request = chain_request(extended, tuning, "k", lengths)?;
    let mut refused = None;
    let arrangements = match blocks::find(extended, &request) {
        Ok(arrangements) => arrangements,
        Err(summary) => {
            let (fit, chains, checks) = (Fit::DoesNotFit, vec![], vec![]);
            return Ok(Err(Examination {
                family: NAME,
                fit,
                summary,
                chains,
                checks,
            }));
        }
    };
    for blocks in arrangements {
        let examination = examined(extended, &blocks)?;
        if examination.fit != Fit::DoesNotFit {
            return Ok(Ok((blocks, examination)));
        }
        refused.get_or_insert(examination);
    }
    refused
        .map(Err)
        .ok_or_else(|| TuningError::new("chains", "a chain", "none").into())
}

fn examined(extended: &Extended<'_>, blocks: &Blocks) -> Result<Examination, DesignError> {
    let region = extended.region();
    let graph = extended.graph();
    let (mut checks, mut integrators) = (vec![], true);
    for (output, chain) in &blocks.order {
        checks.extend(output_slope(extended, *output, &region)?);
        for pair in chain.states.windows(2) {
            let (node, found) = partial(extended, pair[0], pair[1], &region)?;
            integrators &= graph.constant_value(node) == Some(1.0);
            checks.push(found.check);
        }
    }
    checks.push(lipschitz(extended, &region)?);
    let mut summary = blocks.describe(extended);
    if !integrators {
        summary += "; not every ∂f/∂x along the chains is 1, so convergence is local (Remark 3)";
    }
    let fit = fit(&checks);
    Ok(Examination {
        family: NAME,
        fit,
        summary,
        chains: blocks.names(extended),
        checks,
    })
}

/// K_i as the study gives them, or from the eigenvalues of A − KC, in the order
/// of the measured outputs.
fn given(tuning: &Tuning) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    match (number_lists(tuning, "k")?, number_lists(tuning, "k_poles")?) {
        (Some(_), Some(_)) => {
            let expected = "k or k_poles, which both decide K";
            Err(TuningError::new("k_poles", expected, "both"))
        }
        (k, None) => Ok(k),
        (None, Some(poles)) => {
            if let Some(pole) = poles.iter().flatten().find(|pole| **pole >= 0.0) {
                return Err(TuningError::new("k_poles", "negative numbers", pole));
            }
            Ok(Some(poles.iter().map(|poles| placed(poles)).collect()))
        }
    }
}

/// K with the eigenvalues of A − KC at the poles: the coefficients of Π(s − pole).
fn placed(poles: &[f64]) -> Vec<f64> {
    let mut coefficients = vec![1.0];
    for pole in poles {
        let shifted = coefficients.iter().map(|c| -pole * c);
        let mut next: Vec<f64> = coefficients.iter().copied().chain([0.0]).collect();
        for (sum, term) in next[1..].iter_mut().zip(shifted) {
            *sum += term;
        }
        coefficients = next;
    }
    coefficients.split_off(1)
}

fn number_lists(tuning: &Tuning, key: &str) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    let Some(value) = tuning.values.get(key) else {
        return Ok(None);
    };
    let wrong = || TuningError::new(key, "a list of lists of numbers, one per chain", value);
    let Value::List(rows) = value else {
        return Err(wrong());
    };
    let number = |x: &Value| match x {
        Value::Number(x) if x.is_finite() => Ok(*x),
        _ => Err(wrong()),
    };
    let row = |row: &Value| match row {
        Value::List(row) => row.iter().map(number).collect(),
        _ => Err(wrong()),
    };
    rows.iter().map(row).collect::<Result<_, _>>().map(Some)
}

/// Observer (7) or (3).
fn assemble(
    extended: &Extended<'_>,
    tuning: &Tuning,
    blocks: &Blocks,
    examination: Examination,
) -> Result<Design, TuningError> {
    let graph = extended.graph();
    let copy = Copy::new(extended, tuning);
    let missing = || TuningError::new("theta", "a positive number per chain", "nothing");
    let count = blocks.order.len();
    let θ = tuning
        .positive_per_chain("theta", count)?
        .ok_or_else(missing)?;
    let K = given(tuning)?.unwrap_or_else(|| {
        let all_at_one = |n: usize| placed(&vec![-1.0; n]);
        blocks.lengths().into_iter().map(all_at_one).collect()
    });
    let classical = tuning
        .choice("correction", &["lee", "classical"])?
        .as_deref()
        == Some("classical");
    let mut derivatives = copy.at_estimate(&extended.derivatives);
    let mut gains = vec![];
    for (place, (output, chain)) in blocks.order.iter().enumerate() {
        let injected = injected(&copy, blocks, place);
        let Some(innovation) = copy.innovation(*output) else {
            continue;
        };
        let constants: Vec<f64> = K[*output]
            .iter()
            .enumerate()
            .map(|(j, k)| θ[*output].powi(j as i32 + 1) * k)
            .collect();
        let gain = match classical {
            true => constants
                .iter()
                .map(|&k| graph.constant(k).node())
                .collect(),
            false => lee(extended, chain, &constants),
        };
        let gain = copy.at_estimate(&graph.substitute(&gain, &injected));
        let f: Vec<Node> = chain
            .states
            .iter()
            .map(|&i| extended.derivatives[i])
            .collect();
        let f = copy.at_estimate(&graph.substitute(&f, &injected));
        for ((&state, f), gain) in chain.states.iter().zip(f).zip(gain) {
            derivatives[state] = (graph.expr(f) - graph.expr(gain) * graph.expr(innovation)).node();
        }
        gains.push(ChainGain {
            output: extended.outputs[*output].variable.name.clone(),
            entries: names(extended, &chain.states)
                .into_iter()
                .zip(constants)
                .collect(),
        });
    }
    let text = |x: &[f64]| x.iter().map(f64::to_string).collect::<Vec<_>>().join(", ");
    let mut parameters = vec![("θ".to_owned(), text(&θ))];
    parameters.extend(
        K.iter()
            .enumerate()
            .map(|(i, k)| (format!("K{}", i + 1), text(k))),
    );
    Ok(Design {
        observer: copy.observer(NAME, tuning, derivatives)?,
        notes: chain_rule(blocks, &θ).into_iter().collect(),
        examination,
        gains,
        parameters,
    })
}

/// y_{i+1}, …, y_p in place of the states they show.
fn injected(copy: &Copy<'_, '_>, blocks: &Blocks, place: usize) -> HashMap<Node, Node> {
    let later = blocks.order[place + 1..].iter();
    later
        .filter_map(|(output, _)| copy.measured_state(*output))
        .map(|(state, y)| (copy.extended.states[state].node, y))
        .collect()
}

/// Lemma 2's condition on θ.
fn chain_rule(blocks: &Blocks, θ: &[f64]) -> Option<String> {
    blocks.order.windows(2).find_map(|pair| {
        let ((before, chain), (after, _)) = (&pair[0], &pair[1]);
        let needed = θ[*before].powi(chain.states.len() as i32);
        (needed > θ[*after]).then(|| {
            format!(
                "theta: {} for the later chain is below {needed} = {}^{} of the chain before it; the proof of Theorem 1 needs at least that",
                θ[*after], θ[*before], chain.states.len()
            )
        })
    })
}

/// M⁻¹(L + Δ⁻¹K) by the five steps. Since M = W⁻¹M̄, it is M̄⁻¹W(L + Δ⁻¹K): one
/// triangular solve.
fn lee(extended: &Extended<'_>, chain: &Chain, constants: &[f64]) -> Vec<Node> {
    let graph = extended.graph();
    let n = chain.states.len();
    let F = own_jacobian(extended, chain);
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
    // Step 5, multiplied out
    let v: Vec<Sparse> = L
        .iter()
        .zip(constants)
        .map(|(&l, &k)| sum(graph, l, Some(graph.constant(k).node())))
        .collect();
    let right: Vec<Sparse> = W.iter().map(|row| dot(graph, row, &v)).collect();
    let zero = graph.constant(0.0).node();
    let gain = solve_lower(graph, &M̄, right);
    gain.into_iter().map(|g| g.unwrap_or(zero)).collect()
}

/// An entry that may be zero everywhere.
type Sparse = Option<Node>;

/// F_i = ∂f_i/∂x_i, row by row.
fn own_jacobian(extended: &Extended<'_>, chain: &Chain) -> Vec<Vec<Sparse>> {
    let f: Vec<Node> = chain
        .states
        .iter()
        .map(|&i| extended.derivatives[i])
        .collect();
    let x: Vec<Node> = chain
        .states
        .iter()
        .map(|&i| extended.states[i].node)
        .collect();
    let jacobian = jacobian::forward(extended.graph(), &f, &x);
    let n = f.len();
    (0..n)
        .map(|i| (0..n).map(|j| jacobian.get(i, j)).collect())
        .collect()
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
