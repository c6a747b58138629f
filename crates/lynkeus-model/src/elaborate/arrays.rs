//! Arrays: constructors (`{…}`, `[…; …]`, ranges, comprehensions), subscripts (`x[2:end]`), and the
//! functions that make, measure and reduce them.

use lynkeus_expr::Binary;

use super::evaluate::{Evaluator, HOW_TO_BE_WHOLE};
use super::scope::Named;
use super::value::{Scalar, Value, describe_dims, element_count};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_RANK;
use crate::syntax::ast::{Call, ExprId, ForIndex, Kind};
use crate::syntax::{plain, too_many_dimensions};

impl<'a> Evaluator<'a> {
    /// `{a, b, c}`
    pub(super) fn array(&mut self, elements: &'a [ExprId]) -> Result<Value> {
        let values: Result<Vec<Value>> = elements.iter().map(|&id| self.value(id)).collect();
        self.stack(values?)
    }

    /// Values of one size, side by side along a new first dimension.
    pub(super) fn stack(&self, values: Vec<Value>) -> Result<Value> {
        let Some(first) = values.first() else {
            return Ok(Value::vector(vec![]));
        };
        if let Some(other) = values.iter().find(|value| value.dims != first.dims) {
            let (one, two) = (describe_dims(&first.dims), describe_dims(&other.dims));
            let message = format!("the elements differ in size: {one} and {two}");
            return Err(self.problem(message));
        }
        let dims = [&[values.len()], &first.dims[..]].concat();
        let mut elements = Vec::with_capacity(values.len());
        for value in &values {
            self.charge(value.elements.len() as u64)?;
            elements.extend_from_slice(&value.elements);
        }
        Ok(Value { dims, elements })
    }

    /// `[a, b; c, d]`
    pub(super) fn matrix(&mut self, rows: &'a [Vec<ExprId>]) -> Result<Value> {
        let mut stacked = vec![];
        for row in rows {
            let mut parts = vec![];
            for &id in row {
                let part = self.value(id)?;
                let message = "expected a scalar, a vector or a matrix";
                let dims = matrix_dims(&part.dims);
                let dims = dims.ok_or_else(|| Problem::new(self.span(id), message))?;
                parts.push(Value { dims, ..part });
            }
            stacked.push(self.concatenate(1, parts)?);
        }
        self.concatenate(0, stacked)
    }

    /// Joins arrays along an axis (from 0); the other sizes must agree.
    fn concatenate(&self, axis: usize, parts: Vec<Value>) -> Result<Value> {
        let Some(first) = parts.first() else {
            return Ok(Value::vector(vec![]));
        };
        // matrices, or arrays that have this axis
        let mut dims = first.dims.clone();
        for part in &parts[1..] {
            dims[axis] = part.dims.get(axis).copied().unwrap_or_default();
            if part.dims != dims {
                return Err(self.unequal_sizes(&first.dims, &part.dims));
            }
        }
        dims[axis] = parts.iter().map(|part| part.dims[axis]).sum();
        let total: usize = parts.iter().map(|part| part.elements.len()).sum();
        self.charge(total as u64)?;
        let outer: usize = dims.iter().take(axis).product();
        let mut elements = Vec::with_capacity(total);
        for row in 0..outer {
            for part in &parts {
                let chunk: usize = part.dims.iter().skip(axis).product();
                elements.extend(part.elements.iter().skip(row * chunk).take(chunk));
            }
        }
        Ok(Value { dims, elements })
    }

    /// `{e for i in r, j in s}`: the first iterator varies fastest.
    pub(super) fn comprehension(
        &mut self,
        body: ExprId,
        iterators: &'a [ForIndex],
    ) -> Result<Value> {
        let Some((outer, inner)) = iterators.split_last() else {
            return self.value(body);
        };
        let mut values = vec![];
        for turn in self.turns(outer)? {
            self.charge(1)?;
            self.loops.push((self.text(outer.name), turn));
            let value = self.comprehension(body, inner);
            self.loops.pop();
            values.push(value?);
        }
        self.stack(values)
    }

    /// The values an iterator takes.
    pub(crate) fn turns(&mut self, iterator: &'a ForIndex) -> Result<Vec<Scalar>> {
        let value = self.structural(iterator.range)?;
        self.range_elements(value, self.span(iterator.range))
    }

