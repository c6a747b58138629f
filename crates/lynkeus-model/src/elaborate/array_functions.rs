//! The functions that make, measure and reduce arrays.

use super::evaluate::Evaluator;
use super::value::{Array, Scalar, Value, describe_dims, element_count};
use crate::limits::MAX_RANK;
use crate::syntax::ast::{BinaryOperator, Call, ExprId, Kind};
use crate::syntax::{Problem, Result, Span, plain, too_many_dimensions};

impl<'a> Evaluator<'a> {
    /// `None` where there is no such function.
    pub(super) fn array_function(
        &mut self,
        name: &str,
        call: &'a Call,
        span: Span,
    ) -> Result<Option<Value>> {
        let value = match name {
            "sum" => {
                let elements = self.reduced(call, span)?;
                Value::Scalar(self.sum(&elements, span)?)
            }
            "product" => {
                let elements = self.reduced(call, span)?;
                let empty = Scalar::Integer(1);
                Value::Scalar(self.fold(BinaryOperator::Multiply, &elements, empty, span)?)
            }
            "array" if !call.iterators.is_empty() => self.iterated(call, span)?,
            "array" => self.array(&call.arguments, span)?,
            "size" => self.size(call)?,
            "ndims" => {
                let [argument] = self.arguments(call)?;
                Value::Scalar(integer(self.dims_of(argument)?.len()))
            }
            "zeros" => self.filled(Scalar::Integer(0), &call.arguments, span)?,
            "ones" => self.filled(Scalar::Integer(1), &call.arguments, span)?,
            "fill" => self.fill(call, span)?,
            "linspace" => self.linspace(call, span)?,
            "identity" | "diagonal" => self.diagonal(name, call, span)?,
            "transpose" => self.transpose(call, span)?,
            "cat" => self.cat(call, span)?,
            "scalar" | "vector" | "matrix" => self.reshaped(name, call, span)?,
            _ => return Ok(None),
        };
        Ok(Some(value))
    }

    /// The elements that `sum(A)` or `sum(e for i in r)` goes over.
    pub(super) fn reduced(&mut self, call: &'a Call, span: Span) -> Result<Vec<Scalar>> {
        let value = match call.iterators.is_empty() {
            true => self.only_argument(call)?,
            false => self.iterated(call, span)?,
        };
        Ok(value.into_array().elements)
    }

    fn iterated(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        match call.arguments.first() {
            Some(&body) => self.comprehension(body, &call.iterators, span),
            None => Err(Problem::new(span, "expected an expression before `for`")),
        }
    }

    /// Sizes of an expression; of a declared name also where its value is not known.
    fn dims_of(&mut self, argument: ExprId) -> Result<Vec<usize>> {
        if matches!(self.ast.expression(argument).kind, Kind::Name) {
            let name = plain(self.text(self.span(argument)));
            let known = match self.local(&name) {
                Some(local) => local.ok().map(|local| local.dims.as_slice()),
                None => self.scope.dims(&name),
            };
            if let Some(dims) = known.filter(|_| self.iterator(&name).is_none()) {
                return Ok(dims.to_vec());
            }
        }
        Ok(self.value(argument)?.dims().to_vec())
    }

    fn size(&mut self, call: &Call) -> Result<Value> {
        if call.arguments.len() == 1 {
            let [array] = self.arguments(call)?;
            let dims = self.dims_of(array)?;
            return Ok(Value::vector(dims.into_iter().map(integer).collect()));
        }
        let [array, axis] = self.arguments(call)?;
        let dims = self.dims_of(array)?;
        let number = self.known_integer(axis, "the dimension")?;
        let dim = usize::try_from(number)
            .ok()
            .and_then(|axis| dims.get(axis.checked_sub(1)?));
        dim.map(|&dim| Value::Scalar(integer(dim))).ok_or_else(|| {
            let found = describe_dims(&dims);
            let message = format!("there is no dimension {number}: the size is {found}");
            Problem::new(self.span(axis), message)
        })
    }

    fn fill(&mut self, call: &'a Call, span: Span) -> Result<Value> {
        match call.arguments.split_first() {
            Some((&value, dims)) if !dims.is_empty() => {
                let value = self.scalar(value)?;
                self.filled(value, dims, span)
            }
            _ => Err(Problem::new(
                span,
                "`fill` takes a value and at least one size",
            )),
        }
    }

