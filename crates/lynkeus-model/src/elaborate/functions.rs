//! The functions by their names, and those of scalars; operators that are written as functions:
//! `der`, `semiLinear`, `cross`. Arrays are taken element by element.

use lynkeus_expr::{Binary, Expr, Node, Unary};

use super::arithmetic::overflow;
use super::arrays::{matrix_dims, scalar_dims, vector_dims};
use super::evaluate::Evaluator;
use super::value::{Scalar, Value, expected_number};
use crate::balance::total_derivative;
use crate::diagnostic::{Problem, Result, Span};
use crate::names::did_you_mean;
use crate::syntax::ast::{Call, ExprId, Kind};
use crate::syntax::shortened;

/// Where the library has functions that are known without it.
const LIBRARY: &str = "Modelica.Math.";

const INTERPOLATE: &str = "Modelica.Math.Vectors.interpolate";

/// What a function makes of a call, which stands at the span.
type Function = for<'e, 'a> fn(&'e mut Evaluator<'a>, &'a Call, Span) -> Result<Value>;

/// By name: what an evaluator `e` makes of a call `c` at the span `s`.
const FUNCTIONS: [(&str, Function); 47] = [
    ("sqrt", |e, c, s| e.math(c, s, Unary::Sqrt)),
    ("exp", |e, c, s| e.math(c, s, Unary::Exp)),
    ("log", |e, c, s| e.math(c, s, Unary::Ln)),
    ("log10", |e, c, s| e.each(c, s, Evaluator::log10)),
    ("sin", |e, c, s| e.math(c, s, Unary::Sin)),
    ("cos", |e, c, s| e.math(c, s, Unary::Cos)),
    ("tan", |e, c, s| e.math(c, s, Unary::Tan)),
    ("asin", |e, c, s| e.math(c, s, Unary::Asin)),
    ("acos", |e, c, s| e.math(c, s, Unary::Acos)),
    ("atan", |e, c, s| e.math(c, s, Unary::Atan)),
    ("atan2", |e, c, s| e.pairs(c, s, Evaluator::atan2)),
    ("sinh", |e, c, s| e.math(c, s, Unary::Sinh)),
    ("cosh", |e, c, s| e.math(c, s, Unary::Cosh)),
    ("tanh", |e, c, s| e.math(c, s, Unary::Tanh)),
    ("abs", |e, c, s| e.math(c, s, Unary::Abs)),
    ("sign", |e, c, s| e.math(c, s, Unary::Sign)),
    ("floor", |e, c, s| e.each(c, s, Evaluator::floor)),
    ("ceil", |e, c, s| e.each(c, s, Evaluator::ceil)),
    ("integer", |e, c, s| e.each(c, s, Evaluator::integer)),
    ("div", |e, c, s| e.divided(c, s, i64::checked_div, quotient)),
    ("rem", |e, c, s| e.divided(c, s, i64::checked_rem, rest)),
    ("mod", |e, c, s| e.divided(c, s, exact_modulus, modulus)),
    ("min", |e, c, s| e.extreme(c, s, Binary::Min, i64::min)),
    ("max", |e, c, s| e.extreme(c, s, Binary::Max, i64::max)),
    ("der", |e, c, _| e.der(c)),
    ("noEvent", |e, c, _| e.only_argument(c)),
    ("smooth", |e, c, _| Ok(e.two_arguments(c)?.1)),
    ("homotopy", |e, c, _| Ok(e.two_arguments(c)?.0)),
    ("semiLinear", |e, c, s| e.semi_linear(c, s)),
    ("cross", |e, c, s| e.cross(c, s)),
    (INTERPOLATE, |e, c, s| e.interpolate(c, s)),
    ("sum", |e, c, s| e.sum(c, s)),
    ("product", |e, c, s| e.product_of_all(c, s)),
    ("array", |e, c, s| e.array_of(c, s)),
    ("size", |e, c, _| e.size(c)),
    ("ndims", |e, c, _| e.ndims(c)),
    ("zeros", |e, c, s| e.filled(0, c, s)),
    ("ones", |e, c, s| e.filled(1, c, s)),
    ("fill", |e, c, s| e.fill(c, s)),
    ("linspace", |e, c, s| e.linspace(c, s)),
    ("identity", |e, c, s| e.identity(c, s)),
    ("diagonal", |e, c, s| e.diagonal(c, s)),
    ("transpose", |e, c, s| e.transpose(c, s)),
    ("cat", |e, c, s| e.cat(c, s)),
    ("scalar", |e, c, s| e.reshaped(c, s, scalar_dims)),
    ("vector", |e, c, s| e.reshaped(c, s, vector_dims)),
    ("matrix", |e, c, s| e.reshaped(c, s, matrix_dims)),
];

const NO_EVENTS: &str = "models with events are not supported: use `if` expressions";

/// Functions that an observer's model cannot have, and what to do instead.
const REFUSED: [(&str, &str); 10] = [
    ("pre", NO_EVENTS),
    ("edge", NO_EVENTS),
    ("change", NO_EVENTS),
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
        if let Some(value) = self.own_function(call, span)? {
            return Ok(value);
        }
        if let Some((name, _)) = call.named.first() {
            let problem = Problem::new(*name, "a named argument is not supported");
            return Err(problem.hint("give the arguments in order, without names"));
        }
        let name = self.function_name(call);
        let is_called = |known: &str| known.strip_prefix(LIBRARY).unwrap_or(known) == name;
        match FUNCTIONS.iter().find(|(known, _)| is_called(known)) {
            Some((_, function)) => function(self, call, span),
            None => Err(self.unknown_function(call.function, name)),
        }
    }

    /// The function that is called, without the name of the library.
    pub(super) fn function_name(&self, call: &Call) -> &'a str {
        let name = self.text(call.function);
        name.strip_prefix(LIBRARY).unwrap_or(name)
    }

    fn unknown_function(&self, span: Span, name: &str) -> Box<Problem> {
        if let Some((_, hint)) = REFUSED.iter().find(|(refused, _)| *refused == name) {
            return Problem::new(span, format!("`{name}` is not supported")).hint(*hint);
        }
        let known = FUNCTIONS.iter().map(|(name, _)| *name);
        let hint = did_you_mean(name, known).unwrap_or_else(|| match name {
            "ln" => "the natural logarithm is `log`".to_owned(),
            "pow" => "write `a^b`".to_owned(),
            _ if self.symbols.dims(name).is_some() => "subscripts stand in `[…]`".to_owned(),
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

    /// A function of every element of the only argument.
    fn each(
        &mut self,
        call: &Call,
        span: Span,
        function: impl Fn(&Self, Scalar, Span) -> Result<Scalar>,
    ) -> Result<Value> {
        let value = self.only_argument(call)?;
        self.map(value, span, function)
    }

    /// A function of the elements of two arguments.
    fn pairs(
        &mut self,
        call: &Call,
        span: Span,
        function: impl Fn(&Self, Scalar, Scalar, Span) -> Result<Scalar>,
    ) -> Result<Value> {
        let (left, right) = self.two_arguments(call)?;
        self.elementwise(left, right, span, function)
    }

    fn math(&mut self, call: &Call, span: Span, operation: Unary) -> Result<Value> {
        self.each(call, span, |evaluator, scalar, span| {
            let exact = match (scalar, operation) {
                (Scalar::Integer(value), Unary::Abs) => value.checked_abs(),
                (Scalar::Integer(value), Unary::Sign) => Some(value.signum()),
                _ => {
                    let node = evaluator.real(scalar, span)?;
                    return Ok(Scalar::Real(evaluator.graph.unary(operation, node)));
                }
            };
            exact.map(Scalar::Integer).ok_or_else(|| overflow(span))
        })
    }

    fn log10(&self, scalar: Scalar, span: Span) -> Result<Scalar> {
        let node = self.real(scalar, span)?;
        Ok(Scalar::Real(self.graph.expr(node).log10().node()))
    }

    fn floor(&self, scalar: Scalar, span: Span) -> Result<Scalar> {
        let node = self.real(scalar, span)?;
        Ok(Scalar::Real(self.graph.unary(Unary::Floor, node)))
    }

    fn ceil(&self, scalar: Scalar, span: Span) -> Result<Scalar> {
        let node = self.graph.expr(self.real(scalar, span)?);
        Ok(Scalar::Real((-(-node).floor()).node()))
    }

    fn integer(&self, scalar: Scalar, span: Span) -> Result<Scalar> {
        let floor = self.floor(scalar, span)?;
        match floor.number(self.graph) {
            Some(value) if value.abs() > 2f64.powi(53) => Err(overflow(span)),
            Some(value) => Ok(Scalar::Integer(value as i64)),
            None => Ok(floor),
        }
    }

    fn atan2(&self, a: Scalar, b: Scalar, span: Span) -> Result<Scalar> {
        let (a, b) = (self.real(a, span)?, self.real(b, span)?);
        Ok(Scalar::Real(self.graph.binary(Binary::Atan2, a, b)))
    }

    /// What is left of a division: of Integers `exact`, where it fits.
    fn divided(
        &mut self,
        call: &Call,
        span: Span,
        exact: impl Fn(i64, i64) -> Option<i64>,
        real: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>,
    ) -> Result<Value> {
        self.pairs(call, span, |evaluator, a, b, span| {
            let graph = evaluator.graph;
            if b.number(graph) == Some(0.0) {
                return Err(Problem::new(span, "division by zero"));
            }
            if let (Scalar::Integer(a), Scalar::Integer(b)) = (a, b) {
                let exact = exact(a, b).map(Scalar::Integer);
                return exact.ok_or_else(|| overflow(span));
            }
            let (a, b) = (evaluator.real(a, span)?, evaluator.real(b, span)?);
            Ok(Scalar::Real(real(graph.expr(a), graph.expr(b)).node()))
        })
    }

    /// The smallest or largest: of two arguments element by element, or of all elements of one.
    fn extreme(
        &mut self,
        call: &'a Call,
        span: Span,
        operation: Binary,
        exact: impl Fn(i64, i64) -> i64,
    ) -> Result<Value> {
        let of_two = |evaluator: &Self, a: Scalar, b: Scalar, span: Span| {
            if let (Scalar::Integer(a), Scalar::Integer(b)) = (a, b) {
                return Ok(Scalar::Integer(exact(a, b)));
            }
            let (a, b) = (evaluator.real(a, span)?, evaluator.real(b, span)?);
            Ok(Scalar::Real(evaluator.graph.binary(operation, a, b)))
        };
        if call.arguments.len() == 2 {
            return self.pairs(call, span, of_two);
        }
        let elements = self.reduced(call, span)?;
        self.budget.charge(elements.len() as u64, span)?;
        let Some((&first, rest)) = elements.split_first() else {
            let name = self.function_name(call);
            return Err(Problem::new(span, format!("`{name}` of no elements")));
        };
        let better = |best, &next| of_two(self, best, next, span);
        rest.iter().try_fold(first, better).map(Value::from)
    }
}

/// The quotient without its fraction.
fn quotient<'g>(a: Expr<'g>, b: Expr<'g>) -> Expr<'g> {
    let quotient = a / b;
    quotient.sign() * quotient.abs().floor()
}

/// The rest with the sign of a.
fn rest<'g>(a: Expr<'g>, b: Expr<'g>) -> Expr<'g> {
    a - quotient(a, b) * b
}

/// The rest with the sign of b.
fn modulus<'g>(a: Expr<'g>, b: Expr<'g>) -> Expr<'g> {
    a - (a / b).floor() * b
}

fn exact_modulus(a: i64, b: i64) -> Option<i64> {
    let rest = a.checked_rem(b)?;
    let has_other_sign = rest != 0 && (rest < 0) != (b < 0);
    Some(if has_other_sign { rest + b } else { rest })
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
                let derivative = evaluator.symbols.derivative(node);
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
        let symbols = graph.symbols_of(&[node]).len();
        self.budget.charge(symbols as u64, span)?;
        let time = self.symbols.time();
        total_derivative(graph, node, time, |symbol| {
            let derivative = self.symbols.derivative(symbol);
            if derivative.is_some() || symbol == time || self.symbols.parameters.contains(&symbol) {
                return Ok(derivative);
            }
            let name = graph.symbol_name(symbol).unwrap_or_default();
            let message = format!("`der` of an expression with `{name}`, which has none");
            Err(Problem::new(span, message)
                .hint("inputs and parameters have no derivative in the equations"))
        })
    }

    /// `semiLinear(x, a, b)`: a x where x ≥ 0, else b x.
    pub(super) fn semi_linear(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        let [x, above, below] = self.arguments(call)?;
        let x = self.scalar(x)?;
        let (above, below) = (self.scalar(above)?, self.scalar(below)?);
        let zero = Scalar::Integer(0);
        let positive = self.compare(">=", x, zero, span)?;
        let slope = above.select(positive, below, self.graph);
        let slope = slope.ok_or_else(|| expected_number(span))?;
        let product = self.scalar_binary(Binary::Mul, slope, x, span)?;
        Ok(product.into())
    }

    /// The cross product of two vectors of three elements.
    pub(super) fn cross(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        let (a, b) = self.two_arguments(call)?;
        let ([a1, a2, a3], [b1, b2, b3]) = (&a.elements[..], &b.elements[..]) else {
            let message = "`cross` takes two vectors of three elements";
            return Err(Problem::new(span, message));
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
