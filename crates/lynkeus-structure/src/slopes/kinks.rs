//! Where expressions jump, and where they only seem to.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Op, Unary};

use super::model::BUDGET;
use crate::{Region, range_within};

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

/// Whether the term may jump as the symbol moves: a condition, a sign, a rounding or the
/// cut of an angle stands between them. |x|, min and max do not jump.
pub(super) fn jumps_in(
    graph: &Graph,
    term: Node,
    symbol: Node,
    region: &Region,
) -> Result<bool, MissingInput> {
    let depends = |node: Node| graph.symbols_of(&[node]).contains(&symbol);
    for node in graph.reachable(&[term]) {
        let jumps = match graph.op(node) {
            Op::Select(condition, ..) => depends(condition),
            Op::Unary(Unary::Sign | Unary::Floor, a) => depends(a),
            Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, a, b) => {
                depends(a) || depends(b)
            }
            Op::Binary(Binary::Atan2, _, x) if depends(node) => {
                !range_within(graph, x, region, BUDGET)?
                    .enclosure
                    .is_positive()
            }
            _ => false,
        };
        if jumps {
            return Ok(true);
        }
    }
    Ok(false)
}
