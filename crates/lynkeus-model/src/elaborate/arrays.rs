//! Constructors of arrays: `{…}`, `[…; …]`, ranges, comprehensions, concatenation.

use super::arithmetic::{overflow, unequal_sizes};
use super::evaluate::Evaluator;
use super::value::{Array, Scalar, Value, describe_dims};
use crate::syntax::ast::{BinaryOperator, ExprId, Iterator as Loop};
use crate::syntax::{Problem, Result, Span};

impl<'a> Evaluator<'a> {
    /// `{a, b, c}`
    pub(super) fn array(&mut self, elements: &'a [ExprId], span: Span) -> Result<Value> {
        let values: Result<Vec<Value>> = elements.iter().map(|&id| self.value(id)).collect();
        self.stack(values?, span)
    }

    /// Values of one size, side by side along a new first dimension.
    pub(super) fn stack(&self, values: Vec<Value>, span: Span) -> Result<Value> {
        let Some(first) = values.first() else {
            return Ok(Value::vector(vec![]));
        };
        if let Some(other) = values.iter().find(|value| value.dims() != first.dims()) {
            let (one, two) = (describe_dims(first.dims()), describe_dims(other.dims()));
            let message = format!("the elements differ in size: {one} and {two}");
            return Err(Problem::new(span, message));
        }
        let mut dims = vec![values.len()];
        dims.extend(first.dims());
        let mut elements = Vec::with_capacity(values.len());
        for value in &values {
            self.budget.charge(value.elements().len() as u64, span)?;
            elements.extend_from_slice(value.elements());
        }
        Ok(Value::Array(Array { dims, elements }))
    }

    /// `[a, b; c, d]`
    pub(super) fn matrix(&mut self, rows: &'a [Vec<ExprId>], span: Span) -> Result<Value> {
        let mut stacked = vec![];
        for row in rows {
            let mut parts = vec![];
            for &id in row {
                parts.push(as_matrix(self.value(id)?, self.span(id))?);
            }
            stacked.push(self.concatenate(1, parts, span)?);
        }
        let Array { dims, elements } = self.concatenate(0, stacked, span)?;
        Ok(Value::new(dims, elements))
    }

    /// Joins arrays along an axis (from 0); the other sizes must agree.
    pub(super) fn concatenate(&self, axis: usize, parts: Vec<Array>, span: Span) -> Result<Array> {
        let Some(first) = parts.first() else {
            return Ok(Array {
                dims: vec![0],
                elements: vec![],
            });
        };
        let mut dims = first.dims.clone();
        let without_axis = |dims: &[usize]| {
            let mut dims = dims.to_vec();
            if let Some(dim) = dims.get_mut(axis) {
                *dim = 0;
            }
            dims
        };
        let differs = |part: &&Array| without_axis(&part.dims) != without_axis(&dims);
        if let Some(other) = parts.iter().find(differs) {
            return Err(unequal_sizes(&dims, &other.dims, span));
        }
        let total: usize = parts.iter().map(|part| part.elements.len()).sum();
        self.budget.charge(total as u64, span)?;
        let outer: usize = dims.iter().take(axis).product();
        let mut elements = Vec::with_capacity(total);
        for row in 0..outer {
            for part in &parts {
                let chunk: usize = part.dims.iter().skip(axis).product();
                elements.extend(part.elements.iter().skip(row * chunk).take(chunk));
            }
        }
        if let Some(dim) = dims.get_mut(axis) {
            *dim = parts.iter().filter_map(|part| part.dims.get(axis)).sum();
        }
        Ok(Array { dims, elements })
    }

    /// `{e for i in r, j in s}`: the first iterator varies fastest.
    pub(super) fn comprehension(
        &mut self,
        body: ExprId,
        iterators: &'a [Loop],
        span: Span,
    ) -> Result<Value> {
        let Some((outer, inner)) = iterators.split_last() else {
            return self.value(body);
        };
        let mut values = vec![];
        for turn in self.turns(outer)? {
            self.budget.charge(1, span)?;
            self.loops.push((self.text(outer.name), turn));
            let value = self.comprehension(body, inner, span);
            self.loops.pop();
            values.push(value?);
        }
        self.stack(values, span)
    }

