//! `x[i]`, `x[2:end]`, `A[:, 1]`.

use super::evaluate::Evaluator;
use super::scope::Named;
use super::value::{Array, Scalar, Value, describe_dims, element_count};
use crate::syntax::ast::{ExprId, Kind};
use crate::syntax::{Problem, Result, Span, plain};

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
            Named::Varying => Err(self.varying(name)),
            Named::Valueless => Err(self.without_value(name)),
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
        match self.named(&full) {
            Named::Scalar(scalar) => Ok(Value::Scalar(scalar)),
            Named::Array(dims, elements) => Ok(Value::new(dims.to_vec(), elements.to_vec())),
            Named::Varying => Err(self.varying(name)),
            Named::Valueless => Err(self.without_value(name)),
            Named::Unknown => Err(self.unknown_name(name)),
        }
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

fn not_an_array(text: &str, span: Span) -> Problem {
    Problem::new(
        span,
        format!("`{text}` is a scalar and takes no subscripts"),
    )
}

fn not_whole(span: Span) -> Problem {
    Problem::new(
        span,
        "a subscript must be an Integer or a range of Integers",
    )
    .hint("`/` and `^` always give a Real: use `div(a, b)` or `integer(a)`")
}
