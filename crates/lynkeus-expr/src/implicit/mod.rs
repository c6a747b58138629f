//! Implicit functions: the root z of g(z, p) = 0, for algebraic loops and equations that are
//! not linear in their unknown.
//!
//! The residual g and its derivatives are compiled once, when the function is made, and every
//! use shares them. By the implicit function theorem z' = −g_z⁻¹ g_p p', so that derivatives
//! of any order, symbols and bounds need nothing but g, g_z, g_p and linear systems.

mod newton;
mod series;

use std::collections::HashMap;
use std::hash::{Hash, Hasher};
use std::sync::Arc;

use crate::{
    Algebra, Binary, Graph, Interval, MissingInput, Node, Nodes, Op, Tape, Unary, jacobian,
};

/// Characters of an equation in a message.
const SHOWN: usize = 80;
/// Equations that a message spells out.
const SPELLED: usize = 3;

/// One of the unknowns z.
#[derive(Clone, Debug)]
pub struct ImplicitUnknown {
    /// the symbol that stands for it in the equations
    pub symbol: Node,
    /// where the search begins
    pub start: f64,
    /// where the root is looked for: one outside is none
    pub range: Interval,
}

/// The function p ↦ z with g(z, p) = 0 and z in its declared range. A clone shares the code;
/// two functions are equal where one is a clone of the other.
///
/// ```
/// use lynkeus_expr::{Graph, Implicit, ImplicitUnknown, Interval, Tape};
///
/// let g = Graph::new();
/// let (a, x) = (g.symbol("a"), g.symbol("x"));
/// let unknown = ImplicitUnknown { symbol: a.node(), start: 0.0, range: Interval::ENTIRE };
/// // a + exp(a) = x
/// let root = Implicit::solve(&g, &[unknown], &[(a + a.exp() - x).node()])?[0];
/// let tape = Tape::new(&g, &[x.node()], &[root])?;
/// let mut out = [0.0];
/// tape.evaluator().eval(&[1.0 + 1f64.exp()], &mut out);
/// assert!((out[0] - 1.0).abs() < 1e-15);
/// # Ok::<(), lynkeus_expr::MissingInput>(())
/// ```
#[derive(Clone, Debug)]
pub struct Implicit(Arc<Body>);

#[derive(Debug)]
struct Body {
    /// what the unknowns are called
    names: Vec<String>,
    /// the equations, for people
    equations: Vec<String>,
    start: Vec<f64>,
    range: Vec<Interval>,
    /// number of entries of p
    parameters: usize,
    /// g of (z, p)
    residual: Tape,
    by_unknowns: Slopes,
    by_parameters: Slopes,
    /// what is not continuous in g as z moves: each is constant where g does not jump
    steps: Tape,
}

/// The entries of a Jacobian that are not zero everywhere, as functions of (z, p).
#[derive(Debug)]
struct Slopes {
    tape: Tape,
    /// (row, column) of each
    places: Vec<(usize, usize)>,
}

impl PartialEq for Implicit {
    fn eq(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.0, &other.0)
    }
}

impl Eq for Implicit {}

impl Hash for Implicit {
    fn hash<H: Hasher>(&self, state: &mut H) {
        Arc::as_ptr(&self.0).hash(state);
    }
}

/// A residual over symbols of its own, and the expressions that those stand for.
struct Cut {
    residuals: Vec<Node>,
    symbols: Vec<Node>,
    expressions: Vec<Node>,
}

impl Implicit {
    /// The root of `residuals`, one for each unknown: the entries of z, in order. Everything
    /// in the residuals that does not depend on an unknown becomes one argument of the
    /// function.
    ///
    /// # Errors
    /// [`MissingInput`] only if nodes without a value are mixed in.
    ///
    /// # Panics
    /// If there are not as many residuals as unknowns.
    pub fn solve(
        graph: &Graph,
        unknowns: &[ImplicitUnknown],
        residuals: &[Node],
    ) -> Result<Vec<Node>, MissingInput> {
        assert_eq!(unknowns.len(), residuals.len(), "one equation per unknown");
        let z: Vec<Node> = unknowns.iter().map(|unknown| unknown.symbol).collect();
        let cut = Cut::new(graph, residuals, &z);
        let inputs = [&z[..], &cut.symbols].concat();
        let name = |&symbol: &Node| graph.symbol_name(symbol).unwrap_or_default();
        let equation = |&residual: &Node| format!("{} = 0", graph.render(residual, SHOWN));
        let slopes = |columns: &[Node]| Slopes::new(graph, &cut.residuals, columns, &inputs);
        let function = Self(Arc::new(Body {
            names: z.iter().map(name).collect(),
            equations: residuals.iter().map(equation).collect(),
            start: unknowns.iter().map(|unknown| unknown.start).collect(),
            range: unknowns.iter().map(|unknown| unknown.range).collect(),
            parameters: cut.symbols.len(),
            residual: Tape::new(graph, &inputs, &cut.residuals)?,
            by_unknowns: slopes(&z)?,
            by_parameters: slopes(&cut.symbols)?,
            steps: Tape::new(graph, &inputs, &steps(graph, &cut.residuals))?,
        }));
        Ok(graph.implicit(&function, &cut.expressions))
    }

    /// What the unknowns are called.
    pub fn names(&self) -> &[String] {
        &self.0.names
    }

    /// Number of unknowns.
    pub fn size(&self) -> usize {
        self.0.names.len()
    }

    /// Number of entries of p.
    pub fn parameters(&self) -> usize {
        self.0.parameters
    }

