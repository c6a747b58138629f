//! Operators that are written as functions: `der`, `semiLinear`, `cross`.

use lynkeus_expr::{Binary, Node, jacobian};

use super::evaluate::Evaluator;
use super::scope::Mode;
use super::value::{Scalar, Value};
use crate::syntax::ast::{BinaryOperator, Call, Kind, Relation};
use crate::syntax::{Problem, Result, Span};

impl<'a> Evaluator<'a> {
    /// `der(x)` of a variable, an element or a slice, and of an expression by the chain rule.
    pub(super) fn der(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let span = self.span(argument);
        let kind = &self.ast.expression(argument).kind;
        let is_variable = matches!(kind, Kind::Name | Kind::Index(..) | Kind::Path(_));
        let value = self.value(argument)?;
        self.map(value, span, |evaluator, scalar, span| {
            let node = match scalar {
                Scalar::Real(node) => node,
                _ => return Err(evaluator.no_derivative(span)),
            };
            if is_variable {
                let derivative = evaluator.scope.derivative(node);
                return derivative
                    .map(Scalar::Real)
                    .ok_or_else(|| evaluator.no_derivative(span));
            }
            evaluator.total_derivative(node, span).map(Scalar::Real)
        })
    }

    fn no_derivative(&self, span: Span) -> Problem {
        let name = self.text(span);
        let message = format!("`der({name})`: `{name}` is not a Real variable");
        Problem::new(span, message)
            .hint("inputs and parameters have no derivative in the equations")
    }

    /// Σ ∂e/∂v der(v) over the variables of e, and ∂e/∂t.
    fn total_derivative(&self, node: Node, span: Span) -> Result<Node> {
        let graph = self.graph;
        let symbols = graph.symbols_of(&[node]);
        self.budget.charge(symbols.len() as u64, span)?;
        let row = jacobian::reverse(graph, &[node], &symbols);
        let mut sum: Option<Node> = None;
        let mut add = |term: Node| {
            sum = Some(sum.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
        };
        for (place, slope) in row.row(0) {
            let symbol = symbols[place];
            if Some(symbol) == self.scope.time(Mode::Continuous) {
                add(slope);
                continue;
            }
            if self.scope.is_parameter(symbol) {
                continue;
            }
            let derivative = self.scope.derivative(symbol).ok_or_else(|| {
                let name = graph.symbol_name(symbol).unwrap_or_default();
                let message = format!("`der` of an expression with `{name}`, which has none");
                Problem::new(span, message)
                    .hint("inputs and parameters have no derivative in the equations")
            })?;
            add(graph.binary(Binary::Mul, slope, derivative));
        }
        Ok(sum.unwrap_or_else(|| graph.constant(0.0).node()))
    }

    /// `semiLinear(x, a, b)`: a x where x ≥ 0, else b x.
    pub(super) fn semi_linear(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        let [x, above, below] = self.arguments(call)?;
        let x = self.scalar(x)?;
        let (above, below) = (self.scalar(above)?, self.scalar(below)?);
        let zero = Scalar::Integer(0);
        let Scalar::Boolean(positive) = self.compare(Relation::GreaterEqual, x, zero, span)? else {
            return Err(Problem::new(span, "expected a number"));
        };
        let slope = self.select(positive, above, below, span)?;
        let product = self.scalar_binary(BinaryOperator::Multiply, slope, x, span)?;
        Ok(Value::Scalar(product))
    }

    /// The cross product of two vectors of three elements.
    pub(super) fn cross(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        let (a, b) = self.two_arguments(call)?;
        let (a, b) = (a.into_array(), b.into_array());
        let ([a1, a2, a3], [b1, b2, b3]) = (&a.elements[..], &b.elements[..]) else {
            return Err(Problem::new(
                span,
                "`cross` takes two vectors of three elements",
            ));
        };
        let term = |p: &Scalar, q: &Scalar, r: &Scalar, s: &Scalar| {
            let first = self.scalar_binary(BinaryOperator::Multiply, *p, *q, span)?;
            let second = self.scalar_binary(BinaryOperator::Multiply, *r, *s, span)?;
            self.scalar_binary(BinaryOperator::Subtract, first, second, span)
        };
        let elements = vec![
            term(a2, b3, a3, b2)?,
            term(a3, b1, a1, b3)?,
            term(a1, b2, a2, b1)?,
        ];
        Ok(Value::vector(elements))
    }
}
