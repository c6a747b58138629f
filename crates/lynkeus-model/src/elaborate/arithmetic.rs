//! Operators on scalars, arrays and matrices.

use lynkeus_expr::{Binary, Expr, Node, Unary};

use super::evaluate::Evaluator;
use super::value::{Scalar, Value, describe_dims, expected_number};
use crate::diagnostic::{Problem, Result, Span};

impl Evaluator<'_> {
    /// A number as a Real expression.
    pub(super) fn real(&self, scalar: Scalar) -> Result<Node> {
        let expected = || expected_number(self.at);
        scalar.real(self.graph).ok_or_else(expected)
    }

    /// A truth value.
    pub(super) fn boolean(&self, value: &Value, span: Span) -> Result<Node> {
        match value.as_scalar() {
            Some(Scalar::Boolean(node)) => Ok(node),
            _ => Err(Problem::new(span, "expected a condition, found a number")
                .hint("compare it, as in `u > 0`")),
        }
    }

    /// Applies an operation to every element.
    pub(super) fn map(
        &self,
        mut value: Value,
        operation: impl Fn(Scalar) -> Result<Scalar>,
    ) -> Result<Value> {
        self.charge(value.elements.len() as u64)?;
        for element in &mut value.elements {
            *element = operation(*element)?;
        }
        Ok(value)
    }

    /// Applies an operation to the elements of two arrays of one size, or of an array and a
    /// scalar.
    pub(super) fn elementwise(
        &self,
        left: Value,
        right: Value,
        operation: impl Fn(Scalar, Scalar) -> Result<Scalar>,
    ) -> Result<Value> {
        if !left.dims.is_empty() && !right.dims.is_empty() && left.dims != right.dims {
            return Err(self.unequal_sizes(&left.dims, &right.dims));
        }
        let (dims, count) = match left.dims[..] {
            [] => (&right.dims, right.elements.len()),
            _ => (&left.dims, left.elements.len()),
        };
        self.charge(count as u64)?;
        let at = |value: &Value, i: usize| match value.dims[..] {
            [] => value.elements[0],
            _ => value.elements[i],
        };
        let pairs = (0..count).map(|i| (at(&left, i), at(&right, i)));
        let elements = pairs.map(|(a, b)| operation(a, b));
        Ok(Value {
            elements: elements.collect::<Result<_>>()?,
            dims: dims.clone(),
        })
    }

    pub(super) fn unequal_sizes(&self, left: &[usize], right: &[usize]) -> Problem {
        let (left, right) = (describe_dims(left), describe_dims(right));
        self.problem(format!(
            "the sizes differ: left is {left}, right is {right}"
        ))
    }

    pub(super) fn binary(
        &self,
        operation: Binary,
        elementwise: bool,
        left: Value,
        right: Value,
    ) -> Result<Value> {
        match operation {
            Binary::And | Binary::Or => {
                let (left, right) = (
                    self.boolean(&left, self.at)?,
                    self.boolean(&right, self.at)?,
                );
                let node = self.graph.binary(operation, left, right);
                return Ok(Scalar::Boolean(node).into());
            }
            _ if elementwise => {}
            Binary::Add | Binary::Sub if left.dims != right.dims => {
                let problem = self.unequal_sizes(&left.dims, &right.dims);
                return Err(match left.dims.is_empty() || right.dims.is_empty() {
                    true => problem.hint("`.+` and `.-` take a scalar with every element"),
                    false => problem,
                });
            }
            Binary::Mul if !left.dims.is_empty() && !right.dims.is_empty() => {
                return self.product(&left, &right);
            }
            Binary::Div if !right.dims.is_empty() => {
                return Err(self
                    .problem("division by an array")
                    .hint("`./` divides by every element"));
            }
            _ => {}
        }
        if let (Some(a), Some(b)) = (left.as_scalar(), right.as_scalar()) {
            return Ok(self.scalar_binary(operation, a, b)?.into());
        }
        let of_two = |a, b| self.scalar_binary(operation, a, b);
        self.elementwise(left, right, of_two)
    }

    pub(super) fn scalar_binary(
        &self,
        operation: Binary,
        left: Scalar,
        right: Scalar,
    ) -> Result<Scalar> {
        match operation {
            Binary::Add => self.of_two(left, right, i64::checked_add, |a, b| a + b),
            Binary::Sub => self.of_two(left, right, i64::checked_sub, |a, b| a - b),
            Binary::Mul => self.of_two(left, right, i64::checked_mul, |a, b| a * b),
            _ => {
                let (left, right) = (self.real(left)?, self.real(right)?);
                if self.graph.constant_value(right) == Some(0.0) {
                    return Err(self.problem("division by zero"));
                }
                Ok(Scalar::Real(self.graph.binary(Binary::Div, left, right)))
            }
        }
    }

    pub(super) fn negated(&self, scalar: Scalar) -> Result<Scalar> {
        self.of_one(scalar, i64::checked_neg, |a| -a)
    }

    pub(super) fn overflow(&self) -> Problem {
        let problem = self.problem("this Integer does not fit in 64 bits");
        problem.hint("use Real numbers")
    }

    /// Of an Integer the exact result, which must fit; else that of a Real.
    pub(super) fn of_one(
        &self,
        a: Scalar,
        exact: impl Fn(i64) -> Option<i64>,
        real: impl for<'g> Fn(Expr<'g>) -> Expr<'g>,
    ) -> Result<Scalar> {
        if let Scalar::Integer(a) = a {
            return exact(a).map(Scalar::Integer).ok_or_else(|| self.overflow());
        }
        let a = self.graph.expr(self.real(a)?);
        Ok(Scalar::Real(real(a).node()))
    }

    /// Of two Integers the exact result, which must fit; else that of Reals.
    pub(super) fn of_two(
        &self,
        a: Scalar,
        b: Scalar,
        exact: impl Fn(i64, i64) -> Option<i64>,
        real: impl for<'g> Fn(Expr<'g>, Expr<'g>) -> Expr<'g>,
    ) -> Result<Scalar> {
        if let (Scalar::Integer(a), Scalar::Integer(b)) = (a, b) {
            let exact = exact(a, b).map(Scalar::Integer);
            return exact.ok_or_else(|| self.overflow());
        }
        let (a, b) = (self.real(a)?, self.real(b)?);
        Ok(Scalar::Real(
            real(self.graph.expr(a), self.graph.expr(b)).node(),
        ))
    }

    pub(super) fn power(&self, base: Value, exponent: Value, elementwise: bool) -> Result<Value> {
        let are_scalars = base.dims.is_empty() && exponent.dims.is_empty();
        if !elementwise && !are_scalars {
            return Err(self
                .problem("powers of arrays are not supported")
                .hint("`.^` takes the power of every element"));
        }
        let power = |base, exponent| self.scalar_power(base, exponent);
        self.elementwise(base, exponent, power)
    }

    /// A known whole exponent gives an integer power, which takes any base.
    fn scalar_power(&self, base: Scalar, exponent: Scalar) -> Result<Scalar> {
        let node = self.real(base)?;
        let whole = exponent
            .number(self.graph)
            .filter(|value| value.fract() == 0.0 && value.abs() <= f64::from(i32::MAX));
        let power = match whole {
            Some(exponent) => self.graph.powi(node, exponent as i32),
            None => self.graph.binary(Binary::Pow, node, self.real(exponent)?),
        };
        Ok(Scalar::Real(power))
    }

    pub(super) fn compare(&self, relation: &str, left: Scalar, right: Scalar) -> Result<Node> {
        let sides = left.with(right, self.graph);
        let (left, right) = sides.ok_or_else(|| expected_number(self.at))?;
        Ok(match relation {
            "<" => self.graph.binary(Binary::Less, left, right),
            "<=" => self.graph.binary(Binary::LessEq, left, right),
            ">" => self.graph.binary(Binary::Less, right, left),
            ">=" => self.graph.binary(Binary::LessEq, right, left),
            "==" => self.graph.binary(Binary::Equal, left, right),
            _ => {
                let equal = self.graph.binary(Binary::Equal, left, right);
                self.graph.unary(Unary::Not, equal)
            }
        })
    }

    /// Scalar product, or product of matrices and vectors.
    fn product(&self, left: &Value, right: &Value) -> Result<Value> {
        let no_product = || no_product(&left.dims, &right.dims, self.at);
        let [.., inner] = left.dims[..] else {
            return Err(no_product());
        };
        let (rows, columns, dims) = match (&left.dims[..], &right.dims[..]) {
            (_, &[across, ..]) if inner != across => return Err(no_product()),
            (&[_], &[_]) => (1, 1, vec![]),
            (&[_], &[_, columns]) => (1, columns, vec![columns]),
            (&[rows, _], &[_]) => (rows, 1, vec![rows]),
            (&[rows, _], &[_, columns]) => (rows, columns, vec![rows, columns]),
            _ => return Err(no_product()),
        };
        let work = (rows as u64)
            .saturating_mul(inner as u64)
            .saturating_mul(columns as u64);
        self.charge(work.max(rows as u64 * columns as u64))?;
        let mut elements = Vec::with_capacity(rows * columns);
        for row in 0..rows {
            for column in 0..columns {
                let left = left.elements[row * inner..].iter().take(inner);
                let right = right.elements.iter().skip(column).step_by(columns);
                let terms = left.copied().zip(right.copied());
                elements.push(self.sum_of_products(terms)?);
            }
        }
        Ok(Value { dims, elements })
    }

    fn sum_of_products(&self, terms: impl Iterator<Item = (Scalar, Scalar)>) -> Result<Scalar> {
        let mut sum = None;
        for (a, b) in terms {
            // A zero entry of a matrix says that there is no such term. Keeping `0*x` would
            // make every state depend on every other.
            if a.number(self.graph) == Some(0.0) || b.number(self.graph) == Some(0.0) {
                continue;
            }
            let term = self.scalar_binary(Binary::Mul, a, b)?;
            sum = Some(match sum {
                Some(sum) => self.scalar_binary(Binary::Add, sum, term)?,
                None => term,
            });
        }
        Ok(sum.unwrap_or(Scalar::Integer(0)))
    }
}

fn no_product(left: &[usize], right: &[usize], span: Span) -> Problem {
    let (left, right) = (describe_dims(left), describe_dims(right));
    Problem::new(span, format!("no product of sizes {left} and {right}"))
        .hint("the inner sizes of a matrix product must agree; `.*` multiplies element by element")
}