    /// Whether g may jump as its unknowns move.
    pub fn steps(&self) -> bool {
        self.0.steps.outputs() > 0
    }

    pub(crate) fn start(&self) -> &[f64] {
        &self.0.start
    }

    pub(crate) fn range(&self) -> &[Interval] {
        &self.0.range
    }

    /// g at (z, p).
    pub fn residual<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        self.0.residual.eval_in(algebra, at)
    }

    /// g_z at (z, p), n×n, row by row.
    pub fn matrix<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        let n = self.size();
        let mut matrix = vec![algebra.constant(0.0); n * n];
        for (i, j, slope) in self.0.by_unknowns.entries(algebra, at) {
            matrix[i * n + j] = slope;
        }
        matrix
    }

    /// Newton steps from `z` over any algebra, undamped: each doubles the digits that are
    /// right, where the algebra has them.
    pub fn refined<A: Algebra>(
        &self,
        algebra: &A,
        mut z: Vec<A::Value>,
        p: &[A::Value],
        steps: usize,
    ) -> Vec<A::Value> {
        for _ in 0..steps {
            let at = [&z[..], p].concat();
            let g = self.residual(algebra, &at);
            let (step, _) = algebra.solve(&self.matrix(algebra, &at), &g);
            for (z, step) in z.iter_mut().zip(&step) {
                *z = algebra.binary(Binary::Sub, z, step);
            }
        }
        z
    }

    /// The entries of g_p at (z, p) that are not zero everywhere: (row, column, value).
    pub(crate) fn sensitivities(&self, graph: &Graph, at: &[Node]) -> Vec<(usize, usize, Node)> {
        self.0.by_parameters.entries(&Nodes(graph), at)
    }

    /// What jumps in g as z moves, at (z, p).
    pub(crate) fn steps_in<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        self.0.steps.eval_in(algebra, at)
    }

    /// `a, b: a - b - x = 0, b - sin(a) = 0`
    pub(crate) fn text(&self) -> String {
        let spelled = self.0.equations.iter().take(SPELLED);
        let equations: Vec<&str> = spelled.map(String::as_str).collect();
        let names: Vec<&str> = self.0.names.iter().map(String::as_str).take(8).collect();
        let more = |n: usize| if self.size() > n { ", …" } else { "" };
        let (names, equations) = (names.join(", "), equations.join(", "));
        format!("{names}{}: {equations}{}", more(8), more(SPELLED))
    }
}

impl Slopes {
    fn new(
        graph: &Graph,
        residuals: &[Node],
        columns: &[Node],
        inputs: &[Node],
    ) -> Result<Self, MissingInput> {
        let jacobian = jacobian::forward(graph, residuals, columns);
        let entries: Vec<Node> = jacobian.entries.iter().map(|entry| entry.2).collect();
        Ok(Self {
            tape: Tape::new(graph, inputs, &entries)?,
            places: jacobian.entries.iter().map(|&(i, j, _)| (i, j)).collect(),
        })
    }

    fn entries<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<(usize, usize, A::Value)> {
        let values = self.tape.eval_in(algebra, at);
        let places = self.places.iter().zip(values);
        places.map(|(&(i, j), value)| (i, j, value)).collect()
    }
}

impl Cut {
    fn new(graph: &Graph, residuals: &[Node], z: &[Node]) -> Self {
        let mut moves: HashMap<Node, bool> = HashMap::new();
        let mut symbols: HashMap<Node, Node> = HashMap::new();
        let mut expressions = vec![];
        let mut cut = |node: Node| {
            if graph.constant_value(node).is_none() {
                symbols.entry(node).or_insert_with(|| {
                    expressions.push(node);
                    graph.fresh(graph.render(node, SHOWN)).node()
                });
            }
        };
        for node in graph.reachable(residuals) {
            let arguments = graph.arguments(node);
            let moved = z.contains(&node) || arguments.iter().any(|a| moves[a]);
            if moved {
                arguments.iter().filter(|a| !moves[a]).for_each(|&a| cut(a));
            }
            moves.insert(node, moved);
        }
        let still = residuals.iter().filter(|residual| !moves[residual]);
        still.for_each(|&residual| cut(residual));
        Self {
            residuals: graph.substitute(residuals, &symbols),
            symbols: expressions.iter().map(|node| symbols[node]).collect(),
            expressions,
        }
    }
}

/// The operations that are not continuous; a cut residual has none that depend on p alone.
fn steps(graph: &Graph, residuals: &[Node]) -> Vec<Node> {
    let zero = graph.constant(0.0).node();
    let mut found = vec![];
    for node in graph.reachable(residuals) {
        match graph.op(node) {
            Op::Unary(Unary::Sign | Unary::Floor | Unary::Not, _) => found.push(node),
            Op::Binary(
                Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or,
                ..,
            ) => found.push(node),
            // the cut of the angle
            Op::Binary(Binary::Atan2, y, x) => {
                let behind = graph.binary(Binary::LessEq, x, zero);
                let crossing = graph.binary(Binary::Equal, y, zero);
                found.push(graph.binary(Binary::And, behind, crossing));
            }
            Op::Select(condition, ..) => found.push(graph.unary(Unary::Not, condition)),
            Op::Implicit(_) => found.extend(inner_steps(graph, node)),
            _ => {}
        }
    }
    found
}

/// What jumps in a loop within the loop.
fn inner_steps(graph: &Graph, node: Node) -> Vec<Node> {
    let Some(call) = graph.implicit_call(node) else {
        return vec![];
    };
    let at = call.at(graph, node);
    call.function.steps_in(&Nodes(graph), &at)
}