    /// The elements of what a loop goes over.
    pub(super) fn range_elements(&self, value: Value, span: Span) -> Result<Vec<Scalar>> {
        if value.dims.len() != 1 {
            let found = describe_dims(&value.dims);
            let message = format!("expected a range, found {found}");
            return Err(Problem::new(span, message).hint("write `for i in 1:N`"));
        }
        Ok(value.elements)
    }

    /// `a:b` and `a:step:b`
    pub(super) fn range(
        &mut self,
        start: ExprId,
        step: Option<ExprId>,
        stop: ExprId,
    ) -> Result<Value> {
        let mut bound = |id: ExprId| {
            let scalar = self.structural(id)?.as_scalar();
            scalar.ok_or_else(|| Problem::new(self.span(id), "a bound must be a scalar"))
        };
        let step = step.map_or(Ok(Scalar::Integer(1)), &mut bound)?;
        let (start, stop) = (bound(start)?, bound(stop)?);
        match (start, step, stop) {
            (_, Scalar::Integer(0), _) => Err(self.problem("the step of a range is zero")),
            (Scalar::Integer(start), Scalar::Integer(step), Scalar::Integer(stop)) => {
                self.integer_range(start, step, stop)
            }
            _ => self.real_range(start, step, stop),
        }
    }

    fn integer_range(&self, start: i64, step: i64, stop: i64) -> Result<Value> {
        let [start, step, stop] = [start, step, stop].map(i128::from);
        let turns = ((stop - start) * step.signum()).div_euclid(step.abs()) + 1;
        let count = u64::try_from(turns.max(0)).unwrap_or(u64::MAX);
        self.charge(count)?;
        // between the bounds, and so in 64 bits
        let value = |turn: u64| Scalar::Integer((start + i128::from(turn) * step) as i64);
        Ok(Value::vector((0..count).map(value).collect()))
    }

    fn real_range(&self, start: Scalar, step: Scalar, stop: Scalar) -> Result<Value> {
        let known = |scalar: Scalar| {
            let message = "the bounds of a range must be known numbers";
            let number = scalar.number(self.graph);
            number.ok_or_else(|| self.problem(message))
        };
        let (start, step, stop) = (known(start)?, known(step)?, known(stop)?);
        let turns = ((stop - start) / step).floor() + 1.0;
        if step == 0.0 || turns.is_nan() {
            return Err(self.problem("the step of a range is zero"));
        }
        // A saturating cast: anything too large is refused by the budget.
        let count = turns.max(0.0) as u64;
        self.charge(count)?;
        let value = |turn: u64| self.graph.constant(start + turn as f64 * step);
        let values = (0..count).map(|turn| Scalar::Real(value(turn).node()));
        Ok(Value::vector(values.collect()))
    }
}

impl<'a> Evaluator<'a> {
    /// `sum` and `product`: all elements joined by an operator; `empty` where there are none.
    pub(super) fn fold(&mut self, call: &'a Call, operator: Binary, empty: i64) -> Result<Value> {
        let elements = self.reduced(call)?;
        self.charge(elements.len() as u64)?;
        let Some((&first, rest)) = elements.split_first() else {
            return Ok(Scalar::Integer(empty).into());
        };
        let join = |sum, &next| self.scalar_binary(operator, sum, next);
        rest.iter().try_fold(first, join).map(Value::from)
    }

    /// `array(a, b)` or `array(e for i in r)`
    pub(super) fn array_of(&mut self, call: &'a Call) -> Result<Value> {
        match call.iterators.is_empty() {
            true => self.array(&call.arguments),
            false => self.iterated(call),
        }
    }

    pub(super) fn ndims(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        Ok(Scalar::of_size(self.dims_of(argument)?.len()).into())
    }

    /// The elements that `sum(A)` or `sum(e for i in r)` goes over.
    pub(super) fn reduced(&mut self, call: &'a Call) -> Result<Vec<Scalar>> {
        let value = match call.iterators.is_empty() {
            true => self.only_argument(call)?,
            false => self.iterated(call)?,
        };
        Ok(value.elements)
    }

    fn iterated(&mut self, call: &'a Call) -> Result<Value> {
        match call.arguments.first() {
            Some(&body) => self.comprehension(body, &call.iterators),
            None => Err(self.problem("expected an expression before `for`")),
        }
    }

