//! Where expressions only seem to jump: in `sign(a)*a`, and in selections whose branches meet,
//! such as `if x < 0 then 0 else x^2`.

use std::collections::HashMap;

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, Node, Op, Tape, Unary};

use crate::Region;
use crate::exact::are_one;

/// Products of more factors are left as they are.
const FACTORS: usize = 32;

/// The expressions with sign(a)·a written as |a|, the factors of a product in any order:
/// what the derivative of a·|a| has in it does not jump, though its factor sign(a) does.
pub(crate) fn without_removable_jumps(graph: &Graph, roots: &[Node]) -> Vec<Node> {
    let nodes = graph.reachable(roots);
    let has_sign = |&node: &Node| matches!(graph.op(node), Op::Unary(Unary::Sign, _));
    if !nodes.iter().any(has_sign) {
        return roots.to_vec();
    }
    let bent = nodes
        .iter()
        .filter_map(|&node| Some((node, bent(graph, node)?)));
    let bent: HashMap<Node, Node> = bent.collect();
    // what is rebuilt may hold products that are to be rebuilt in their turn
    let changed = graph.substitute(roots, &bent);
    match changed == roots {
        true => changed,
        false => without_removable_jumps(graph, &changed),
    }
}

/// A product with a sign and its argument among the factors, without that sign.
fn bent(graph: &Graph, node: Node) -> Option<Node> {
    if !matches!(graph.op(node), Op::Binary(Binary::Mul | Binary::Div, ..)) {
        return None;
    }
    let (factors, mut negative) = factors(graph, node)?;
    let (sign, partner, opposite) = factors.iter().enumerate().find_map(|(i, factor)| {
        let argument = match graph.op(factor.0) {
            Op::Unary(Unary::Sign, argument) if !factor.1 => argument,
            _ => return None,
        };
        let mut others = factors.iter().enumerate();
        others.find_map(|(j, other)| {
            let opposite = compared(graph, argument, other.0)?;
            (i != j && !other.1).then_some((i, j, opposite))
        })
    })?;
    let size = graph.unary(Unary::Abs, factors[partner].0);
    negative ^= opposite;
    let mut product = match negative {
        true => graph.unary(Unary::Neg, size),
        false => size,
    };
    let rest = factors.iter().enumerate();
    for (_, &(factor, below)) in rest.filter(|(i, _)| *i != sign && *i != partner) {
        let op = if below { Binary::Div } else { Binary::Mul };
        product = graph.binary(op, product, factor);
    }
    Some(product)
}

/// The factors of a product, each with whether it divides, and whether the product
/// changes their sign; none of a product with too many of them.
fn factors(graph: &Graph, product: Node) -> Option<(Vec<(Node, bool)>, bool)> {
    let (mut found, mut negative) = (vec![], false);
    let mut open = vec![(product, false)];
    while let Some((node, below)) = open.pop() {
        match graph.op(node) {
            Op::Binary(Binary::Mul, a, b) => open.extend([(b, below), (a, below)]),
            Op::Binary(Binary::Div, a, b) => open.extend([(b, !below), (a, below)]),
            Op::Unary(Unary::Neg, a) => {
                negative = !negative;
                open.push((a, below));
            }
            _ => found.push((node, below)),
        }
        if found.len() > FACTORS {
            return None;
        }
    }
    Some((found, negative))
}

/// Whether b is −a (true) or a (false); none where it is neither.
fn compared(graph: &Graph, a: Node, b: Node) -> Option<bool> {
    if a == b {
        return Some(false);
    }
    match (graph.op(a), graph.op(b)) {
        (Op::Unary(Unary::Neg, inner), _) if inner == b => Some(true),
        (_, Op::Unary(Unary::Neg, inner)) if inner == a => Some(true),
        (Op::Binary(Binary::Sub, p, q), Op::Binary(Binary::Sub, r, s)) if (p, q) == (s, r) => {
            Some(true)
        }
        _ => None,
    }
}

/// Whether both branches of a selection by an inequality p < q or p ≤ q have one value
/// where p = q. There p may be written as q, wherever the node p stands: the branches
/// then have to become one expression, one number on the whole region, or one sum: for the
/// last the branches must have values, which is asked of them anyway.
pub(crate) fn meets(graph: &Graph, node: Node, region: &Region) -> bool {
    let Op::Select(condition, a, b) = graph.op(node) else {
        return false;
    };
    let Some((p, q)) = equated(graph, condition) else {
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
fn equated(graph: &Graph, condition: Node) -> Option<(Node, Node)> {
    match graph.op(condition) {
        Op::Binary(Binary::Less | Binary::LessEq, p, q) => Some((p, q)),
        Op::Unary(Unary::Not, inner) => equated(graph, inner),
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