    /// The values an iterator takes.
    pub(crate) fn turns(&mut self, iterator: &'a Loop) -> Result<Vec<Scalar>> {
        let value = self.structural(iterator.range)?;
        if value.dims().len() != 1 {
            let found = describe_dims(value.dims());
            let message = format!("expected a range, found {found}");
            return Err(
                Problem::new(self.span(iterator.range), message).hint("write `for i in 1:N`")
            );
        }
        Ok(value.into_array().elements)
    }

    /// `a:b` and `a:step:b`
    pub(super) fn range(
        &mut self,
        start: ExprId,
        step: Option<ExprId>,
        stop: ExprId,
        span: Span,
    ) -> Result<Value> {
        let mut bound = |id: ExprId| match self.structural(id)? {
            Value::Scalar(scalar) => Ok(scalar),
            Value::Array(_) => Err(Problem::new(self.span(id), "a bound must be a scalar")),
        };
        let step = step.map_or(Ok(Scalar::Integer(1)), &mut bound)?;
        let (start, stop) = (bound(start)?, bound(stop)?);
        match (start, step, stop) {
            (_, Scalar::Integer(0), _) => Err(Problem::new(span, "the step of a range is zero")),
            (Scalar::Integer(start), Scalar::Integer(step), Scalar::Integer(stop)) => {
                self.integer_range(start, step, stop, span)
            }
            _ => self.real_range(start, step, stop, span),
        }
    }

    fn integer_range(&self, start: i64, step: i64, stop: i64, span: Span) -> Result<Value> {
        let turns = (i128::from(stop) - i128::from(start)) / i128::from(step) + 1;
        let forward = if step > 0 {
            start <= stop
        } else {
            start >= stop
        };
        let count = if forward {
            u64::try_from(turns).unwrap_or(u64::MAX)
        } else {
            0
        };
        self.budget.charge(count, span)?;
        let mut elements = vec![];
        for turn in 0..count as i64 {
            let value = turn
                .checked_mul(step)
                .and_then(|offset| start.checked_add(offset));
            elements.push(Scalar::Integer(value.ok_or_else(|| overflow(span))?));
        }
        Ok(Value::vector(elements))
    }

    fn real_range(&self, start: Scalar, step: Scalar, stop: Scalar, span: Span) -> Result<Value> {
        let known = |scalar: Scalar| {
            let message = "the bounds of a range must be known numbers";
            scalar
                .number(self.graph)
                .ok_or_else(|| Problem::new(span, message))
        };
        let (start, step, stop) = (known(start)?, known(step)?, known(stop)?);
        let turns = ((stop - start) / step).floor() + 1.0;
        if step == 0.0 || turns.is_nan() {
            return Err(Problem::new(span, "the step of a range is zero"));
        }
        // A saturating cast: anything too large is refused by the budget.
        let count = turns.max(0.0) as u64;
        self.budget.charge(count, span)?;
        let value = |turn: u64| self.graph.constant(start + turn as f64 * step).node();
        Ok(Value::vector(
            (0..count).map(|turn| Scalar::Real(value(turn))).collect(),
        ))
    }

    /// The sum of scalars, from the left.
    pub(super) fn sum(&self, elements: &[Scalar], span: Span) -> Result<Scalar> {
        self.fold(BinaryOperator::Add, elements, Scalar::Integer(0), span)
    }

    /// The elements joined by an operator; `empty` where there are none.
    pub(super) fn fold(
        &self,
        operator: BinaryOperator,
        elements: &[Scalar],
        empty: Scalar,
        span: Span,
    ) -> Result<Scalar> {
        self.budget.charge(elements.len() as u64, span)?;
        let Some((&first, rest)) = elements.split_first() else {
            return Ok(empty);
        };
        rest.iter().try_fold(first, |sum, &next| {
            self.scalar_binary(operator, sum, next, span)
        })
    }
}

/// A scalar as 1 × 1, a vector as a column.
fn as_matrix(value: Value, span: Span) -> Result<Array> {
    let Array { mut dims, elements } = value.into_array();
    if dims.len() > 2 {
        return Err(Problem::new(
            span,
            "expected a scalar, a vector or a matrix",
        ));
    }
    dims.resize(2, 1);
    Ok(Array { dims, elements })
}
