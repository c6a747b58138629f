//! Which operations jump or bend, with time and with the state, and the expressions with what jumps
//! taken out.
//!
//! An operation that jumps is replaced by a *mode*: an input of its own, constant between two
//! events, so that both one-sided limits at an event are right and an integrator never steps across
//! a jump. What depends on nothing but time is a time event; the others are state events. Where
//! something bends, an integrator stops too, but no mode is needed.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Op, Tape, Unary};

use super::filippov::Jump;
use super::guards::Surface;
use super::time::{Indicator, TimeEvents};

/// Characters of an expression in the label of a mode that changes with time,
const SHOWN: usize = 80;

/// and of one that changes with the state.
const SHOWN_OF_STATE: usize = 60;

/// The first operation of the roots that jumps with one of `inputs`, as it reads.
pub fn first_jump(graph: &Graph, inputs: &[Node], roots: &[Node]) -> Option<String> {
    let jumps = |node: &Node| has_sides(graph.op(*node)) && depends(graph, *node, inputs);
    let found = graph.reachable(roots).into_iter().find(jumps)?;
    Some(graph.render(found, SHOWN_OF_STATE))
}

/// Whether it jumps from one side of a surface to the other: what is equal is so on the surface alone.
fn has_sides(op: Op) -> bool {
    matches!(
        op,
        Op::Unary(Unary::Floor | Unary::Sign, _) | Op::Binary(Binary::Less | Binary::LessEq, ..)
    )
}

/// An operation that jumps or bends where a quantity passes zero; a `floor`, a whole number.
#[derive(Clone, Copy)]
struct Operation {
    /// the smooth function whose passing zero (`Floor`: an integer) changes it; a relation holds where it
    /// is positive
    quantity: Node,
    /// what is constant between two instants at which it jumps or bends with time
    mode: Node,
    /// what it is where the quantity is positive and where it is negative, if it bends
    branches: Option<[Node; 2]>,
    /// its values below, on and above the surface; none for a `floor`, whose value is held. What bends
    /// is told by whether it is above: both branches are the same on the surface
    values: Option<[f64; 3]>,
}

impl Operation {
    /// Of a node, with what jumps inside replaced.
    fn of(graph: &Graph, node: Node, map: &HashMap<Node, Node>) -> Option<Self> {
        let within = |a: Node| graph.substitute(&[a], map).first().copied().unwrap_or(a);
        let [strict, loose, sign] = [[0.0, 0.0, 1.0], [0.0, 1.0, 1.0], [-1.0, 0.0, 1.0]];
        let (quantity, mode, branches, values) = match graph.op(node) {
            Op::Unary(op @ (Unary::Floor | Unary::Sign), a) => {
                let a = within(a);
                let values = (op == Unary::Sign).then_some(sign);
                (a, graph.unary(op, a), None, values)
            }
            Op::Unary(Unary::Abs, a) => {
                let a = within(a);
                let mode = graph.unary(Unary::Sign, a);
                let branches = [a, graph.unary(Unary::Neg, a)];
                (a, mode, Some(branches), Some(loose))
            }
            Op::Binary(op @ (Binary::Less | Binary::LessEq | Binary::Equal), a, b) => {
                let (a, b) = (within(a), within(b));
                let quantity = graph.binary(Binary::Sub, b, a);
                let values = if op == Binary::Less { strict } else { loose };
                (quantity, graph.binary(op, a, b), None, Some(values))
            }
            Op::Binary(op @ (Binary::Min | Binary::Max), a, b) => {
                let (a, b) = (within(a), within(b));
                let quantity = graph.binary(Binary::Sub, a, b);
                let mode = graph.binary(Binary::Less, a, b);
                let branches = if op == Binary::Min { [b, a] } else { [a, b] };
                (quantity, mode, Some(branches), Some(loose))
            }
            _ => return None,
        };
        Some(Self {
            quantity,
            mode,
            branches,
            values,
        })
    }

    /// Whether it jumps and does not only bend.
    fn jumps(&self) -> bool {
        self.branches.is_none()
    }

    /// The node over its mode, smooth where the mode stays.
    fn over_mode(&self, graph: &Graph, node: Node, mode: Node) -> Node {
        match (self.branches, graph.op(node)) {
            (None, _) => mode,
            (Some(_), Op::Unary(..)) => graph.binary(Binary::Mul, mode, self.quantity),
            (Some([above, below]), _) => graph.select(mode, below, above),
        }
    }
}

