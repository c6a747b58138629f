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
/// where there is none. Several that change on one surface change together.
pub(crate) fn take(
    graph: &Graph,
    inputs: &[Node],
    roots: &[Node],
) -> Result<Option<Taken>, MissingInput> {
    let mut replaced: HashMap<Node, Node> = HashMap::new();
    let (mut relays, mut modes, mut surfaces) = (vec![], vec![], vec![]);
    for node in graph.reachable(roots) {
        let Some((quantity, is_sign)) = quantity(graph, node) else {
            continue;
        };
        if !graph.symbols_of(&[node]).iter().any(|s| inputs.contains(s)) {
            continue;
        }
        let quantity = graph.substitute(&[quantity], &replaced)[0];
        let mode = graph.fresh(graph.render(node, 60)).node();
        let (surface, is_reversed) = place(graph, &mut surfaces, quantity);
        relays.push(Relay {
            surface,
            is_reversed,
            is_sign,
        });
        modes.push(mode);
        replaced.insert(node, mode);
    }
    if relays.is_empty() {
        return Ok(None);
    }
    let all: Vec<Node> = inputs.iter().chain(&modes).copied().collect();
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

/// What changes its sign where the operation jumps, and whether the operation is that sign.
fn quantity(graph: &Graph, node: Node) -> Option<(Node, bool)> {
    match graph.op(node) {
        Op::Unary(Unary::Sign, a) => Some((a, true)),
        Op::Binary(Binary::Less | Binary::LessEq, a, b) => {
            Some((graph.binary(Binary::Sub, b, a), false))
        }
        _ => None,
    }
}

/// The place of a surface, and whether it stands there with the other sign.
fn place(graph: &Graph, surfaces: &mut Vec<Node>, quantity: Node) -> (usize, bool) {
    let opposite = match graph.op(quantity) {
        Op::Unary(Unary::Neg, a) => a,
        Op::Binary(Binary::Sub, a, b) => graph.binary(Binary::Sub, b, a),
        _ => graph.unary(Unary::Neg, quantity),
    };
    for (sought, is_reversed) in [(quantity, false), (opposite, true)] {
        if let Some(surface) = surfaces.iter().position(|&known| known == sought) {
            return (surface, is_reversed);
        }
    }
    surfaces.push(quantity);
    (surfaces.len() - 1, false)
}
