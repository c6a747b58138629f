//! Which operations jump with the state, and on which surfaces.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Op, Tape, Unary};

use super::{Held, Relay};

/// Expressions in which each jump of the state is an input of its own.
pub(crate) struct Taken {
    pub roots: Vec<Node>,
    /// the symbols of these inputs
    pub modes: Vec<Node>,
    pub held: Held,
}

/// Takes every `sign`, `<` and `≤` that depends on one of `inputs` out of the roots; none
/// where there is none. Several that change on one surface change together. The surfaces are
/// functions of `arguments`, which hold the inputs and what else the roots read.
pub(crate) fn take(
    graph: &Graph,
    inputs: &[Node],
    arguments: &[Node],
    roots: &[Node],
) -> Result<Option<Taken>, MissingInput> {
    let mut replaced: HashMap<Node, Node> = HashMap::new();
    let (mut relays, mut modes, mut surfaces) = (vec![], vec![], vec![]);
    for node in graph.reachable(roots) {
        let Some(jump) = Jump::of(graph, node) else {
            continue;
        };
        if !graph.symbols_of(&[node]).iter().any(|s| inputs.contains(s)) {
            continue;
        }
        let quantity = graph.substitute(&[jump.quantity], &replaced)[0];
        let mode = graph.fresh(graph.render(node, 60)).node();
        let (surface, is_reversed) = place(graph, &mut surfaces, quantity);
        relays.push(Relay {
            surface,
            is_reversed,
            is_sign: jump.is_sign,
            at_zero: jump.at_zero,
        });
        modes.push(mode);
        replaced.insert(node, mode);
    }
    if relays.is_empty() {
        return Ok(None);
    }
    // a kink on a surface that is located is smooth on each side, and no step is rejected for it
    for node in graph.reachable(roots) {
        let Some(kink) = kink(graph, node) else {
            continue;
        };
        let quantity = graph.substitute(&[kink.quantity], &replaced)[0];
        let Some((surface, is_reversed)) = found(graph, &surfaces, quantity) else {
            continue;
        };
        let mode = graph.fresh(graph.render(node, 60)).node();
        relays.push(Relay {
            surface,
            is_reversed,
            is_sign: false,
            // both branches are the same there
            at_zero: 1.0,
        });
        modes.push(mode);
        let branches = graph.substitute(&[kink.above, kink.below], &replaced);
        replaced.insert(node, graph.select(mode, branches[0], branches[1]));
    }
    let all: Vec<Node> = arguments.iter().chain(&modes).copied().collect();
    Ok(Some(Taken {
        roots: graph.substitute(roots, &replaced),
        modes,
        held: Held {
            relays,
            surfaces: Tape::new(graph, &all, &surfaces)?,
            names: surfaces
                .iter()
                .map(|&q| format!("{} = 0", graph.render(q, 60)))
                .collect(),
        },
    }))
}

/// An operation that jumps.
struct Jump {
    /// what changes its sign there
    quantity: Node,
    /// the operation is that sign
    is_sign: bool,
    /// its value where the quantity is zero
    at_zero: f64,
}

impl Jump {
    fn of(graph: &Graph, node: Node) -> Option<Self> {
        let relation = |a: Node, b: Node, at_zero: f64| Self {
            quantity: graph.binary(Binary::Sub, b, a),
            is_sign: false,
            at_zero,
        };
        match graph.op(node) {
            Op::Unary(Unary::Sign, quantity) => Some(Self {
                quantity,
                is_sign: true,
                at_zero: 0.0,
            }),
            Op::Binary(Binary::Less, a, b) => Some(relation(a, b, 0.0)),
            Op::Binary(Binary::LessEq, a, b) => Some(relation(a, b, 1.0)),
            _ => None,
        }
    }
}

/// An operation that is one expression where a quantity is positive and another one where it is
/// negative.
struct Kink {
    quantity: Node,
    above: Node,
    below: Node,
}

fn kink(graph: &Graph, node: Node) -> Option<Kink> {
    let between = |a: Node, b: Node, above: Node, below: Node| Kink {
        quantity: graph.binary(Binary::Sub, a, b),
        above,
        below,
    };
    match graph.op(node) {
        Op::Unary(Unary::Abs, a) => Some(Kink {
            quantity: a,
            above: a,
            below: graph.unary(Unary::Neg, a),
        }),
        Op::Binary(Binary::Max, a, b) => Some(between(a, b, a, b)),
        Op::Binary(Binary::Min, a, b) => Some(between(a, b, b, a)),
        _ => None,
    }
}

/// The place of a surface, and whether it stands there with the other sign; a new one where it
/// is none yet.
fn place(graph: &Graph, surfaces: &mut Vec<Node>, quantity: Node) -> (usize, bool) {
    found(graph, surfaces, quantity).unwrap_or_else(|| {
        let (quantity, is_reversed) = bare(graph, quantity);
        surfaces.push(quantity);
        (surfaces.len() - 1, is_reversed)
    })
}

fn found(graph: &Graph, surfaces: &[Node], quantity: Node) -> Option<(usize, bool)> {
    let (quantity, is_reversed) = bare(graph, quantity);
    let known = |sought: Node| surfaces.iter().position(|&known| known == sought);
    let same = known(quantity).map(|surface| (surface, is_reversed));
    same.or_else(|| match graph.op(quantity) {
        Op::Binary(Binary::Sub, a, b) => {
            let opposite = graph.binary(Binary::Sub, b, a);
            known(opposite).map(|surface| (surface, !is_reversed))
        }
        _ => None,
    })
}

/// A quantity without its constant factors, and whether they change its sign: multiples of one
/// another vanish on one surface.
fn bare(graph: &Graph, mut quantity: Node) -> (Node, bool) {
    let factor = |node: Node| graph.constant_value(node).filter(|c| c.is_normal());
    let is_zero = |node: Node| graph.constant_value(node) == Some(0.0);
    let mut is_reversed = false;
    loop {
        let (inner, sign) = match graph.op(quantity) {
            Op::Unary(Unary::Neg, a) => (a, -1.0),
            Op::Binary(Binary::Mul, a, b) => match (factor(a), factor(b)) {
                (Some(c), _) => (b, c),
                (_, Some(c)) => (a, c),
                _ => return (quantity, is_reversed),
            },
            Op::Binary(Binary::Div, a, b) => match factor(b) {
                Some(c) => (a, c),
                None => return (quantity, is_reversed),
            },
            Op::Binary(Binary::Add | Binary::Sub, a, b) if is_zero(b) => (a, 1.0),
            Op::Binary(Binary::Add, a, b) if is_zero(a) => (b, 1.0),
            Op::Binary(Binary::Sub, a, b) if is_zero(a) => (b, -1.0),
            _ => return (quantity, is_reversed),
        };
        is_reversed ^= sign < 0.0;
        quantity = inner;
    }
}