/// Replaces what jumps with `time` alone in `roots` by modes: their symbols.
pub(crate) fn time_events(
    graph: &Graph,
    time: Node,
    roots: &mut Vec<Node>,
) -> Result<(Vec<Node>, TimeEvents), MissingInput> {
    let (mut outer, mut inner) = (HashMap::new(), HashMap::new());
    let (mut jumps, mut modes, mut found, mut indicators) = (vec![], vec![], vec![], vec![]);
    for node in graph.reachable(roots) {
        let operation = Operation::of(graph, node, &inner);
        let of_time = operation.filter(|_| graph.symbols_of(&[node]) == [time]);
        let Some(operation) = of_time else {
            continue;
        };
        let expression = graph.render(node, SHOWN);
        let symbol = graph.fresh(format!("({expression})")).node();
        let (nodes, counts) = (
            [operation.mode, operation.quantity],
            operation.values.is_none(),
        );
        let indicator = Indicator::new(graph, time, &found, nodes, expression, counts)?;
        indicators.push(indicator);
        inner.insert(node, operation.over_mode(graph, node, symbol));
        found.push(symbol);
        if operation.jumps() {
            outer.insert(node, symbol);
            jumps.push(node);
            modes.push(symbol);
        }
    }
    let values = Tape::new(graph, &[time], &jumps)?;
    *roots = graph.substitute(roots, &outer);
    Ok((modes, TimeEvents::new(indicators, &values)))
}

/// Takes every `sign`, `<` and `≤` that depends on one of `inputs` out of the roots, and every `floor`
/// that one of the first `moving` roots reads, over the surfaces on which they jump, and replaces them by
/// modes. Several that change on one surface change together. The symbols of the modes come first.
pub(crate) fn state_events(
    graph: &Graph,
    inputs: &[Node],
    roots: &mut Vec<Node>,
    moving: usize,
) -> (Vec<Node>, Vec<Jump>, Vec<Surface>) {
    let mut replaced: HashMap<Node, Node> = HashMap::new();
    let (mut jumps, mut modes, mut surfaces) = (vec![], vec![], vec![]);
    let moves: HashSet<Node> = graph.reachable(&roots[..moving]).into_iter().collect();
    for node in graph.reachable(roots) {
        let op = graph.op(node);
        // the steps of a reading do not stop the state
        let is_still = matches!(op, Op::Unary(Unary::Floor, _)) && !moves.contains(&node);
        if !has_sides(op) || is_still || !depends(graph, node, inputs) {
            continue;
        }
        let Some(operation) = Operation::of(graph, node, &replaced) else {
            continue;
        };
        let mode = graph.fresh(graph.render(node, SHOWN_OF_STATE)).node();
        let values = operation.values;
        let place = place_of(graph, &mut surfaces, operation.quantity, values.is_none());
        jumps.push(Jump::new(place, values));
        modes.push(mode);
        replaced.insert(node, mode);
    }
    // a kink on a surface that is located is smooth on each side, and no step is rejected for it
    for node in graph.reachable(roots) {
        let operation = Operation::of(graph, node, &replaced).filter(|_| !surfaces.is_empty());
        let Some((operation, [above, below])) = operation.and_then(|o| Some((o, o.branches?)))
        else {
            continue;
        };
        let Some(place) = known_place(graph, &surfaces, operation.quantity) else {
            continue;
        };
        let mode = graph.fresh(graph.render(node, SHOWN_OF_STATE)).node();
        jumps.push(Jump::new(place, operation.values));
        modes.push(mode);
        replaced.insert(node, graph.select(mode, above, below));
    }
    *roots = graph.substitute(roots, &replaced);
    (modes, jumps, surfaces)
}

/// What vanishes where one of the roots bends with one of `inputs`, each once.
pub(crate) fn bends(graph: &Graph, inputs: &[Node], roots: &[Node]) -> Vec<Node> {
    let mut found = vec![];
    for node in graph.reachable(roots) {
        let bends = Operation::of(graph, node, &HashMap::new()).filter(|o| !o.jumps());
        let Some(operation) = bends.filter(|_| depends(graph, node, inputs)) else {
            continue;
        };
        let (quantity, _) = bare(graph, operation.quantity);
        if !found.contains(&quantity) {
            found.push(quantity);
        }
    }
    found
}

fn depends(graph: &Graph, node: Node, inputs: &[Node]) -> bool {
    graph.symbols_of(&[node]).iter().any(|s| inputs.contains(s))
}

/// The place of a surface, and whether it stands there with the other sign; a new one where it is none
/// yet. Where the quantity counts two new ones, for the whole numbers that it meets next: the first.
fn place_of(
    graph: &Graph,
    surfaces: &mut Vec<Surface>,
    quantity: Node,
    counts: bool,
) -> (usize, bool) {
    if let Some(known) = known_place(graph, surfaces, quantity).filter(|_| !counts) {
        return known;
    }
    let (node, is_reversed) = match counts {
        true => (quantity, false),
        false => bare(graph, quantity),
    };
    let level = if counts { "a whole number" } else { "0" };
    let surface = Surface {
        node,
        name: format!("{} = {level}", graph.render(node, SHOWN_OF_STATE)),
        counts,
        is_watched: false,
    };
    let place = surfaces.len();
    surfaces.resize(place + if counts { 2 } else { 1 }, surface);
    (place, is_reversed)
}

