//! Tables: `Modelica.Math.Vectors.interpolate`.

use lynkeus_expr::Node;

use super::evaluate::Evaluator;
use super::monotone::monotone_cubic;
use super::value::{Scalar, Value};
use crate::Tables;
use crate::syntax::ast::{Call, ExprId};
use crate::syntax::{Problem, Result, Span};

impl<'a> Evaluator<'a> {
    /// `Vectors.interpolate(x, y, xi)`: linear between the points (x[i], y[i]) and, as the
    /// Modelica library has it, along the first and the last piece outside of them; or, where
    /// the options ask for it, the monotone cubic.
    pub(super) fn interpolate(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        let [abscissas, ordinates, at] = match call.arguments.len() {
            // the index of the piece found last is a hint for the library's search
            4 => [call.arguments[0], call.arguments[1], call.arguments[2]],
            _ => self.arguments(call)?,
        };
        let x = self.points(abscissas)?;
        let y = self.points(ordinates)?;
        if x.is_empty() || x.len() != y.len() {
            let message = format!(
                "a table needs as many values as points, at least one: found {} points and {} values",
                x.len(),
                y.len()
            );
            return Err(Problem::new(span, message));
        }
        self.increasing(&x, abscissas)?;
        if let Some(found) = self.table_points {
            found.borrow_mut().extend(self.graph.symbols_of(&x));
        }
        self.budget.charge(x.len() as u64, span)?;
        let at = self.value(at)?;
        self.map(at, span, |evaluator, at, span| {
            let at = evaluator.real(at, span)?;
            Ok(Scalar::Real(match evaluator.tables {
                Tables::Linear => evaluator.piecewise_linear(&x, &y, at),
                Tables::Monotone => monotone_cubic(evaluator.graph, &x, &y, at),
            }))
        })
    }

    fn points(&mut self, argument: ExprId) -> Result<Vec<Node>> {
        let span = self.span(argument);
        let elements = self.value(argument)?.into_array().elements;
        elements.into_iter().map(|e| self.real(e, span)).collect()
    }

    fn increasing(&self, x: &[Node], argument: ExprId) -> Result<()> {
        let known = |node: Node| self.graph.constant_value(node);
        for (i, pair) in x.windows(2).enumerate() {
            if let (Some(a), Some(b)) = (known(pair[0]), known(pair[1]))
                && a >= b
            {
                let message = format!(
                    "the points of a table must increase: [{}] = {a}, [{}] = {b}",
                    i + 1,
                    i + 2
                );
                return Err(Problem::new(self.span(argument), message)
                    .hint("sort them; a jump takes two points a little apart"));
            }
        }
        Ok(())
    }

    /// The straight lines, which end in the last value itself: what is limited to the points stays there, and is
    /// compared with it.
    fn piecewise_linear(&self, x: &[Node], y: &[Node], u: Node) -> Node {
        let graph = self.graph;
        let lines = self.kinks(x, y, u);
        let ([.., before, end], [.., last]) = (x, y) else {
            return lines;
        };
        let known = |node: Node| graph.constant_value(node);
        let found = known(self.kinks(x, y, *end));
        let (Some(found), Some(last)) = (found, known(*last)) else {
            return lines;
        };
        // what the sum loses to rounding up to the end, spread over the last piece
        let lost = last - found;
        if lost == 0.0 || !lost.is_finite() {
            return lines;
        }
        let [before, end] = [*before, *end].map(|node| graph.expr(node));
        let beyond = graph.expr(u) - before;
        let beyond = match x.len() {
            // one line has no kink
            2 => beyond,
            _ => beyond.max(graph.constant(0.0)),
        };
        (graph.expr(lines) + graph.constant(lost) * (beyond / (end - before))).node()
    }

    /// y₁ + s₁(u − x₁) + Σ (sᵢ − sᵢ₋₁) max(u − xᵢ, 0), sᵢ the slopes: every kink is there
    /// once, so that the slope at a point of the table is that of one of its sides.
    fn kinks(&self, x: &[Node], y: &[Node], u: Node) -> Node {
        let graph = self.graph;
        let expr = |node: Node| graph.expr(node);
        let u = expr(u);
        let mut sum = expr(y[0]);
        let mut before = graph.constant(0.0);
        for (i, (x, y)) in x.windows(2).zip(y.windows(2)).enumerate() {
            let [x0, x1, y0, y1] = [x[0], x[1], y[0], y[1]].map(expr);
            let slope = (y1 - y0) / (x1 - x0);
            let beyond = u - x0;
            sum = match i {
                0 => sum + slope * beyond,
                _ => sum + (slope - before) * beyond.max(graph.constant(0.0)),
            };
            before = slope;
        }
        sum.node()
    }
}
