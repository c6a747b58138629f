//! Random graphs: recipes that can be followed again and again, on any graph.

use lynkeus_expr::{Algebra, Binary, Expr, Graph, Node, Nodes, Unary};
use proptest::prelude::*;
use proptest::sample::Index;

/// Symbols of every random graph.
pub const INPUTS: usize = 3;

#[derive(Clone, Debug)]
enum Kind {
    Constant(f64),
    Unary(Unary),
    Binary(Binary),
    Powi(i32),
    Select,
    Solve,
}

/// One operation on results of earlier steps.
#[derive(Clone, Debug)]
pub struct Step {
    kind: Kind,
    operands: [Index; 3],
}

/// What operands an operation is given.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Style {
    /// Earlier results as they are, wherever that leads.
    Wild,
    /// Earlier results brought into the domain of the operation, and kept from growing fast.
    Tame,
}

/// Recipes of `steps` operations.
pub fn recipe(steps: usize) -> impl Strategy<Value = Vec<Step>> {
    let kind = prop_oneof![
        1 => (-2.0..2.0).prop_map(Kind::Constant),
        1 => prop::sample::select(vec![0.0, 1.0, -1.0, 2.0]).prop_map(Kind::Constant),
        8 => prop::sample::select(&Unary::ALL[..]).prop_map(Kind::Unary),
        10 => prop::sample::select(&Binary::ALL[..]).prop_map(Kind::Binary),
        // Powers in which the order of the products makes no difference.
        2 => prop::sample::select(vec![-1, 0, 2, 3]).prop_map(Kind::Powi),
        1 => Just(Kind::Select),
        1 => Just(Kind::Solve),
    ];
    let step = (kind, any::<[Index; 3]>()).prop_map(|(kind, operands)| Step { kind, operands });
    prop::collection::vec(step, steps)
}

/// Recipes without linear systems.
pub fn without_systems(recipe: &[Step]) -> Vec<Step> {
    let keep = |step: &&Step| !matches!(step.kind, Kind::Solve);
    recipe.iter().filter(keep).cloned().collect()
}

/// The symbols of a random graph.
pub fn symbols(graph: &Graph) -> Vec<Node> {
    (0..INPUTS)
        .map(|i| graph.symbol(&format!("x{i}")).node())
        .collect()
}

/// Follows a recipe: the result of every step.
pub fn follow(recipe: &[Step], graph: &Graph, style: Style) -> Vec<Node> {
    let mut known = symbols(graph);
    if style == Style::Wild {
        return compute(recipe, &Nodes(graph), &known);
    }
    for step in recipe {
        let pick = |i: usize| graph.expr(*step.operands[i].get(&known));
        let [a, b, c] = [pick(0), pick(1), pick(2)];
        known.push(tame(graph, &step.kind, a, b, c));
    }
    known.split_off(INPUTS)
}

/// Follows a recipe in any algebra, operands as they are: with nodes for values it builds the wild graph, with numbers
/// it computes without any graph.
pub fn compute<A: Algebra>(recipe: &[Step], algebra: &A, inputs: &[A::Value]) -> Vec<A::Value> {
    let mut known = inputs.to_vec();
    for step in recipe {
        let [x, y, z] = step
            .operands
            .each_ref()
            .map(|operand| operand.get(&known).clone());
        let value = match step.kind {
            Kind::Constant(value) => algebra.constant(value),
            Kind::Unary(op) => algebra.unary(op, &x),
            // Graphs turn constant whole exponents into integer powers, which round differently.
            Kind::Binary(Binary::Pow) => {
                let exponent = algebra.binary(Binary::Add, &y, &algebra.constant(0.25));
                algebra.binary(Binary::Pow, &x, &exponent)
            }
            Kind::Binary(op) => algebra.binary(op, &x, &y),
            Kind::Powi(n) => algebra.powi(&x, n),
            Kind::Select => algebra.select(&x, &y, &z),
            Kind::Solve => algebra
                .solve(&[x.clone(), y.clone(), z.clone(), x], &[y, z])
                .0
                .remove(1),
        };
        known.push(value);
    }
    known.split_off(inputs.len())
}

fn tame<'g>(graph: &'g Graph, kind: &Kind, a: Expr<'g>, b: Expr<'g>, c: Expr<'g>) -> Node {
    let positive = 1.0 + a * a;
    let result = match *kind {
        Kind::Constant(value) => graph.constant(value),
        Kind::Unary(Unary::Sqrt) => positive.sqrt(),
        Kind::Unary(Unary::Ln) => positive.ln(),
        Kind::Unary(op @ (Unary::Asin | Unary::Acos)) => {
            graph.expr(graph.unary(op, (0.9 * a.sin()).node()))
        }
        Kind::Unary(op @ (Unary::Exp | Unary::Sinh | Unary::Cosh | Unary::Tan)) => {
            graph.expr(graph.unary(op, a.sin().node()))
        }
        Kind::Binary(Binary::Mul) => a * b.sin(),
        Kind::Binary(Binary::Div) => b / positive,
        Kind::Binary(Binary::Pow) => positive.pow(b.cos()),
        Kind::Binary(Binary::Atan2) => b.atan2(positive),
        Kind::Powi(n) => (2.0 + a.sin()).powi(n),
        Kind::Select => graph.expr(graph.select(a.less(b).node(), c.node(), (a - c).node())),
        Kind::Solve => {
            let diagonal = 3.0 + a.sin();
            let matrix = [diagonal, b.sin(), c.cos(), diagonal].map(|entry| entry.node());
            graph.expr(graph.solve(&matrix, &[b.node(), c.node()]).x[1])
        }
        Kind::Unary(op) => graph.expr(graph.unary(op, a.node())),
        Kind::Binary(op) => graph.expr(graph.binary(op, a.node(), b.node())),
    };
    result.node()
}
