//! Which nodes jump or have kinks with time, and the functions that decide when.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, MissingInput, Node, Op, Tape, Unary};

use super::indicator::{Indicator, Parts};
use super::{Extracted, Switches};

/// Characters of an expression in a mode's label.
const SHOWN: usize = 80;

/// Replaces what jumps with `time` in `roots` by modes.
pub(super) fn extract(
    graph: &Graph,
    time: Node,
    roots: &[Node],
) -> Result<Extracted, MissingInput> {
    let of_time = functions_of_time(graph, time, roots);
    let (mut outer, mut inner) = (HashMap::new(), HashMap::new());
    let (mut jumps, mut modes, mut found, mut indicators) = (vec![], vec![], vec![], vec![]);
    for node in graph.reachable(roots) {
        let known = of_time.get(&node) == Some(&true);
        let Some(switch) = known.then(|| Switch::of(graph, node)).flatten() else {
            continue;
        };
        let label = format!("({})", graph.render(node, SHOWN));
        let symbol = graph.fresh(label).node();
        let switch = switch.within(graph, &inner);
        indicators.push(switch.indicator(graph, time, &found, node)?);
        inner.insert(node, switch.replacement(graph, symbol));
        found.push(symbol);
        if switch.jumps() {
            outer.insert(node, symbol);
            jumps.push(node);
            modes.push(symbol);
        }
    }
    let values = Tape::new(graph, &[time], &jumps)?;
    Ok(Extracted {
        roots: graph.substitute(roots, &outer),
        modes,
        switches: Switches::new(indicators, &values),
    })
}

/// Nodes whose value is a function of time alone: true where time is used,
/// false for constants.
fn functions_of_time(graph: &Graph, time: Node, roots: &[Node]) -> HashMap<Node, bool> {
    let mut uses: HashMap<Node, bool> = HashMap::new();
    for node in graph.reachable(roots) {
        if node == time {
            uses.insert(node, true);
            continue;
        }
        if let Op::Symbol(_) = graph.op(node) {
            continue;
        }
        let arguments = graph.arguments(node);
        let known: Option<Vec<bool>> = arguments.iter().map(|a| uses.get(a).copied()).collect();
        if let Some(known) = known {
            uses.insert(node, known.contains(&true));
        }
    }
    uses
}

/// A node that jumps or has a kink, by what decides it.
#[derive(Clone, Copy, Debug)]
enum Switch {
    Floor(Node),
    Sign(Node),
    Relation(Binary, Node, Node),
    Abs(Node),
    /// `Min` or `Max`
    Extreme(Binary, Node, Node),
}

impl Switch {
    fn of(graph: &Graph, node: Node) -> Option<Self> {
        Some(match graph.op(node) {
            Op::Unary(Unary::Floor, a) => Self::Floor(a),
            Op::Unary(Unary::Sign, a) => Self::Sign(a),
            Op::Unary(Unary::Abs, a) => Self::Abs(a),
            Op::Binary(op @ (Binary::Less | Binary::LessEq | Binary::Equal), a, b) => {
                Self::Relation(op, a, b)
            }
            Op::Binary(op @ (Binary::Min | Binary::Max), a, b) => Self::Extreme(op, a, b),
            _ => return None,
        })
    }

    fn jumps(self) -> bool {
        matches!(self, Self::Floor(_) | Self::Sign(_) | Self::Relation(..))
    }

    /// The same with what switches inside replaced.
    fn within(self, graph: &Graph, map: &HashMap<Node, Node>) -> Self {
        let one = |a: Node| graph.substitute(&[a], map).first().copied().unwrap_or(a);
        match self {
            Self::Floor(a) => Self::Floor(one(a)),
            Self::Sign(a) => Self::Sign(one(a)),
            Self::Abs(a) => Self::Abs(one(a)),
            Self::Relation(op, a, b) => Self::Relation(op, one(a), one(b)),
            Self::Extreme(op, a, b) => Self::Extreme(op, one(a), one(b)),
        }
    }

    /// The node over its mode, smooth where the mode stays.
    fn replacement(self, graph: &Graph, mode: Node) -> Node {
        match self {
            Self::Floor(_) | Self::Sign(_) | Self::Relation(..) => mode,
            Self::Abs(a) => graph.binary(Binary::Mul, mode, a),
            Self::Extreme(Binary::Min, a, b) => graph.select(mode, a, b),
            Self::Extreme(_, a, b) => graph.select(mode, b, a),
        }
    }

    /// What the mode is: constant between switches.
    fn mode(self, graph: &Graph) -> Node {
        match self {
            Self::Floor(a) => graph.unary(Unary::Floor, a),
            Self::Sign(a) | Self::Abs(a) => graph.unary(Unary::Sign, a),
            Self::Relation(op, a, b) => graph.binary(op, a, b),
            Self::Extreme(_, a, b) => graph.binary(Binary::Less, a, b),
        }
    }

    /// The smooth function whose passing an integer (`Floor`) or zero changes the mode.
    fn quantity(self, graph: &Graph) -> Node {
        match self {
            Self::Floor(a) | Self::Sign(a) | Self::Abs(a) => a,
            Self::Relation(_, a, b) | Self::Extreme(_, a, b) => graph.binary(Binary::Sub, a, b),
        }
    }

    /// `modes` are the symbols of the switches before; `node` is what it is called.
    fn indicator(
        self,
        graph: &Graph,
        time: Node,
        modes: &[Node],
        node: Node,
    ) -> Result<Indicator, MissingInput> {
        let (mode, quantity) = (self.mode(graph), self.quantity(graph));
        let symbols = graph.symbols_of(&[mode, quantity]);
        let reads: Vec<usize> = (0..modes.len())
            .filter(|&i| symbols.contains(&modes[i]))
            .collect();
        let mut inputs = vec![time];
        inputs.extend(reads.iter().map(|&i| modes[i]));
        Ok(Indicator::new(Parts {
            expression: graph.render(node, SHOWN),
            counts: matches!(self, Self::Floor(_)),
            mode: Tape::new(graph, &inputs, &[mode])?,
            quantity: Tape::new(graph, &inputs, &[quantity])?,
            reads,
        }))
    }
}