    /// Sizes of an expression; of a declared name also where its value is not known.
    fn dims_of(&mut self, argument: ExprId) -> Result<Vec<usize>> {
        if matches!(self.ast.expression(argument).kind, Kind::Name) {
            let name = plain(self.text(self.span(argument)));
            let declared = || self.symbols.dims(&name).filter(|_| !self.is_closed());
            let local = self.local(&name).map(|local| local.dims.as_slice());
            let known = local.or_else(declared);
            if let Some(dims) = known.filter(|_| self.iterator(&name).is_none()) {
                return Ok(dims.to_vec());
            }
        }
        Ok(self.value(argument)?.dims)
    }

    pub(super) fn size(&mut self, call: &'a Call) -> Result<Value> {
        if call.arguments.len() == 1 {
            let [array] = self.arguments(call)?;
            let dims = self.dims_of(array)?;
            return Ok(Value::vector(
                dims.into_iter().map(Scalar::of_size).collect(),
            ));
        }
        let [array, axis] = self.arguments(call)?;
        let dims = self.dims_of(array)?;
        let number = self.known_integer(axis, "the dimension")?;
        let dim = usize::try_from(number)
            .ok()
            .and_then(|axis| dims.get(axis.checked_sub(1)?));
        let dim = dim.map(|&dim| Scalar::of_size(dim).into());
        dim.ok_or_else(|| self.no_dimension(number, &dims, axis))
    }

    pub(super) fn fill(&mut self, call: &'a Call) -> Result<Value> {
        let Some((&value, sizes @ [_, ..])) = call.arguments.split_first() else {
            return Err(self.problem("`fill` takes a value and at least one size"));
        };
        let value = self.scalar(value)?;
        self.with_all(value, sizes)
    }

    /// `zeros(2, 3)` and `ones(2, 3)`
    pub(super) fn filled(&mut self, value: i64, call: &Call) -> Result<Value> {
        self.with_all(Scalar::Integer(value), &call.arguments)
    }

    fn with_all(&mut self, value: Scalar, sizes: &[ExprId]) -> Result<Value> {
        let dims: Result<Vec<usize>> = sizes.iter().map(|&size| self.length(size)).collect();
        let dims = dims?;
        if dims.is_empty() {
            return Err(self.problem("expected at least one size"));
        }
        if dims.len() > MAX_RANK {
            return Err(too_many_dimensions(self.at));
        }
        // Sizes beside a size of zero count too: other functions walk along them.
        let walked: Vec<usize> = dims.iter().map(|&dim| dim.max(1)).collect();
        self.charge(element_count(&walked))?;
        let elements = vec![value; dims.iter().product()];
        Ok(Value { dims, elements })
    }

    /// Sizes as they are declared; `open` gives that of an axis for `:`.
    pub(super) fn sizes(
        &mut self,
        dimensions: &[ExprId],
        open: impl Fn(usize) -> Result<usize>,
    ) -> Result<Vec<usize>> {
        let sizes = dimensions.iter().enumerate();
        let size = |(axis, &id)| match self.ast.expression(id).kind {
            Kind::All => open(axis),
            _ => self.length(id),
        };
        sizes.map(size).collect()
    }

    /// A size: an Integer from 0 on.
    pub(super) fn length(&mut self, id: ExprId) -> Result<usize> {
        let value = self.known_integer(id, "a size")?;
        usize::try_from(value).map_err(|_| {
            let message = format!("a size must not be negative, this is {value}");
            Problem::new(self.span(id), message)
        })
    }

    pub(super) fn linspace(&mut self, call: &'a Call) -> Result<Value> {
        let [from, to, count] = self.arguments(call)?;
        let (from, to) = (self.scalar(from)?, self.scalar(to)?);
        let (from, to) = (self.real(from)?, self.real(to)?);
        let count = self.length(count)?;
        if count < 2 {
            return Err(self.problem("`linspace` takes at least two points"));
        }
        self.charge(count as u64)?;
        let (from, to) = (self.graph.expr(from), self.graph.expr(to));
        let point = |i: usize| {
            let fraction = i as f64 / (count - 1) as f64;
            Scalar::Real((from + fraction * (to - from)).node())
        };
        Ok(Value::vector((0..count).map(point).collect()))
    }

    pub(super) fn identity(&mut self, call: &'a Call) -> Result<Value> {
        let [argument] = self.arguments(call)?;
        let n = self.length(argument)?;
        self.charge(n as u64)?;
        self.with_diagonal(vec![Scalar::Integer(1); n])
    }

    pub(super) fn diagonal(&mut self, call: &'a Call) -> Result<Value> {
        let entries = self.only_argument(call)?.elements;
        self.with_diagonal(entries)
    }

