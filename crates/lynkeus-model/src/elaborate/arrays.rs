//! Arrays: constructors (`{…}`, `[…; …]`, ranges, comprehensions), subscripts (`x[2:end]`), and the
//! functions that make, measure and reduce them.

use lynkeus_expr::Binary;

use super::arithmetic::overflow;
use super::evaluate::Evaluator;
use super::scope::Named;
use super::value::{Array, Scalar, Value, describe_dims, element_count, unequal_sizes};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_RANK;
use crate::syntax::ast::{Call, ExprId, ForIndex, Kind};
use crate::syntax::{plain, too_many_dimensions};

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
        iterators: &'a [ForIndex],
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
    pub(crate) fn turns(&mut self, iterator: &'a ForIndex) -> Result<Vec<Scalar>> {
        let value = self.structural(iterator.range)?;
        self.range_elements(value, self.span(iterator.range))
    }

    /// The elements of what a loop goes over.
    pub(super) fn range_elements(&self, value: Value, span: Span) -> Result<Vec<Scalar>> {
        if value.dims().len() != 1 {
            let found = describe_dims(value.dims());
            let message = format!("expected a range, found {found}");
            return Err(Problem::new(span, message).hint("write `for i in 1:N`"));
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
        self.fold(Binary::Add, elements, Scalar::Integer(0), span)
    }

    /// The elements joined by an operator; `empty` where there are none.
    pub(super) fn fold(
        &self,
        operator: Binary,
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
                Value::Scalar(self.fold(Binary::Mul, &elements, empty, span)?)
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

/// The places that one subscript selects, from 0.
enum Places {
    One(usize),
    Many(Vec<usize>),
}

impl<'a> Evaluator<'a> {
    pub(super) fn index(
        &mut self,
        base: ExprId,
        subscripts: &'a [ExprId],
        span: Span,
    ) -> Result<Value> {
        let name = self.span(base);
        if !matches!(self.ast.expression(base).kind, Kind::Name) {
            let Array { dims, elements } = self.value(base)?.into_array();
            self.check_rank("the array", &dims, subscripts, span)?;
            let places = self.places("the array", &dims, subscripts)?;
            return self.gather(&dims, &elements, &places, span);
        }
        let text = plain(self.text(name));
        if self.iterator(&text).is_some() {
            return Err(not_an_array(&text, name));
        }
        self.index_at(&text, subscripts, name, span)
    }

    /// Elements of the array of this name.
    pub(super) fn index_named(
        &mut self,
        text: &str,
        subscripts: &[ExprId],
        span: Span,
    ) -> Result<Value> {
        self.index_at(text, subscripts, span, span)
    }

    fn index_at(
        &mut self,
        text: &str,
        subscripts: &[ExprId],
        name: Span,
        span: Span,
    ) -> Result<Value> {
        if let Some(Ok(local)) = self.local(text) {
            let dims = local.dims.clone();
            let (kept, offsets) = self.selected(text, &dims, subscripts, span)?;
            let local = self.local(text).and_then(std::result::Result::ok);
            let element = |&offset: &usize| local?.elements.get(offset).copied()?;
            let elements: Option<Vec<Scalar>> = offsets.iter().map(element).collect();
            let elements = elements.ok_or_else(|| self.unassigned(text, name))?;
            return Ok(Value::new(kept, elements));
        }
        match self.named(text) {
            Named::Array(dims, elements) => {
                self.check_rank(text, dims, subscripts, span)?;
                let places = self.places(text, dims, subscripts)?;
                self.gather(dims, elements, &places, span)
            }
            Named::Scalar(_) => Err(not_an_array(text, name)),
            Named::Unknown => self.index_by_full_name(text, name, subscripts),
            found => self.meant(found, name),
        }
    }

    /// The size that subscripts select, and the offsets of its elements.
    pub(super) fn selected(
        &mut self,
        text: &str,
        dims: &[usize],
        subscripts: &[ExprId],
        span: Span,
    ) -> Result<(Vec<usize>, Vec<usize>)> {
        if !subscripts.is_empty() {
            self.check_rank(text, dims, subscripts, span)?;
        }
        let places = self.places(text, dims, subscripts)?;
        self.offsets(dims, &places, span)
    }

    /// Names such as `x[3]` that the caller of a single expression knows.
    fn index_by_full_name(
        &mut self,
        text: &str,
        name: Span,
        subscripts: &[ExprId],
    ) -> Result<Value> {
        let mut numbers = vec![];
        for &subscript in subscripts {
            if matches!(self.ast.expression(subscript).kind, Kind::All | Kind::End) {
                return Err(self.unknown_name(name));
            }
            numbers.push(self.known_integer(subscript, "a subscript")?.to_string());
        }
        let full = format!("{text}[{}]", numbers.join(","));
        self.meant(self.named(&full), name)
    }

    fn check_rank(
        &self,
        text: &str,
        dims: &[usize],
        subscripts: &[ExprId],
        span: Span,
    ) -> Result<()> {
        if dims.is_empty() {
            return Err(not_an_array(text, span));
        }
        if subscripts.len() > dims.len() {
            let (given, has) = (subscripts.len(), describe_dims(dims));
            let message = format!("{given} subscripts, but `{text}` has the size {has}");
            return Err(Problem::new(span, message));
        }
        Ok(())
    }

    fn places(&mut self, text: &str, dims: &[usize], subscripts: &[ExprId]) -> Result<Vec<Places>> {
        let mut places = Vec::with_capacity(subscripts.len());
        for (&subscript, &dim) in subscripts.iter().zip(dims) {
            self.ends.push(dim);
            let place = self.place(text, dim, subscript);
            self.ends.pop();
            places.push(place?);
        }
        Ok(places)
    }

    fn place(&mut self, text: &str, dim: usize, subscript: ExprId) -> Result<Places> {
        let span = self.span(subscript);
        if matches!(self.ast.expression(subscript).kind, Kind::All) {
            self.budget.charge(dim as u64, span)?;
            return Ok(Places::Many((0..dim).collect()));
        }
        match self.structural(subscript)? {
            Value::Array(Array { dims, elements }) if dims.len() == 1 => {
                let places = elements.into_iter().map(|element| match element {
                    Scalar::Integer(value) => within(text, dim, value, span),
                    _ => Err(not_whole(span)),
                });
                Ok(Places::Many(places.collect::<Result<_>>()?))
            }
            Value::Scalar(Scalar::Integer(value)) => {
                Ok(Places::One(within(text, dim, value, span)?))
            }
            _ => Err(not_whole(span)),
        }
    }

    fn gather(
        &self,
        dims: &[usize],
        elements: &[Scalar],
        places: &[Places],
        span: Span,
    ) -> Result<Value> {
        let (kept, offsets) = self.offsets(dims, places, span)?;
        let selected = offsets
            .iter()
            .filter_map(|&offset| elements.get(offset).copied());
        Ok(Value::new(kept, selected.collect()))
    }

    fn offsets(
        &self,
        dims: &[usize],
        places: &[Places],
        span: Span,
    ) -> Result<(Vec<usize>, Vec<usize>)> {
        let mut kept = vec![];
        let mut offsets = vec![0usize];
        for (axis, &dim) in dims.iter().enumerate() {
            let whole;
            let selected = match places.get(axis) {
                Some(Places::One(place)) => std::slice::from_ref(place),
                Some(Places::Many(places)) => {
                    kept.push(places.len());
                    places.as_slice()
                }
                None => {
                    self.budget.charge(dim as u64, span)?;
                    kept.push(dim);
                    whole = (0..dim).collect::<Vec<_>>();
                    whole.as_slice()
                }
            };
            let count = element_count(&[offsets.len(), selected.len()]).unwrap_or(u64::MAX);
            self.budget.charge(count, span)?;
            let step = |&offset: &usize| selected.iter().map(move |place| offset * dim + place);
            offsets = offsets.iter().flat_map(step).collect();
        }
        Ok((kept, offsets))
    }
}

fn within(text: &str, dim: usize, value: i64, span: Span) -> Result<usize> {
    let place = usize::try_from(value)
        .ok()
        .filter(|place| (1..=dim).contains(place));
    place.map(|place| place - 1).ok_or_else(|| {
        Problem::new(
            span,
            format!("subscript {value} of `{text}` is outside 1..{dim}"),
        )
        .label(format!("this is {value}"))
    })
}

fn not_an_array(text: &str, span: Span) -> Box<Problem> {
    Problem::new(
        span,
        format!("`{text}` is a scalar and takes no subscripts"),
    )
}

fn not_whole(span: Span) -> Box<Problem> {
    Problem::new(
        span,
        "a subscript must be an Integer or a range of Integers",
    )
    .hint("`/` and `^` always give a Real: use `div(a, b)` or `integer(a)`")
}
