//! Where an expression may have no derivative: kinks, steps and singular ends.

use lynkeus_expr::{Binary, Graph, Node, Nodes, Op, Unary};

/// Expressions over `moving` that vanish wherever one of the roots may have a kink, a step
/// or an infinite slope in it; where none does, the roots are as smooth as their poles
/// allow. None for roots without such operations.
pub(super) fn edges(graph: &Graph, roots: &[Node], moving: &[Node]) -> Vec<Node> {
    let found = graph.reachable(&graph.with_residuals(roots)).into_iter();
    let found = found.filter_map(|node| edge(graph, node));
    let mut found: Vec<Node> = found
        .filter(|edge| {
            let read = graph.symbols_of(&[*edge]);
            moving.iter().any(|symbol| read.contains(symbol))
        })
        .collect();
    found.sort();
    found.dedup();
    found
}

fn edge(graph: &Graph, node: Node) -> Option<Node> {
    let expr = |node: Node| graph.expr(node);
    match graph.op(node) {
        Op::Unary(Unary::Abs | Unary::Sign | Unary::Sqrt, a) => Some(a),
        Op::Unary(Unary::Floor, a) => Some((expr(a) - expr(node)).node()),
        Op::Binary(op, a, b) => match op {
            Binary::Min | Binary::Max | Binary::Less | Binary::LessEq | Binary::Equal => {
                Some((expr(a) - expr(b)).node())
            }
            Binary::Pow => match graph.constant_value(b) {
                Some(power) if power >= 0.0 && power.fract() == 0.0 => None,
                _ => Some(a),
            },
            // the cut: y = 0 with x ≤ 0
            Binary::Atan2 => {
                let (y, x) = (expr(a), expr(b));
                Some((x + (x * x + y * y).sqrt()).node())
            }
            _ => None,
        },
        // where the equations of a loop do not determine it
        Op::Implicit(_) => {
            let call = graph.implicit_call(node)?;
            let matrix = call.function.matrix(&Nodes(graph), &call.at(graph, node));
            match matrix[..] {
                [slope] => Some(slope),
                _ => {
                    let zero = graph.constant(0.0).node();
                    let right = vec![zero; call.function.size()];
                    Some(graph.solve(&matrix, &right).rcond)
                }
            }
        }
        _ => None,
    }
}