fn known_place(graph: &Graph, surfaces: &[Surface], quantity: Node) -> Option<(usize, bool)> {
    let (quantity, is_reversed) = bare(graph, quantity);
    let known = |sought: Node| {
        let mut all = surfaces.iter();
        all.position(|surface| surface.node == sought && !surface.counts)
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

/// A quantity without its constant factors, and whether they change its sign: multiples of one
/// another vanish on one surface.
fn bare(graph: &Graph, mut quantity: Node) -> (Node, bool) {
    let factor = |node: Node| graph.constant_value(node).filter(|c| c.is_normal());
    let is_zero = |node: Node| graph.constant_value(node) == Some(0.0);
    let mut is_reversed = false;
    loop {
        let simpler = match graph.op(quantity) {
            Op::Unary(Unary::Neg, a) => Some((a, -1.0)),
            Op::Binary(Binary::Mul, a, b) if let Some(c) = factor(a) => Some((b, c)),
            Op::Binary(Binary::Mul | Binary::Div, a, b) => factor(b).map(|c| (a, c)),
            Op::Binary(Binary::Add | Binary::Sub, a, b) if is_zero(b) => Some((a, 1.0)),
            Op::Binary(Binary::Add, a, b) if is_zero(a) => Some((b, 1.0)),
            Op::Binary(Binary::Sub, a, b) if is_zero(a) => Some((b, -1.0)),
            _ => None,
        };
        let Some((inner, sign)) = simpler else {
            return (quantity, is_reversed);
        };
        is_reversed ^= sign < 0.0;
        quantity = inner;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Expr;

    fn instants(build: fn(Expr<'_>) -> Expr<'_>, from: f64, to: f64) -> Vec<f64> {
        let g = Graph::new();
        let time = g.symbol("time");
        let root = build(time).node();
        let (_, mut events) = time_events(&g, time.node(), &mut vec![root]).unwrap();
        let mut times = vec![];
        events.instants(from, to, &mut times).unwrap();
        times.sort_unstable_by(f64::total_cmp);
        times
    }

    #[test]
    fn affine_relations_are_solved_to_the_last_bit() {
        fn relation(t: Expr<'_>) -> Expr<'_> {
            (20.0 - t * 2.0).less_eq(t * 3.0 + 10.0)
        }
        let found = instants(|t| relation(t) * 3.0, 0.0, 10.0);
        assert!(
            found.len() == 1 && (found[0] - 2.0).abs() <= f64::EPSILON,
            "{found:?}"
        );
        assert_eq!(instants(|t| relation(t) * 3.0, 2.0, 10.0), []);
        assert_eq!(instants(|t| (t * 0.5).floor(), 0.0, 6.0), [2.0, 4.0]);
        assert_eq!(instants(|t| (1.0 - t).sign(), 0.0, 6.0), [1.0]);
        assert_eq!(instants(|t| t.sin(), 0.0, 6.0), []);
    }

    #[test]
    fn kinks_are_stops_too() {
        assert_eq!(instants(|t| (t - 3.0).abs(), 0.0, 6.0), [3.0]);
        assert_eq!(
            instants(|t| (t / 5.0).min(t.graph().constant(0.5)), 0.0, 6.0),
            [2.5]
        );
    }

    #[test]
    fn other_relations_are_bisected_to_the_last_bit() {
        let found = instants(|t| t.sin().less(t.graph().constant(0.5)), 0.0, 7.0);
        let expected = [
            std::f64::consts::FRAC_PI_6,
            5.0 * std::f64::consts::FRAC_PI_6,
            13.0 * std::f64::consts::FRAC_PI_6,
        ];
        assert_eq!(found.len(), 3);
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 4e-15, "{found} {expected}");
        }
    }

    #[test]
    fn relations_of_states_are_left_alone() {
        let g = Graph::new();
        let [time, x] = ["time", "x"].map(|name| g.symbol(name));
        let root = (x.less(time) + x.floor()).node();
        let mut roots = vec![root];
        let (modes, _) = time_events(&g, time.node(), &mut roots).unwrap();
        assert_eq!((modes.len(), roots), (0, vec![root]));
    }

    #[test]
    fn modes_do_not_take_names_in_use() {
        let g = Graph::new();
        let time = g.symbol("time");
        let relation = time.less(g.constant(2.0));
        let taken = g.symbol("(time < 2)");
        let mut roots = vec![(taken + relation).node()];
        let (modes, _) = time_events(&g, time.node(), &mut roots).unwrap();
        assert_ne!(modes[0], taken.node());
        let expected = (taken + g.expr(modes[0])).node();
        assert_eq!(roots, [expected]);
    }
}
