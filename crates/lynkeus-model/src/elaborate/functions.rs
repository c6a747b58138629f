//! The functions of scalars, and operators that are written as functions: `der`, `semiLinear`,
//! `cross`. Arrays are taken element by element.

use lynkeus_expr::{Binary, Node, Unary, jacobian};

use super::arithmetic::overflow;
use super::evaluate::Evaluator;
use super::scope::Mode;
use super::value::{Scalar, Value};
use crate::diagnostic::{Problem, Result, Span};
use crate::names::did_you_mean;
use crate::syntax::ast::{Call, ExprId, Kind};
use crate::syntax::shortened;

const UNARY: [(&str, Unary); 14] = [
    ("sqrt", Unary::Sqrt),
    ("exp", Unary::Exp),
    ("log", Unary::Ln),
    ("sin", Unary::Sin),
    ("cos", Unary::Cos),
    ("tan", Unary::Tan),
    ("asin", Unary::Asin),
    ("acos", Unary::Acos),
    ("atan", Unary::Atan),
    ("sinh", Unary::Sinh),
    ("cosh", Unary::Cosh),
    ("tanh", Unary::Tanh),
    ("abs", Unary::Abs),
    ("sign", Unary::Sign),
];

/// The other functions, for suggestions.
const OTHERS: [&str; 33] = [
    "homotopy",
    "semiLinear",
    "cross",
    "Modelica.Math.Vectors.interpolate",
    "der",
    "log10",
    "floor",
    "ceil",
    "integer",
    "atan2",
    "mod",
    "rem",
    "div",
    "min",
    "max",
    "sum",
    "product",
    "noEvent",
    "smooth",
    "size",
    "ndims",
    "zeros",
    "ones",
    "fill",
    "linspace",
    "identity",
    "diagonal",
    "transpose",
    "cat",
    "scalar",
    "vector",
    "matrix",
    "array",
];

/// Functions that an observer's model cannot have, and what to do instead.
const REFUSED: [(&str, &str); 10] = [
    (
        "pre",
        "models with events are not supported: use `if` expressions",
    ),
    (
        "edge",
        "models with events are not supported: use `if` expressions",
    ),
    (
        "change",
        "models with events are not supported: use `if` expressions",
    ),
    ("sample", "sampling is set in the study, not in the model"),
    ("initial", "give the starting values with `start = …`"),
    ("terminal", "models with events are not supported"),
    ("reinit", "models with events are not supported"),
    (
        "delay",
        "a delay has infinitely many states: use a chain of lags",
    ),
    ("spatialDistribution", "use a chain of lags"),
    ("assert", "it is an equation or a statement of its own"),
];

impl<'a> Evaluator<'a> {
    pub(super) fn call(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        if self.classes.is_some()
            && let Some(value) = self.own_function(call, span)?
        {
            return Ok(value);
        }
        let name = self.text(call.function);
        let name = name.strip_prefix("Modelica.Math.").unwrap_or(name);
        if let Some((name, _)) = call.named.first() {
            let problem = Problem::new(*name, "a named argument is not supported");
            return Err(problem.hint("give the arguments in order, without names"));
        }
        if let Some(&(_, operation)) = UNARY.iter().find(|(known, _)| *known == name) {
            let value = self.only_argument(call)?;
            return self.map(value, span, |evaluator, scalar, span| {
                evaluator.unary_function(operation, scalar, span)
            });
        }
        match name {
            "der" => self.der(call),
            "log10" => {
                let value = self.only_argument(call)?;
                self.map(value, span, |evaluator, scalar, span| {
                    let node = evaluator.real(scalar, span)?;
                    let logarithm = evaluator.graph.expr(node).log10();
                    Ok(Scalar::Real(logarithm.node()))
                })
            }
            "floor" | "ceil" | "integer" => {
                let value = self.only_argument(call)?;
                self.map(value, span, |evaluator, scalar, span| {
                    evaluator.rounded(name, scalar, span)
                })
            }
            "atan2" | "mod" | "rem" | "div" => {
                let (left, right) = self.two_arguments(call)?;
                self.elementwise(left, right, span, |evaluator, a, b, span| {
                    evaluator.binary_function(name, a, b, span)
                })
            }
            "min" | "max" => self.extreme(name, call, span),
            "Vectors.interpolate" => self.interpolate(call, span),
            "noEvent" => self.only_argument(call),
            "smooth" => Ok(self.two_arguments(call)?.1),
            "homotopy" => Ok(self.two_arguments(call)?.0),
            "semiLinear" => self.semi_linear(call, span),
            "cross" => self.cross(call, span),
            _ => match self.array_function(name, call, span)? {
                Some(value) => Ok(value),
                None => Err(self.unknown_function(call.function, name)),
            },
        }
    }

    fn unknown_function(&self, span: Span, name: &str) -> Box<Problem> {
        if let Some((_, hint)) = REFUSED.iter().find(|(refused, _)| *refused == name) {
            return Problem::new(span, format!("`{name}` is not supported")).hint(*hint);
        }
        let known = UNARY.iter().map(|(name, _)| *name).chain(OTHERS);
        let hint = did_you_mean(name, known).unwrap_or_else(|| match name {
            "ln" => "the natural logarithm is `log`".to_owned(),
            "pow" => "write `a^b`".to_owned(),
            _ if self.scope.dims(name).is_some() => "subscripts stand in `[…]`".to_owned(),
            _ => "the text holds no function of this name".to_owned(),
        });
        Problem::new(span, format!("unknown function `{}`", shortened(name))).hint(hint)
    }

