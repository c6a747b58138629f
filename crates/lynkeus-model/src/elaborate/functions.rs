//! The functions by their names, and those of scalars; operators that are written as functions:
//! `der`, `semiLinear`, `cross`. Arrays are taken element by element.

use lynkeus_expr::{Binary, Expr, Node, Unary};

use super::arrays::{matrix_dims, scalar_dims, vector_dims};
use super::evaluate::{Evaluator, reference};
use super::value::{Scalar, Value, expected_number};
use crate::balance::total_derivative;
use crate::diagnostic::{Problem, Result, Span};
use crate::names::did_you_mean;
use crate::syntax::ast::{Call, ExprId};
use crate::syntax::shortened;

/// Where the library has functions that are known without it.
const LIBRARY: &str = "Modelica.Math.";

const INTERPOLATE: &str = "Modelica.Math.Vectors.interpolate";

/// What a function makes of a call.
type Function = for<'e, 'a> fn(&'e mut Evaluator<'a>, &'a Call) -> Result<Value>;

/// By name: what an evaluator `e` makes of a call `c`.
const FUNCTIONS: [(&str, Function); 53] = [
    ("sqrt", |e, c| e.each(c, |x| x.sqrt())),
    ("exp", |e, c| e.each(c, |x| x.exp())),
    ("log", |e, c| e.each(c, |x| x.ln())),
    ("log10", |e, c| e.each(c, |x| x.log10())),
    ("sin", |e, c| e.each(c, |x| x.sin())),
    ("cos", |e, c| e.each(c, |x| x.cos())),
    ("tan", |e, c| e.each(c, |x| x.tan())),
    ("asin", |e, c| e.each(c, |x| x.asin())),
    ("acos", |e, c| e.each(c, |x| x.acos())),
    ("atan", |e, c| e.each(c, |x| x.atan())),
    ("atan2", |e, c| e.atan2(c)),
    ("sinh", |e, c| e.each(c, |x| x.sinh())),
    ("cosh", |e, c| e.each(c, |x| x.cosh())),
    ("tanh", |e, c| e.each(c, |x| x.tanh())),
    ("abs", |e, c| e.exact(c, i64::checked_abs, |x| x.abs())),
    ("sign", |e, c| e.exact(c, signum, |x| x.sign())),
    ("floor", |e, c| e.each(c, |x| x.floor())),
    ("ceil", |e, c| e.each(c, |x| -(-x).floor())),
    ("integer", |e, c| e.integer(c)),
    ("div", |e, c| e.divided(c, i64::checked_div, quotient)),
    ("rem", |e, c| e.divided(c, i64::checked_rem, rest)),
    ("mod", |e, c| e.divided(c, exact_modulus, modulus)),
    ("min", |e, c| e.extreme(c, i64::min, |a, b| a.min(b))),
    ("max", |e, c| e.extreme(c, i64::max, |a, b| a.max(b))),
    ("der", |e, c| e.der(c)),
    ("delay", |e, c| e.delay(c)),
    ("noEvent", |e, c| e.only_argument(c)),
    ("smooth", |e, c| Ok(e.two_arguments(c)?.1)),
    ("homotopy", |e, c| Ok(e.two_arguments(c)?.0)),
    ("pre", |e, c| e.before(c)),
    ("edge", |e, c| e.edge(c)),
    ("change", |e, c| e.change(c)),
    ("sample", |e, c| e.sample(c)),
    ("initial", |e, c| e.initial(c)),
    ("semiLinear", |e, c| e.semi_linear(c)),
    ("cross", |e, c| e.cross(c)),
    (INTERPOLATE, |e, c| e.interpolate(c)),
    ("sum", |e, c| e.fold(c, Binary::Add, 0)),
    ("product", |e, c| e.fold(c, Binary::Mul, 1)),
    ("array", |e, c| e.array_of(c)),
    ("size", |e, c| e.size(c)),
    ("ndims", |e, c| e.ndims(c)),
    ("zeros", |e, c| e.filled(0, c)),
    ("ones", |e, c| e.filled(1, c)),
    ("fill", |e, c| e.fill(c)),
    ("linspace", |e, c| e.linspace(c)),
    ("identity", |e, c| e.identity(c)),
    ("diagonal", |e, c| e.diagonal(c)),
    ("transpose", |e, c| e.transpose(c)),
    ("cat", |e, c| e.cat(c)),
    ("scalar", |e, c| e.reshaped(c, scalar_dims)),
    ("vector", |e, c| e.reshaped(c, vector_dims)),
    ("matrix", |e, c| e.reshaped(c, matrix_dims)),
];

/// Functions that an observer's model cannot have, and what to do instead.
const REFUSED: [(&str, &str); 4] = [
    ("terminal", "the study says until when a run goes"),
    ("reinit", "it is an equation of its own, in a `when`"),
    (
        "spatialDistribution",
        "use `delay` where the flow is constant, or a chain of lags",
    ),
    ("assert", "it is an equation or a statement of its own"),
];

impl<'a> Evaluator<'a> {
    pub(super) fn call(&mut self, call: &'a Call) -> Result<Value> {
        if let Some(value) = self.own_function(call)? {
            return Ok(value);
        }
        if let Some((name, _)) = call.named.first() {
            let problem = Problem::new(*name, "a named argument is not supported");
            return Err(problem.hint("give the arguments in order, without names"));
        }
        let name = self.function_name(call);
        let is_called = |known: &str| known.strip_prefix(LIBRARY).unwrap_or(known) == name;
        match FUNCTIONS.iter().find(|(known, _)| is_called(known)) {
            Some((_, function)) => function(self, call),
            None => Err(self.unknown_function(call.function, name)),
        }
    }

    /// The function that is called, without the name of the library.
    pub(super) fn function_name(&self, call: &Call) -> &'a str {
        let name = self.text(call.function);
        name.strip_prefix(LIBRARY).unwrap_or(name)
    }

    fn unknown_function(&self, span: Span, name: &str) -> Problem {
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

    /// A function of every element of the only argument, as a Real.
    fn each(
        &mut self,
        call: &Call,
        function: impl for<'g> Fn(Expr<'g>) -> Expr<'g>,
    ) -> Result<Value> {
        let value = self.only_argument(call)?;
        self.map(value, |scalar| {
            let argument = self.graph.expr(self.real(scalar)?);
            Ok(Scalar::Real(function(argument).node()))
        })
    }

    /// The same, but that Integers are taken exactly.
    fn exact(
        &mut self,
        call: &Call,
        exact: impl Fn(i64) -> Option<i64>,
        real: impl for<'g> Fn(Expr<'g>) -> Expr<'g>,
    ) -> Result<Value> {
        let value = self.only_argument(call)?;
        let of_one = |scalar| self.of_one(scalar, &exact, &real);
        self.map(value, of_one)
    }

    fn integer(&mut self, call: &Call) -> Result<Value> {
        let value = self.only_argument(call)?;
        self.map(value, |scalar| {
            let node = self.real(scalar)?;
            let floor = self.graph.unary(Unary::Floor, node);
            match self.graph.constant_value(floor) {
                Some(value) if value.abs() > 2f64.powi(53) => Err(self.overflow()),
                Some(value) => Ok(Scalar::Integer(value as i64)),
                None => Ok(Scalar::Real(floor)),
            }
        })
    }

    fn atan2(&mut self, call: &Call) -> Result<Value> {
        let (left, right) = self.two_arguments(call)?;
        self.elementwise(left, right, |a, b| {
            let (a, b) = (self.real(a)?, self.real(b)?);
            Ok(Scalar::Real(self.graph.binary(Binary::Atan2, a, b)))
        })
    }

    /// What is left of a division: of Integers `exact`, where it fits.
    fn divided(
        &mut self,
        call: &Call,
        exact: impl Fn(i64, i64) -> Option<i64>,
        real: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>,
    ) -> Result<Value> {
        let (left, right) = self.two_arguments(call)?;
        self.elementwise(left, right, |a, b| match b.number(self.graph) {
            Some(0.0) => Err(self.problem("division by zero")),
            _ => self.of_two(a, b, &exact, &real),
        })
    }

    /// The smallest or largest: of two arguments element by element, or of all elements of one.
    fn extreme(
        &mut self,
        call: &'a Call,
        exact: impl Fn(i64, i64) -> i64,
        real: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>,
    ) -> Result<Value> {
        let exact = |a, b| Some(exact(a, b));
        if call.arguments.len() == 2 {
            let (left, right) = self.two_arguments(call)?;
            let of_two = |a, b| self.of_two(a, b, exact, &real);
            return self.elementwise(left, right, of_two);
        }
        let elements = self.reduced(call)?;
        self.charge(elements.len() as u64)?;
        let Some((&first, rest)) = elements.split_first() else {
            let name = self.function_name(call);
            return Err(self.problem(format!("`{name}` of no elements")));
        };
        let better = |best, &next| self.of_two(best, next, exact, &real);
        rest.iter().try_fold(first, better).map(Value::from)
    }
}

