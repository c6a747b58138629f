//! Derivatives of single operations.

use crate::{Binary, Expr, Graph, Node, Op, Unary};

/// How a node varies with its arguments.
pub(crate) enum Variation {
    /// Σ partial·d(argument); arguments with a zero partial are left out
    Sum(Vec<(Node, Node)>),
    /// d(first) where the condition holds, else d(second): the branch not taken
    /// must not spoil the derivative by 0·∞
    Choice(Node, Node, Node),
    /// result `entry` of a linear system or an implicit function
    Entry { system: Node, entry: u32 },
}

pub(crate) fn variation(graph: &Graph, node: Node) -> Variation {
    let value = graph.expr(node);
    match graph.op(node) {
        Op::Constant(_) | Op::Symbol(_) | Op::System(_) => Variation::Sum(vec![]),
        Op::Unary(op, a) => Variation::Sum(
            unary(op, graph.expr(a), value)
                .map(|slope| (a, slope.node()))
                .into_iter()
                .collect(),
        ),
        Op::Powi(_, 0) => Variation::Sum(vec![]),
        Op::Powi(a, n) => {
            let slope = f64::from(n) * graph.expr(a).powi(n.saturating_sub(1));
            Variation::Sum(vec![(a, slope.node())])
        }
        Op::Binary(op, a, b) => binary(graph, op, a, b, value),
        Op::Select(c, a, b) => Variation::Choice(c, a, b),
        Op::Entry(system, entry) => Variation::Entry { system, entry },
    }
}

/// Whether a slope can be infinite, or have no value, where the arguments are finite.
pub(crate) fn is_steep(op: Op) -> bool {
    match op {
        Op::Unary(op, _) => matches!(op, Unary::Sqrt | Unary::Ln | Unary::Asin | Unary::Acos),
        Op::Powi(_, exponent) => exponent < 0,
        Op::Binary(op, ..) => matches!(op, Binary::Div | Binary::Pow | Binary::Atan2),
        _ => false,
    }
}

/// df/da; none where it is zero almost everywhere.
fn unary<'g>(op: Unary, a: Expr<'g>, f: Expr<'g>) -> Option<Expr<'g>> {
    Some(match op {
        Unary::Neg => a.graph().constant(-1.0),
        Unary::Abs => a.sign(),
        Unary::Sign | Unary::Floor | Unary::Not => return None,
        Unary::Sqrt => 0.5 / f,
        Unary::Exp => f,
        Unary::Ln => 1.0 / a,
        Unary::Sin => a.cos(),
        Unary::Cos => -a.sin(),
        Unary::Tan => 1.0 + f.powi(2),
        Unary::Asin => 1.0 / (1.0 - a.powi(2)).sqrt(),
        Unary::Acos => -1.0 / (1.0 - a.powi(2)).sqrt(),
        Unary::Atan => 1.0 / (1.0 + a.powi(2)),
        Unary::Sinh => a.cosh(),
        Unary::Cosh => a.sinh(),
        Unary::Tanh => 1.0 - f.powi(2),
    })
}

fn binary(graph: &Graph, op: Binary, a: Node, b: Node, f: Expr<'_>) -> Variation {
    let (x, y) = (graph.expr(a), graph.expr(b));
    let (dx, dy) = match op {
        Binary::Add => (graph.constant(1.0), graph.constant(1.0)),
        Binary::Sub => (graph.constant(1.0), graph.constant(-1.0)),
        Binary::Mul => (y, x),
        Binary::Div => (1.0 / y, -(f / y)),
        Binary::Pow => (y * x.pow(y - 1.0), f * x.ln()),
        Binary::Atan2 => {
            let norm = x.powi(2) + y.powi(2);
            (y / norm, -(x / norm))
        }
        // where both are equal the slope is that of the one that is no constant: a limit that
        // is just reached hides nothing yet
        Binary::Min if graph.constant_value(a).is_some() => {
            return Variation::Choice(x.less(y).node(), a, b);
        }
        Binary::Max if graph.constant_value(a).is_some() => {
            return Variation::Choice(y.less(x).node(), a, b);
        }
        Binary::Min => return Variation::Choice(x.less_eq(y).node(), a, b),
        Binary::Max => return Variation::Choice(y.less_eq(x).node(), a, b),
        Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or => {
            return Variation::Sum(vec![]);
        }
    };
    Variation::Sum(vec![(a, dx.node()), (b, dy.node())])
}
