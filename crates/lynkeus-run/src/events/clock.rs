//! Conditions that the clock alone decides at one instant: `when time >= 3`.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Op};
use lynkeus_model::{Timer, Whens};

use super::when::SAME;

/// From one instant of a timer that has only one to the next.
const NEVER: f64 = 1e18;

/// Clauses in which what compares time with a number is told by a timer of one instant: integrations stop there, and
/// the comparison, which instants that rounding cannot tell apart do not split, is made at events alone. With them the
/// comparisons, which are nobody else's.
pub(crate) fn by_the_clock(graph: &Graph, time: Node, whens: &Whens) -> (Whens, Vec<Node>) {
    let parts = whens.clauses.iter().flat_map(|clause| {
        let values = clause.changes.iter().map(|change| change.1);
        clause.conditions.iter().copied().chain(values)
    });
    let parts: Vec<Node> = parts.collect();
    let mut told = HashMap::new();
    let mut timers = vec![];
    for node in graph.reachable(&parts) {
        let Op::Binary(comparison @ (Binary::Less | Binary::LessEq), a, b) = graph.op(node) else {
            continue;
        };
        let instant = match (a == time, b == time) {
            (true, false) => graph.constant_value(b),
            (false, true) => graph.constant_value(a),
            _ => None,
        };
        let is_met = comparison == Binary::LessEq;
        let Some(instant) = instant.filter(|c| c.is_finite() && (*c != 0.0 || is_met)) else {
            continue;
        };
        let edge = graph.constant(instant - SAME * instant.abs()).node();
        let compared = match a == time {
            true => graph.binary(Binary::Less, time, edge),
            false => graph.binary(Binary::LessEq, edge, time),
        };
        told.insert(node, compared);
        if !timers.iter().any(|timer: &Timer| timer.start == instant) {
            timers.push(Timer {
                symbol: graph.fresh("instant").node(),
                start: instant,
                interval: NEVER,
                is_initial: false,
            });
        }
    }
    let mut own = whens.substituted(graph, &told);
    own.timers.extend(timers);
    (own, told.into_values().collect())
}
