//! Whether an expression may jump on a cell.

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Binary, Graph, Interval, MissingInput, Node, Op, Tape, Unary};

use crate::Region;
use crate::region::Cell;

/// Whether the expression may jump on a cell of the region: intervals cannot exclude that a
/// condition changes there, a sign, a rounding, or that an angle passes its cut. Where it does not,
/// and is defined, a change of sign is a zero.
///
/// # Errors
/// [`MissingInput`] where the node depends on a symbol outside the region.
pub(crate) fn may_jump(
    graph: &Graph,
    node: Node,
    region: &Region,
    cell: &Cell,
) -> Result<bool, MissingInput> {
    // what may jump, as expressions that then must not pass zero or a whole number
    let (mut arguments, mut kinds) = (vec![], vec![]);
    let mut watch = |kind: Kind, argument: Node| {
        kinds.push(kind);
        arguments.push(argument);
    };
    for node in graph.reachable(&[node]) {
        match graph.op(node) {
            Op::Select(condition, ..) => watch(Kind::Constant, condition),
            Op::Unary(Unary::Sign, a) => watch(Kind::Signed, a),
            Op::Unary(Unary::Floor, _) => watch(Kind::Constant, node),
            Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, a, b) => {
                let difference = graph.expr(a) - graph.expr(b);
                watch(Kind::Signed, difference.node());
            }
            Op::Binary(Binary::Atan2, _, x) => watch(Kind::Positive, x),
            _ => {}
        }
    }
    let tape = Tape::new(graph, &region.symbols(), &arguments)?;
    let values = tape.eval_in(&Intervals, cell);
    let mut watched = kinds.iter().zip(&values);
    Ok(!watched.all(|(kind, value)| kind.holds(value)))
}

/// What has to hold of a value.
enum Kind {
    Constant,
    Signed,
    Positive,
}

impl Kind {
    fn holds(&self, value: &Interval) -> bool {
        value.is_defined()
            && match self {
                Kind::Constant => value.lo() == value.hi(),
                Kind::Signed => value.is_positive() || value.is_negative(),
                Kind::Positive => value.is_positive(),
            }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dimension;

    #[test]
    fn jumps_are_seen_where_they_are() {
        let g = Graph::new();
        let x = g.symbol("x");
        let region = Region {
            dimensions: vec![Dimension {
                name: "x".into(),
                symbol: x.node(),
                min: -5.0,
                max: 5.0,
                integer: false,
            }],
        };
        let jumps = |node: Node, low: f64, high: f64| {
            may_jump(&g, node, &region, &vec![Interval::new(low, high).unwrap()]).unwrap()
        };
        let sign = g.unary(Unary::Sign, x.node());
        assert!(jumps(sign, -1.0, 1.0) && !jumps(sign, 0.5, 1.0));
        let floor = g.unary(Unary::Floor, x.node());
        assert!(jumps(floor, 0.5, 1.5) && !jumps(floor, 1.25, 1.5));
        let angle = g.binary(Binary::Atan2, g.constant(1.0).node(), x.node());
        assert!(jumps(angle, -1.0, 1.0) && !jumps(angle, 1.0, 2.0));
        assert!(!jumps(g.unary(Unary::Abs, x.node()), -1.0, 1.0));
        let less = g.binary(Binary::Less, x.node(), g.constant(2.0).node());
        let choice = g.select(less, x.node(), g.constant(0.0).node());
        assert!(jumps(choice, 1.0, 3.0) && !jumps(choice, 1.0, 1.5));
    }
}