    fn with_diagonal(&self, entries: Vec<Scalar>) -> Result<Value> {
        let n = entries.len();
        let count = element_count(&[n, n]);
        self.charge(count)?;
        let mut elements = vec![Scalar::Integer(0); count as usize];
        for (place, entry) in elements.iter_mut().step_by(n + 1).zip(entries) {
            *place = entry;
        }
        let dims = vec![n, n];
        Ok(Value { dims, elements })
    }

    pub(super) fn transpose(&mut self, call: &'a Call) -> Result<Value> {
        let Value { dims, elements } = self.only_argument(call)?;
        let [rows, columns] = dims[..] else {
            let message = format!("`transpose` takes a matrix, found {}", describe_dims(&dims));
            return Err(self.problem(message));
        };
        self.charge(elements.len() as u64)?;
        let places = (0..columns).flat_map(|j| (0..rows).map(move |i| i * columns + j));
        Ok(Value {
            dims: vec![columns, rows],
            elements: places.map(|place| elements[place]).collect(),
        })
    }

    pub(super) fn cat(&mut self, call: &'a Call) -> Result<Value> {
        let Some((&axis, parts)) = call.arguments.split_first() else {
            return Err(self.problem("`cat` takes a dimension and arrays"));
        };
        let axis = self.length(axis)?;
        let mut arrays = vec![];
        for &part in parts {
            let array = self.value(part)?;
            if axis == 0 || axis > array.dims.len() {
                return Err(self.no_dimension(axis as i64, &array.dims, part));
            }
            arrays.push(array);
        }
        self.concatenate(axis.saturating_sub(1), arrays)
    }

    fn no_dimension(&self, axis: i64, dims: &[usize], at: ExprId) -> Problem {
        let found = describe_dims(dims);
        let message = format!("there is no dimension {axis}: the size is {found}");
        Problem::new(self.span(at), message)
    }

    /// `scalar(A)`, `vector(A)`, `matrix(A)`: the same elements with other dimensions; none where
    /// the size is not one of these.
    pub(super) fn reshaped(
        &mut self,
        call: &'a Call,
        reshape: impl Fn(&[usize]) -> Option<Vec<usize>>,
    ) -> Result<Value> {
        let mut value = self.only_argument(call)?;
        let dims = reshape(&value.dims).ok_or_else(|| {
            let (name, found) = (self.function_name(call), describe_dims(&value.dims));
            self.problem(format!("`{name}` of an array of size {found}"))
        })?;
        value.dims = dims;
        Ok(value)
    }
}

/// The size of an array with a single element as that of a scalar.
pub(super) fn scalar_dims(dims: &[usize]) -> Option<Vec<usize>> {
    dims.iter().all(|&dim| dim == 1).then(Vec::new)
}

/// That of one which is long in one direction at most as that of a vector.
pub(super) fn vector_dims(dims: &[usize]) -> Option<Vec<usize>> {
    let long = dims.iter().filter(|&&dim| dim != 1).count();
    (long <= 1).then(|| vec![dims.iter().product()])
}

/// A scalar's as 1 × 1, a vector's as that of a column.
pub(super) fn matrix_dims(dims: &[usize]) -> Option<Vec<usize>> {
    let mut matrix = dims.to_vec();
    matrix.resize(2, 1);
    (dims.len() <= 2).then_some(matrix)
}

impl<'a> Evaluator<'a> {
    pub(super) fn index(&mut self, base: ExprId, subscripts: &'a [ExprId]) -> Result<Value> {
        let name = self.span(base);
        if !matches!(self.ast.expression(base).kind, Kind::Name) {
            let Value { dims, elements } = self.value(base)?;
            return self.gather("the array", &dims, &elements, subscripts);
        }
        let text = plain(self.text(name));
        if self.iterator(&text).is_some() {
            return Err(not_an_array(&text, name));
        }
        self.index_named(&text, subscripts, name)
    }

    /// Elements of the array of this name.
    pub(super) fn index_named(
        &mut self,
        text: &str,
        subscripts: &[ExprId],
        name: Span,
    ) -> Result<Value> {
        if let Some(local) = self.local(text) {
            let dims = local.dims.clone();
            let (dims, offsets) = self.selected(text, &dims, subscripts)?;
            let local = self.local(text);
            let element = |&offset: &usize| local?.elements[offset];
            let elements: Option<Vec<Scalar>> = offsets.iter().map(element).collect();
            let elements = elements.ok_or_else(|| self.unassigned(text, name))?;
            return Ok(Value { dims, elements });
        }
        match self.named(text) {
            Named::Array(dims, elements) => self.gather(text, dims, elements, subscripts),
            Named::Scalar(_) => Err(not_an_array(text, name)),
            Named::Unknown => self.index_by_full_name(text, name, subscripts),
            found => self.meant(found, name),
        }
    }

