//! Implicit functions: the root z of g(z, p) = 0, for algebraic loops and equations that are
//! not linear in their unknown.
//!
//! The residual g and its derivatives are compiled once, when the function is made, and every
//! use shares them. By the implicit function theorem z' = −g_z⁻¹ g_p p', so that derivatives
//! of any order, symbols and bounds need nothing but g, g_z, g_p and linear systems.

mod newton;
mod search;

use std::collections::HashMap;
use std::sync::Arc;

use crate::code::{Body, Implicit, Residual, Sides, Slopes, Tape};
use crate::{Algebra, Binary, Graph, Interval, MissingInput, Node, Nodes, Op, Unary, jacobian};

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
        let fixed = graph.largest(residuals, |symbol| !z.contains(symbol));
        let cut = graph.replaced(residuals, fixed);
        let inputs = [&z[..], &cut.symbols].concat();
        let name = |&symbol: &Node| graph.symbol_name(symbol).unwrap_or_default();
        let equation = |&residual: &Node| format!("{} = 0", graph.render(residual, SHOWN));
        let function = Self(Arc::new(Body {
            names: z.iter().map(name).collect(),
            equations: residuals.iter().map(equation).collect(),
            start: unknowns.iter().map(|unknown| unknown.start).collect(),
            range: unknowns.iter().map(|unknown| unknown.range).collect(),
            parameters: cut.symbols.len(),
            residual: Residual::new(graph, &cut.roots, &z, &inputs)?,
            by_parameters: Slopes::new(graph, &cut.roots, &cut.symbols, &inputs)?,
            sides: Sides::new(graph, &cut.roots, &z, &inputs)?,
        }));
        Ok(graph.implicit(&function, &cut.values))
    }

    /// g at (z, p).
    pub fn residual<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        self.0.residual.values.eval_in(algebra, at)
    }

    /// g_z at (z, p), n×n, row by row.
    pub fn matrix<A: Algebra>(&self, algebra: &A, at: &[A::Value]) -> Vec<A::Value> {
        let n = self.size();
        let mut matrix = vec![algebra.constant(0.0); n * n];
        for (i, j, slope) in self.0.residual.by_unknowns.entries(algebra, at) {
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
        self.0.residual.steps.eval_in(algebra, at)
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

impl Residual {
    fn new(
        graph: &Graph,
        residuals: &[Node],
        unknowns: &[Node],
        inputs: &[Node],
    ) -> Result<Self, MissingInput> {
        Ok(Self {
            values: Tape::new(graph, inputs, residuals)?,
            by_unknowns: Slopes::new(graph, residuals, unknowns, inputs)?,
            steps: Tape::new(graph, inputs, &steps(graph, residuals))?,
        })
    }
}

impl Sides {
    /// None where nothing in the residuals has sides.
    fn new(
        graph: &Graph,
        residuals: &[Node],
        unknowns: &[Node],
        inputs: &[Node],
    ) -> Result<Option<Self>, MissingInput> {
        let has_sides = |&node: &Node| has_sides(graph.op(node));
        let mut nodes = graph.reachable(residuals);
        nodes.retain(has_sides);
        let fresh = |&node: &Node| (node, graph.fresh(graph.render(node, SHOWN)).node());
        let symbols: HashMap<Node, Node> = nodes.iter().map(fresh).collect();
        let held = graph.substitute(residuals, &symbols);
        // one within another is held with it
        let read = graph.symbols_of(&held);
        nodes.retain(|node| read.contains(&symbols[node]));
        if nodes.is_empty() {
            return Ok(None);
        }
        let symbols = nodes.iter().map(|node| symbols[node]);
        let with_sides: Vec<Node> = inputs.iter().copied().chain(symbols).collect();
        let is_relation = |&node: &Node| matches!(graph.op(node), Op::Binary(..));
        Ok(Some(Self {
            values: Tape::new(graph, inputs, &nodes)?,
            are_relations: nodes.iter().map(is_relation).collect(),
            held: Residual::new(graph, &held, unknowns, &with_sides)?,
        }))
    }
}

/// Whether it jumps from one value to another, and is constant in between.
fn has_sides(op: Op) -> bool {
    matches!(
        op,
        Op::Binary(Binary::Less | Binary::LessEq | Binary::Equal, ..)
            | Op::Unary(Unary::Sign | Unary::Floor, _)
    )
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

/// The operations that are not continuous; a cut residual has none that depend on p alone.
fn steps(graph: &Graph, residuals: &[Node]) -> Vec<Node> {
    let zero = graph.constant(0.0).node();
    let mut found = vec![];
    for node in graph.reachable(residuals) {
        match graph.op(node) {
            Op::Unary(op, _) if op.jumps() => found.push(node),
            Op::Binary(op, ..) if op.jumps() => found.push(node),
            // the cut of the angle
            Op::Binary(Binary::Atan2, y, x) => {
                let behind = graph.binary(Binary::LessEq, x, zero);
                let crossing = graph.binary(Binary::Equal, y, zero);
                found.push(graph.binary(Binary::And, behind, crossing));
            }
            Op::Select(condition, ..) => found.push(graph.unary(Unary::Not, condition)),
            // what jumps in a loop within the loop
            Op::System(_) => {
                if let Some(call) = graph.system(node)
                    && let Some(function) = call.function()
                {
                    found.extend(function.steps_in(&Nodes(graph), &call.at(graph, node)));
                }
            }
            _ => {}
        }
    }
    found
}