    /// Checks the number of arguments.
    pub(super) fn arguments<const N: usize>(&self, call: &Call) -> Result<[ExprId; N]> {
        let given = call.arguments.len();
        if !call.iterators.is_empty() {
            let message = "iterators stand only in `sum`, `product`, `min`, `max` and `array`";
            return Err(Problem::new(call.function, message));
        }
        <[ExprId; N]>::try_from(call.arguments.as_slice()).map_err(|_| {
            let name = self.text(call.function);
            let plural = if N == 1 { "" } else { "s" };
            let message = format!("`{name}` takes {N} argument{plural}, found {given}");
            Problem::new(call.function, message)
        })
    }

    pub(super) fn only_argument(&mut self, call: &Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        self.value(argument)
    }

    pub(super) fn two_arguments(&mut self, call: &Call) -> Result<(Value, Value)> {
        let [left, right] = self.arguments(call)?;
        Ok((self.value(left)?, self.value(right)?))
    }

    fn unary_function(&self, operation: Unary, scalar: Scalar, span: Span) -> Result<Scalar> {
        if let Scalar::Integer(value) = scalar {
            match operation {
                Unary::Abs => {
                    let magnitude = value.checked_abs();
                    return magnitude.map(Scalar::Integer).ok_or_else(|| overflow(span));
                }
                Unary::Sign => return Ok(Scalar::Integer(value.signum())),
                _ => {}
            }
        }
        let node = self.real(scalar, span)?;
        Ok(Scalar::Real(self.graph.unary(operation, node)))
    }

    fn rounded(&self, name: &str, scalar: Scalar, span: Span) -> Result<Scalar> {
        let node = self.real(scalar, span)?;
        let rounded = match name {
            "ceil" => {
                let negative = self.graph.unary(Unary::Neg, node);
                let floor = self.graph.unary(Unary::Floor, negative);
                self.graph.unary(Unary::Neg, floor)
            }
            _ => self.graph.unary(Unary::Floor, node),
        };
        match self.graph.constant_value(rounded) {
            Some(value) if name == "integer" => {
                if value.abs() > 2f64.powi(53) {
                    return Err(overflow(span));
                }
                Ok(Scalar::Integer(value as i64))
            }
            _ => Ok(Scalar::Real(rounded)),
        }
    }

    fn binary_function(&self, name: &str, a: Scalar, b: Scalar, span: Span) -> Result<Scalar> {
        if b.number(self.graph) == Some(0.0) && name != "atan2" {
            return Err(Problem::new(span, "division by zero"));
        }
        if let (Scalar::Integer(a), Scalar::Integer(b)) = (a, b) {
            let exact = match name {
                "div" => Some(a.checked_div(b)),
                "rem" => Some(a.checked_rem(b)),
                "mod" => Some(a.checked_rem(b).map(|rest| match (rest < 0) == (b < 0) {
                    true => rest,
                    false if rest == 0 => 0,
                    false => rest + b,
                })),
                _ => None,
            };
            if let Some(exact) = exact {
                return exact.map(Scalar::Integer).ok_or_else(|| overflow(span));
            }
        }
        let graph = self.graph;
        let (a, b) = (
            graph.expr(self.real(a, span)?),
            graph.expr(self.real(b, span)?),
        );
        let truncated = || {
            let quotient = a / b;
            quotient.sign() * quotient.abs().floor()
        };
        let result = match name {
            "atan2" => graph.expr(graph.binary(Binary::Atan2, a.node(), b.node())),
            "div" => truncated(),
            "rem" => a - truncated() * b,
            _ => a - (a / b).floor() * b,
        };
        Ok(Scalar::Real(result.node()))
    }

    fn extreme(&mut self, name: &str, call: &'a Call, span: Span) -> Result<Value> {
        let operation = if name == "min" {
            Binary::Min
        } else {
            Binary::Max
        };
        if call.arguments.len() == 2 {
            let (left, right) = self.two_arguments(call)?;
            return self.elementwise(left, right, span, |evaluator, a, b, span| {
                evaluator.larger_or_smaller(operation, a, b, span)
            });
        }
        let elements = self.reduced(call, span)?;
        self.budget.charge(elements.len() as u64, span)?;
        let Some((&first, rest)) = elements.split_first() else {
            return Err(Problem::new(span, format!("`{name}` of no elements")));
        };
        let result = rest.iter().try_fold(first, |best, &next| {
            self.larger_or_smaller(operation, best, next, span)
        });
        Ok(Value::Scalar(result?))
    }

    fn larger_or_smaller(&self, op: Binary, a: Scalar, b: Scalar, span: Span) -> Result<Scalar> {
        if let (Scalar::Integer(a), Scalar::Integer(b)) = (a, b) {
            return Ok(Scalar::Integer(if op == Binary::Min {
                a.min(b)
            } else {
                a.max(b)
            }));
        }
        let (a, b) = (self.real(a, span)?, self.real(b, span)?);
        Ok(Scalar::Real(self.graph.binary(op, a, b)))
    }
}

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

    fn no_derivative(&self, span: Span) -> Box<Problem> {
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
        let Scalar::Boolean(positive) = self.compare(">=", x, zero, span)? else {
            return Err(Problem::new(span, "expected a number"));
        };
        let slope = self.select(positive, above, below, span)?;
        let product = self.scalar_binary(Binary::Mul, slope, x, span)?;
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
            let first = self.scalar_binary(Binary::Mul, *p, *q, span)?;
            let second = self.scalar_binary(Binary::Mul, *r, *s, span)?;
            self.scalar_binary(Binary::Sub, first, second, span)
        };
        let elements = vec![
            term(a2, b3, a3, b2)?,
            term(a3, b1, a1, b3)?,
            term(a1, b2, a2, b1)?,
        ];
        Ok(Value::vector(elements))
    }
}
