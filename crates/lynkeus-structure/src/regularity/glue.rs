//! Selections that do not jump: `if x < 0 then 0 else x^2`.

use std::collections::HashMap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, Node, Op, Tape, Unary};

use super::sums::are_one;
use crate::Region;

/// Whether both branches of a selection by an inequality p < q or p ≤ q have one value
/// where p = q. There p may be written as q, wherever the node p stands: the branches
/// then have to become one expression, one number on the whole region, or one sum: for the
/// last the branches must have values, which is asked of them anyway.
pub(super) fn meets(graph: &Graph, node: Node, region: &Region) -> bool {
    let Op::Select(condition, a, b) = graph.op(node) else {
        return false;
    };
    let Some((p, q)) = compared(graph, condition) else {
        return false;
    };
    let images = [(p, q), (q, p)].into_iter().chain(differences(graph, p, q));
    images
        .filter(|(from, _)| !matches!(graph.op(*from), Op::Constant(_)))
        .any(|image| {
            let there = graph.substitute(&[a, b], &HashMap::from([image]));
            there[0] == there[1]
                || same_number(graph, &there, region)
                || are_one(graph, there[0], there[1])
        })
}

/// p and q of a condition that changes only where p = q.
fn compared(graph: &Graph, condition: Node) -> Option<(Node, Node)> {
    match graph.op(condition) {
        Op::Binary(Binary::Less | Binary::LessEq, p, q) => Some((p, q)),
        Op::Unary(Unary::Not, inner) => compared(graph, inner),
        _ => None,
    }
}

/// Where p = q, p − q and q − p are zero; and where r − s is zero, r is s.
fn differences(graph: &Graph, p: Node, q: Node) -> Vec<(Node, Node)> {
    let zero = graph.constant(0.0).node();
    let mut images = vec![
        (graph.binary(Binary::Sub, p, q), zero),
        (graph.binary(Binary::Sub, q, p), zero),
    ];
    for (difference, other) in [(p, q), (q, p)] {
        if let (Op::Binary(Binary::Sub, r, s), Some(0.0)) =
            (graph.op(difference), graph.constant_value(other))
        {
            images.extend([(r, s), (s, r), (graph.binary(Binary::Sub, s, r), zero)]);
        }
    }
    images
}

fn same_number(graph: &Graph, nodes: &[Node], region: &Region) -> bool {
    let used = region.restricted(&graph.symbols_of(nodes));
    let Ok(tape) = Tape::new(graph, &used.symbols(), nodes) else {
        return false;
    };
    let values = tape.eval_in(&Intervals, &used.cell());
    let number = |x: &Interval| x.is_point() && x.is_defined();
    number(&values[0]) && number(&values[1]) && values[0].lo() == values[1].lo()
}
