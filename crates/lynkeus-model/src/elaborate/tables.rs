//! Tables: `Modelica.Math.Vectors.interpolate`, along straight lines or monotone cubics.
//!
//! The cubics are those of Fritsch and Carlson, SIAM J. Numer. Anal. 17 (1980), with the slopes of
//! Fritsch and Butland, SIAM J. Sci. Stat. Comput. 5 (1984): C¹, exact at the points, rising where
//! they rise and nowhere beyond them.

use lynkeus_expr::{Expr, Graph, Node};

use super::evaluate::Evaluator;
use super::value::{Scalar, Value, expected_number};
use crate::Tables;
use crate::diagnostic::{Problem, Result};
use crate::syntax::ast::{Call, ExprId};

impl<'a> Evaluator<'a> {
    /// `Vectors.interpolate(x, y, xi)`: linear between the points (x[i], y[i]) and, as the
    /// Modelica library has it, along the first and the last piece outside of them; or, where
    /// the options ask for it, the monotone cubic.
    pub(super) fn interpolate(&mut self, call: &'a Call) -> Result<Value> {
        let [abscissas, ordinates, at] = match call.arguments.len() {
            // the index of the piece found last is a hint for the library's search
            4 => [call.arguments[0], call.arguments[1], call.arguments[2]],
            _ => self.arguments(call)?,
        };
        let x = self.points(abscissas)?;
        let y = self.points(ordinates)?;
        if x.is_empty() || x.len() != y.len() {
            let (points, values) = (x.len(), y.len());
            let message = format!(
                "a table needs as many values as points, at least one: found {points} points and \
                 {values} values"
            );
            return Err(self.problem(message));
        }
        self.increasing(&x, abscissas)?;
        let made_of = self.graph.symbols_of(&x);
        self.symbols.table_points.borrow_mut().extend(made_of);
        self.charge(x.len() as u64)?;
        let at = self.value(at)?;
        self.map(at, |at| {
            let at = self.real(at)?;
            Ok(Scalar::Real(match self.symbols.options.tables {
                Tables::Linear => self.piecewise_linear(&x, &y, at),
                Tables::Monotone => monotone_cubic(self.graph, &x, &y, at),
            }))
        })
    }

    fn points(&mut self, argument: ExprId) -> Result<Vec<Node>> {
        let span = self.span(argument);
        let elements = self.value(argument)?.elements;
        let node = |e: Scalar| e.real(self.graph).ok_or_else(|| expected_number(span));
        elements.into_iter().map(node).collect()
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

/// The cubic through the points (x[i], y[i]) at u, and along its tangents outside of them. Hermite's
/// cubics between two points are written so that at both ends the value, and what the rules of
/// differentiation make of the slope, are those of the ends to the bit: neighbours meet without a
/// jump, and what looks for jumps sees that they do.
pub(super) fn monotone_cubic(graph: &Graph, x: &[Node], y: &[Node], u: Node) -> Node {
    let of = |nodes: &[Node]| nodes.iter().map(|&n| graph.expr(n)).collect::<Vec<_>>();
    let (x, y, u) = (of(x), of(y), graph.expr(u));
    let last = x.len() - 1;
    if last == 0 {
        // a single point is a constant
        return y[0].node();
    }
    let (values, rises) = met(&y);
    let widths: Vec<Expr<'_>> = x.windows(2).map(|x| x[1] - x[0]).collect();
    let slopes = slopes(&widths, &rises);
    let tangent = |i: usize| values[i] + slopes[i] * (u - x[i]);
    if last == 1 {
        return tangent(0).node();
    }
    let cubic = |i: usize| {
        let (from, to) = (u - x[i], x[i + 1] - u);
        let width = x[i + 1] - x[i];
        let (share, rest) = (from / width, to / width);
        let rise = rises[i] * (share * share * (3.0 - 2.0 * share));
        let at_left = slopes[i] * (from * (rest * rest));
        let at_right = slopes[i + 1] * (to * (share * share));
        values[i] + rise + (at_left - at_right)
    };
    // the pieces from −∞ to ∞, each with where it ends
    let mut pieces = vec![(tangent(0), x[0])];
    pieces.extend((0..last).map(|i| (cubic(i), x[i + 1])));
    chosen(&pieces, tangent(last), u).node()
}

/// The piece that holds u, by halves: a chain of choices would be as deep as the table is long.
fn chosen<'g>(pieces: &[(Expr<'g>, Expr<'g>)], beyond: Expr<'g>, u: Expr<'g>) -> Expr<'g> {
    let (before, after) = pieces.split_at(pieces.len() / 2);
    match after.split_first() {
        None => beyond,
        Some((&(piece, end), after)) => u
            .less(end)
            .select(chosen(before, piece, u), chosen(after, beyond, u)),
    }
}

/// The values, each the sum of the one before and the rise to it, as rounded, with the rises: at
/// most one rounding off, and pieces that add their rise end where the next ones begin.
fn met<'g>(y: &[Expr<'g>]) -> (Vec<Expr<'g>>, Vec<Expr<'g>>) {
    let (mut values, mut rises): (Vec<Expr<'g>>, Vec<Expr<'g>>) = (vec![], vec![]);
    for &value in y {
        values.push(match values.last() {
            Some(&before) => {
                let rise = value - before;
                rises.push(rise);
                before + rise
            }
            None => value,
        });
    }
    (values, rises)
}

/// The slopes at the points; none without two points.
fn slopes<'g>(widths: &[Expr<'g>], rises: &[Expr<'g>]) -> Vec<Expr<'g>> {
    let secants = rises.iter().zip(widths).map(|(&rise, &width)| rise / width);
    let secants: Vec<Expr<'g>> = secants.collect();
    let n = secants.len();
    if n < 2 {
        return secants.repeat(2);
    }
    let edge = |a: usize, b: usize| at_the_edge([widths[a], widths[b]], [secants[a], secants[b]]);
    let inner = widths.windows(2).zip(secants.windows(2));
    let inner = inner.map(|(h, d)| inside([h[0], h[1]], [d[0], d[1]]));
    let (first, last) = (edge(0, 1), edge(n - 1, n - 2));
    std::iter::once(first).chain(inner).chain([last]).collect()
}

/// Between two pieces that rise or fall alike the weighted harmonic mean of their secants, else 0.
fn inside<'g>(width: [Expr<'g>; 2], secant: [Expr<'g>; 2]) -> Expr<'g> {
    let weights = [2.0 * width[1] + width[0], width[1] + 2.0 * width[0]];
    let mean = (weights[0] + weights[1]) / (weights[0] / secant[0] + weights[1] / secant[1]);
    let zero = mean.graph().constant(0.0);
    let alike = (secant[0].sign() * secant[1].sign()).greater(zero);
    alike.select(mean, zero)
}

/// At the first or last point, nearest piece first: that of the parabola through three points, held to
/// what keeps the piece monotone.
fn at_the_edge<'g>(width: [Expr<'g>; 2], secant: [Expr<'g>; 2]) -> Expr<'g> {
    let parabola =
        ((2.0 * width[0] + width[1]) * secant[0] - width[0] * secant[1]) / (width[0] + width[1]);
    let zero = parabola.graph().constant(0.0);
    let rises = (parabola.sign() * secant[0].sign()).greater(zero);
    let turns = (secant[0].sign() * secant[1].sign()).less_eq(zero);
    let steep = parabola.abs().greater(3.0 * secant[0].abs());
    let held = (turns.and(steep)).select(3.0 * secant[0], parabola);
    rises.select(held, zero)
}
