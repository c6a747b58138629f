//! How large the map of a plant is, before it is made.

use lynkeus_expr::{Binary, Graph, Node, Op, Spent};
use lynkeus_structure::Extended;
use lynkeus_structure::output_map::AffineForm;

use crate::DesignError;

/// Operations of the map that a second is enough for, with what is decided of them: measured on
/// chains of 20 to 100 states, generously.
const PER_SECOND: f64 = 400_000.0;

/// Bytes per operation, measured likewise.
const BYTES: f64 = 100.0;

/// Refuses a map that the budget is not enough for.
///
/// # Errors
/// How many operations it would have.
pub(super) fn affordable(extended: &Extended<'_>, form: &AffineForm) -> Result<(), DesignError> {
    let budget = extended.graph().budget();
    let operations = operations(extended, form);
    let time = budget.left().map(|left| left.as_secs_f64() * PER_SECOND);
    let room = budget.room().map(|room| room as f64 / BYTES);
    match time.into_iter().chain(room).all(|most| operations <= most) {
        true => Ok(()),
        false => Err(DesignError::Spent(Spent::Size(operations as u64))),
    }
}

/// Of n derivatives of the outputs with their slopes by n states: the k-th coefficient of a
/// product of series has k products.
fn operations(extended: &Extended<'_>, form: &AffineForm) -> f64 {
    let n = extended.states.len() as f64;
    let graph = extended.graph();
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let roots: Vec<Node> = form.drift.iter().copied().chain(outputs).collect();
    let cost = |node: &Node| match graph.op(*node) {
        Op::Constant(_) | Op::Symbol(_) => 0.0,
        op if is_linear(graph, op) => n,
        _ => 0.5 * n * n,
    };
    n * graph.reachable(&roots).iter().map(cost).sum::<f64>()
}

/// Whether a coefficient of the result costs the same at every order.
fn is_linear(graph: &Graph, op: Op) -> bool {
    let is_number = |node: Node| matches!(graph.op(node), Op::Constant(_));
    match op {
        Op::Unary(lynkeus_expr::Unary::Neg, _) => true,
        Op::Binary(Binary::Add | Binary::Sub, ..) => true,
        Op::Binary(Binary::Mul, a, b) => is_number(a) || is_number(b),
        Op::Binary(Binary::Div, _, b) => is_number(b),
        _ => false,
    }
}