    fn filled(&mut self, value: Scalar, sizes: &[ExprId], span: Span) -> Result<Value> {
        let dims: Result<Vec<usize>> = sizes.iter().map(|&size| self.length(size)).collect();
        let dims = dims?;
        if dims.is_empty() {
            return Err(Problem::new(span, "expected at least one size"));
        }
        if dims.len() > MAX_RANK {
            return Err(too_many_dimensions(span));
        }
        // Sizes beside a size of zero count too: other functions walk along them.
        let walked: Vec<usize> = dims.iter().map(|&dim| dim.max(1)).collect();
        self.budget
            .charge(element_count(&walked).unwrap_or(u64::MAX), span)?;
        let count = dims.iter().product();
        Ok(Value::new(dims, vec![value; count]))
    }

    /// A size: an Integer from 0 on.
    pub(crate) fn length(&mut self, id: ExprId) -> Result<usize> {
        let value = self.known_integer(id, "a size")?;
        usize::try_from(value).map_err(|_| {
            Problem::new(
                self.span(id),
                format!("a size must not be negative, this is {value}"),
            )
        })
    }

    fn linspace(&mut self, call: &Call, span: Span) -> Result<Value> {
        let [from, to, count] = self.arguments(call)?;
        let (from, to) = (self.scalar(from)?, self.scalar(to)?);
        let (from, to) = (self.real(from, span)?, self.real(to, span)?);
        let count = self.length(count)?;
        if count < 2 {
            return Err(Problem::new(span, "`linspace` takes at least two points"));
        }
        self.budget.charge(count as u64, span)?;
        let (from, to) = (self.graph.expr(from), self.graph.expr(to));
        let point = |i: usize| {
            let fraction = i as f64 / (count - 1) as f64;
            Scalar::Real((from + fraction * (to - from)).node())
        };
        Ok(Value::vector((0..count).map(point).collect()))
    }

    fn diagonal(&mut self, name: &str, call: &Call, span: Span) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let entries = match name {
            "identity" => {
                let n = self.length(argument)?;
                self.budget.charge(n as u64, span)?;
                vec![Scalar::Integer(1); n]
            }
            _ => self.value(argument)?.into_array().elements,
        };
        let n = entries.len();
        let count = element_count(&[n, n]).unwrap_or(u64::MAX);
        self.budget.charge(count, span)?;
        let mut elements = vec![Scalar::Integer(0); count as usize];
        for (place, entry) in elements.iter_mut().step_by(n + 1).zip(entries) {
            *place = entry;
        }
        Ok(Value::new(vec![n, n], elements))
    }

    fn transpose(&mut self, call: &Call, span: Span) -> Result<Value> {
        let Array { dims, elements } = self.only_argument(call)?.into_array();
        let [rows, columns] = dims[..] else {
            let message = format!("`transpose` takes a matrix, found {}", describe_dims(&dims));
            return Err(Problem::new(span, message));
        };
        self.budget.charge(elements.len() as u64, span)?;
        let places = (0..columns).flat_map(|j| (0..rows).map(move |i| i * columns + j));
        let turned = places
            .filter_map(|place| elements.get(place).copied())
            .collect();
        Ok(Value::new(vec![columns, rows], turned))
    }

    fn cat(&mut self, call: &Call, span: Span) -> Result<Value> {
        let Some((&axis, parts)) = call.arguments.split_first() else {
            return Err(Problem::new(span, "`cat` takes a dimension and arrays"));
        };
        let axis = self.length(axis)?;
        let mut arrays = vec![];
        for &part in parts {
            let array = self.value(part)?.into_array();
            if axis == 0 || axis > array.dims.len() {
                let found = describe_dims(&array.dims);
                let message = format!("there is no dimension {axis}: the size is {found}");
                return Err(Problem::new(self.span(part), message));
            }
            arrays.push(array);
        }
        let Array { dims, elements } = self.concatenate(axis.saturating_sub(1), arrays, span)?;
        Ok(Value::new(dims, elements))
    }

    fn reshaped(&mut self, name: &str, call: &Call, span: Span) -> Result<Value> {
        let Array { dims, elements } = self.only_argument(call)?.into_array();
        let long = dims.iter().filter(|&&dim| dim != 1).count();
        let allowed = match name {
            "scalar" => elements.len() == 1,
            "vector" => long <= 1,
            _ => dims.len() <= 2,
        };
        if !allowed {
            let message = format!("`{name}` of an array of size {}", describe_dims(&dims));
            return Err(Problem::new(span, message));
        }
        let dims = match name {
            "scalar" => vec![],
            "vector" => vec![elements.len()],
            _ => {
                let mut dims = dims;
                dims.resize(2, 1);
                dims
            }
        };
        Ok(Value::new(dims, elements))
    }
}

/// Sizes fit an Integer: every one of them is below the limit on elements.
fn integer(size: usize) -> Scalar {
    Scalar::Integer(i64::try_from(size).unwrap_or(i64::MAX))
}