fn signum(number: i64) -> Option<i64> {
    Some(number.signum())
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
        let is_variable = reference(self.source, self.ast, argument).is_some();
        let value = self.value(argument)?;
        self.at = self.span(argument);
        self.map(value, |scalar| {
            let derivative = match scalar {
                Scalar::Real(node) if is_variable => self.symbols.derivative(node),
                Scalar::Real(node) => Some(self.total_derivative(node)?),
                _ => None,
            };
            let derivative = derivative.map(Scalar::Real);
            derivative.ok_or_else(|| self.no_derivative())
        })
    }

    fn no_derivative(&self) -> Problem {
        let name = self.text(self.at);
        let message = format!("`der({name})`: `{name}` is not a Real variable");
        self.problem(message)
            .hint("inputs and parameters have no derivative in the equations")
    }

    /// Σ ∂e/∂v der(v) over the variables of e, and ∂e/∂t.
    fn total_derivative(&self, node: Node) -> Result<Node> {
        let graph = self.graph;
        let symbols = graph.symbols_of(&[node]).len();
        self.charge(symbols as u64)?;
        let time = self.symbols.time();
        total_derivative(graph, node, time, |symbol| {
            let derivative = self.symbols.derivative(symbol);
            if derivative.is_some() || symbol == time || self.symbols.parameters.contains(&symbol) {
                return Ok(derivative);
            }
            let name = graph.symbol_name(symbol).unwrap_or_default();
            let message = format!("`der` of an expression with `{name}`, which has none");
            Err(self
                .problem(message)
                .hint("inputs and parameters have no derivative in the equations"))
        })
    }

    /// `semiLinear(x, a, b)`: a x where x ≥ 0, else b x.
    pub(super) fn semi_linear(&mut self, call: &'a Call) -> Result<Value> {
        let [x, above, below] = self.arguments(call)?;
        let x = self.scalar(x)?;
        let (above, below) = (self.scalar(above)?, self.scalar(below)?);
        let zero = Scalar::Integer(0);
        let positive = self.compare(">=", x, zero)?;
        let slope = above.select(positive, below, self.graph);
        let slope = slope.ok_or_else(|| expected_number(self.at))?;
        let product = self.scalar_binary(Binary::Mul, slope, x)?;
        Ok(product.into())
    }

    /// The cross product of two vectors of three elements.
    pub(super) fn cross(&mut self, call: &'a Call) -> Result<Value> {
        let (a, b) = self.two_arguments(call)?;
        let ([a1, a2, a3], [b1, b2, b3]) = (&a.elements[..], &b.elements[..]) else {
            let message = "`cross` takes two vectors of three elements";
            return Err(self.problem(message));
        };
        let term = |p: &Scalar, q: &Scalar, r: &Scalar, s: &Scalar| {
            let first = self.scalar_binary(Binary::Mul, *p, *q)?;
            let second = self.scalar_binary(Binary::Mul, *r, *s)?;
            self.scalar_binary(Binary::Sub, first, second)
        };
        let elements = vec![
            term(a2, b3, a3, b2)?,
            term(a3, b1, a1, b3)?,
            term(a1, b2, a2, b1)?,
        ];
        Ok(Value::vector(elements))
    }
}
