//! Which operations jump with the state, and on which surfaces.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::{Held, Kind, Relay};

/// Expressions in which each jump of the state is an input of its own.
pub(crate) struct Taken {
    pub roots: Vec<Node>,
    /// the symbols of these inputs
    pub modes: Vec<Node>,
    /// what vanishes on the surfaces
    pub surfaces: Vec<Node>,
    pub held: Held,
}

/// Takes every `sign`, `<` and `≤` that depends on one of `inputs` out of the roots, and every `floor`
/// that one of the first `moving` roots reads; none where there is none. Several that change on one
/// surface change together.
pub(crate) fn take(graph: &Graph, inputs: &[Node], roots: &[Node], moving: usize) -> Option<Taken> {
    let mut replaced: HashMap<Node, Node> = HashMap::new();
    let (mut relays, mut modes) = (vec![], vec![]);
    let mut surfaces = Surfaces::default();
    let moves: HashSet<Node> = graph.reachable(&roots[..moving]).into_iter().collect();
    for node in graph.reachable(roots) {
        let Some(jump) = Jump::of(graph, node) else {
            continue;
        };
        if jump.kind == Kind::Floor && !moves.contains(&node) {
            // the steps of a reading do not stop the state
            continue;
        }
        if !depends(graph, node, inputs) {
            continue;
        }
        let quantity = graph.substitute(&[jump.quantity], &replaced)[0];
        let mode = graph.fresh(graph.render(node, 60)).node();
        let (surface, is_reversed) = match jump.kind {
            Kind::Floor => (surfaces.counting(quantity), false),
            _ => surfaces.place(graph, quantity),
        };
        relays.push(Relay {
            surface,
            is_reversed,
            kind: jump.kind,
            at_zero: jump.at_zero,
        });
        modes.push(mode);
        replaced.insert(node, mode);
    }
    if relays.is_empty() {
        return None;
    }
    // a kink on a surface that is located is smooth on each side, and no step is rejected for it
    for node in graph.reachable(roots) {
        let Some(kink) = kink(graph, node) else {
            continue;
        };
        let quantity = graph.substitute(&[kink.quantity], &replaced)[0];
        let Some((surface, is_reversed)) = surfaces.found(graph, quantity) else {
            continue;
        };
        let mode = graph.fresh(graph.render(node, 60)).node();
        relays.push(Relay {
            surface,
            is_reversed,
            kind: Kind::Truth,
            // both branches are the same there
            at_zero: 1.0,
        });
        modes.push(mode);
        let branches = graph.substitute(&[kink.above, kink.below], &replaced);
        replaced.insert(node, graph.select(mode, branches[0], branches[1]));
    }
    let names = surfaces.nodes.iter().zip(&surfaces.counts);
    let name = |(&q, &counts): (&Node, &bool)| match counts {
        true => format!("{} = a whole number", graph.render(q, 60)),
        false => format!("{} = 0", graph.render(q, 60)),
    };
    Some(Taken {
        roots: graph.substitute(roots, &replaced),
        modes,
        held: Held {
            relays,
            names: names.map(name).collect(),
            counts: surfaces.counts,
        },
        surfaces: surfaces.nodes,
    })
}

/// What vanishes where one of the roots bends with one of `inputs`, each once.
pub(crate) fn bends(graph: &Graph, inputs: &[Node], roots: &[Node]) -> Vec<Node> {
    let mut found = vec![];
    for node in graph.reachable(roots) {
        let Some(kink) = kink(graph, node).filter(|_| depends(graph, node, inputs)) else {
            continue;
        };
        let (quantity, _) = bare(graph, kink.quantity);
        if !found.contains(&quantity) {
            found.push(quantity);
        }
    }
    found
}

/// The first operation of the roots that jumps with one of `inputs`, as it reads.
pub fn first_jump(graph: &Graph, inputs: &[Node], roots: &[Node]) -> Option<String> {
    let jumps = |node: &Node| Jump::of(graph, *node).is_some() && depends(graph, *node, inputs);
    let found = graph.reachable(roots).into_iter().find(jumps)?;
    Some(graph.render(found, 60))
}

fn depends(graph: &Graph, node: Node, inputs: &[Node]) -> bool {
    graph.symbols_of(&[node]).iter().any(|s| inputs.contains(s))
}

/// An operation that jumps.
struct Jump {
    /// what changes its sign there
    quantity: Node,
    kind: Kind,
    /// its value where the quantity is zero
    at_zero: f64,
}

impl Jump {
    fn of(graph: &Graph, node: Node) -> Option<Self> {
        let relation = |a: Node, b: Node, at_zero: f64| Self {
            quantity: graph.binary(Binary::Sub, b, a),
            kind: Kind::Truth,
            at_zero,
        };
        match graph.op(node) {
            Op::Unary(Unary::Sign, quantity) => Some(Self {
                quantity,
                kind: Kind::Sign,
                at_zero: 0.0,
            }),
            Op::Unary(Unary::Floor, quantity) => Some(Self {
                quantity,
                kind: Kind::Floor,
                at_zero: 1.0,
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

/// The surfaces found, by what vanishes on them.
#[derive(Default)]
struct Surfaces {
    nodes: Vec<Node>,
    /// one of two on which a `floor` jumps
    counts: Vec<bool>,
}

impl Surfaces {
    /// The place of a surface, and whether it stands there with the other sign; a new one where it
    /// is none yet.
    fn place(&mut self, graph: &Graph, quantity: Node) -> (usize, bool) {
        self.found(graph, quantity).unwrap_or_else(|| {
            let (quantity, is_reversed) = bare(graph, quantity);
            self.nodes.push(quantity);
            self.counts.push(false);
            (self.nodes.len() - 1, is_reversed)
        })
    }

    /// Two new ones, for the whole numbers that a quantity meets next; the place of the first.
    fn counting(&mut self, quantity: Node) -> usize {
        self.nodes.extend([quantity, quantity]);
        self.counts.extend([true, true]);
        self.nodes.len() - 2
    }

    fn found(&self, graph: &Graph, quantity: Node) -> Option<(usize, bool)> {
        let (quantity, is_reversed) = bare(graph, quantity);
        let known = |sought: Node| {
            let mut all = self.nodes.iter().zip(&self.counts);
            all.position(|(&known, counts)| known == sought && !counts)
        };
        let same = known(quantity).map(|surface| (surface, is_reversed));
        same.or_else(|| match graph.op(quantity) {
            Op::Binary(Binary::Sub, a, b) => {
                let opposite = graph.binary(Binary::Sub, b, a);
                known(opposite).map(|surface| (surface, !is_reversed))
            }
            _ => None,
        })
    }
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