    /// Names such as `x[3]` that the caller of a single expression knows.
    fn index_by_full_name(
        &mut self,
        text: &str,
        name: Span,
        subscripts: &[ExprId],
    ) -> Result<Value> {
        let is_open = |&id: &ExprId| matches!(self.ast.expression(id).kind, Kind::All | Kind::End);
        if subscripts.iter().any(is_open) {
            return Err(self.unknown_name(name));
        }
        let full = format!("{text}[{}]", self.numbers(subscripts)?);
        self.meant(self.named(&full), name)
    }

    fn gather(
        &mut self,
        text: &str,
        dims: &[usize],
        elements: &[Scalar],
        subscripts: &[ExprId],
    ) -> Result<Value> {
        let (dims, offsets) = self.selected(text, dims, subscripts)?;
        let elements = offsets.into_iter().map(|offset| elements[offset]).collect();
        Ok(Value { dims, elements })
    }

    /// The size that subscripts select, and the offsets of its elements: all, where there are none.
    pub(super) fn selected(
        &mut self,
        text: &str,
        dims: &[usize],
        subscripts: &[ExprId],
    ) -> Result<(Vec<usize>, Vec<usize>)> {
        if dims.is_empty() && !subscripts.is_empty() {
            return Err(not_an_array(text, self.at));
        }
        if subscripts.len() > dims.len() {
            let (given, has) = (subscripts.len(), describe_dims(dims));
            let message = format!("{given} subscripts, but `{text}` has the size {has}");
            return Err(self.problem(message));
        }
        let (mut kept, mut offsets) = (vec![], vec![0usize]);
        for (axis, &dim) in dims.iter().enumerate() {
            let (size, places) = match subscripts.get(axis) {
                Some(&subscript) => {
                    self.ends.push(dim);
                    let places = self.places(text, dim, subscript);
                    self.ends.pop();
                    places?
                }
                None => self.all_places(dim, self.at)?,
            };
            kept.extend(size);
            let count = element_count(&[offsets.len(), places.len()]);
            self.charge(count)?;
            let step = |&offset: &usize| places.iter().map(move |place| offset * dim + place);
            offsets = offsets.iter().flat_map(step).collect();
        }
        Ok((kept, offsets))
    }

    /// The places that one subscript selects, from 0, and how many these are, where it is not one by
    /// itself.
    fn places(
        &mut self,
        text: &str,
        dim: usize,
        subscript: ExprId,
    ) -> Result<(Option<usize>, Vec<usize>)> {
        let span = self.span(subscript);
        if matches!(self.ast.expression(subscript).kind, Kind::All) {
            return self.all_places(dim, span);
        }
        let value = self.structural(subscript)?;
        let size = match value.dims[..] {
            [] => None,
            [size] => Some(size),
            _ => return Err(not_whole(span)),
        };
        let places = value.elements.into_iter().map(|element| match element {
            Scalar::Integer(value) => within(text, dim, value, span),
            _ => Err(not_whole(span)),
        });
        Ok((size, places.collect::<Result<_>>()?))
    }

    fn all_places(&self, dim: usize, span: Span) -> Result<(Option<usize>, Vec<usize>)> {
        self.budget.charge(dim as u64, span)?;
        Ok((Some(dim), (0..dim).collect()))
    }
}

fn within(text: &str, dim: usize, value: i64, span: Span) -> Result<usize> {
    let place = usize::try_from(value)
        .ok()
        .filter(|place| (1..=dim).contains(place));
    place.map(|place| place - 1).ok_or_else(|| {
        let message = format!("subscript {value} of `{text}` is outside 1..{dim}");
        Problem::new(span, message).label(format!("this is {value}"))
    })
}

fn not_an_array(text: &str, span: Span) -> Problem {
    let message = format!("`{text}` is a scalar and takes no subscripts");
    Problem::new(span, message)
}

fn not_whole(span: Span) -> Problem {
    let message = "a subscript must be an Integer or a range of Integers";
    Problem::new(span, message).hint(HOW_TO_BE_WHOLE)
}
