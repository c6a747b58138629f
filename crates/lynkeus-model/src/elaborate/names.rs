//! What dotted and subscripted names lead to.

use std::collections::HashMap;

use super::evaluate::Evaluator;
use super::frame::Local;
use super::scope::{Mode, Named};
use super::symbols::Component;
use super::value::{Scalar, Value};
use crate::limits::MAX_RANK;
use crate::syntax::ast::{ExprId, PathPart};
use crate::syntax::{Problem, Result, Span, plain};

/// Arrays whose elements are declared one by one, as `x[1]` and `x[2]`.
pub(super) fn gathered(
    by_name: &HashMap<&str, usize>,
    components: &[Option<Component>],
) -> HashMap<String, Component> {
    let mut groups: HashMap<&str, Vec<(Vec<usize>, &Component)>> = HashMap::new();
    for (&name, &place) in by_name {
        if let Some((base, subscripts)) = literal_subscripts(name)
            && let Some(Some(component)) = components.get(place)
            && component.dims.is_empty()
        {
            groups
                .entry(base)
                .or_default()
                .push((subscripts, component));
        }
    }
    let whole = groups
        .into_iter()
        .filter_map(|(base, elements)| Some((base.to_owned(), gather(elements)?)));
    whole
        .filter(|(base, _)| !by_name.contains_key(base.as_str()))
        .collect()
}

/// `x` and 1, 2 of `x[1,2]`.
fn literal_subscripts(name: &str) -> Option<(&str, Vec<usize>)> {
    let (base, inside) = name.strip_suffix(']')?.rsplit_once('[')?;
    let numbers = inside.split(',').map(|number| number.parse().ok());
    let numbers: Vec<usize> = numbers.collect::<Option<_>>()?;
    (numbers.len() <= MAX_RANK).then_some((base, numbers))
}

/// The array of all elements; `None` where some are missing.
fn gather(mut elements: Vec<(Vec<usize>, &Component)>) -> Option<Component> {
    elements.sort_by(|(a, _), (b, _)| a.cmp(b));
    let dims = elements.last()?.0.clone();
    let count = dims.iter().try_fold(1usize, |n, &dim| n.checked_mul(dim))?;
    let fits = |(subscripts, _): &(Vec<usize>, &Component)| {
        let within = subscripts
            .iter()
            .zip(&dims)
            .all(|(s, dim)| (1..=*dim).contains(s));
        subscripts.len() == dims.len() && within
    };
    if count != elements.len() || !elements.iter().all(fits) {
        return None;
    }
    let values = elements
        .iter()
        .map(|(_, c)| c.values.as_ref()?.first().copied());
    Some(Component {
        values: values.collect(),
        is_known: elements.iter().all(|(_, component)| component.is_known),
        elements: elements
            .iter()
            .filter_map(|(_, c)| c.elements.first().copied())
            .collect(),
        dims,
    })
}

impl<'a> Evaluator<'a> {
    pub(super) fn name(&mut self, span: Span) -> Result<Value> {
        let name = plain(self.text(span));
        if let Some(scalar) = self.iterator(&name) {
            return Ok(Value::Scalar(scalar));
        }
        match self.local(&name) {
            Some(Ok(local)) => {
                self.budget.charge(local.elements.len() as u64, span)?;
                return local.value().ok_or_else(|| self.unassigned(&name, span));
            }
            Some(Err(())) => return self.outside_of_function(&name, span),
            None => {}
        }
        match self.named(&name) {
            Named::Array([], [scalar]) => Ok(Value::Scalar(*scalar)),
            Named::Array(dims, elements) => {
                self.budget.charge(elements.len() as u64, span)?;
                Ok(Value::new(dims.to_vec(), elements.to_vec()))
            }
            Named::Scalar(scalar) => Ok(Value::Scalar(scalar)),
            Named::Unknown => match self.builtin(&name) {
                Some(scalar) => Ok(Value::Scalar(scalar)),
                None => Err(self.unknown_name(span)),
            },
            Named::Varying => Err(self.varying(span)),
            Named::Valueless => Err(self.without_value(span)),
        }
    }

    pub(super) fn iterator(&self, name: &str) -> Option<Scalar> {
        let mut loops = self.loops.iter().rev();
        loops
            .find(|(iterator, _)| plain(iterator) == name)
            .map(|(_, value)| *value)
    }

    /// The scope's meaning of a name, in full or as an import shortens it.
    pub(super) fn named(&self, name: &str) -> Named<'a> {
        // The scope outlives this evaluator.
        let scope = self.scope;
        if !self.is_closed() {
            match scope.named(name, self.mode) {
                Named::Unknown => {}
                found => return found,
            }
        }
        let full = self.full_names(name).into_iter();
        let mut found = full.map(|full| scope.constant(&full, self.mode));
        found
            .find(|found| !matches!(found, Named::Unknown))
            .unwrap_or(Named::Unknown)
    }

    /// In a function the model's own names mean nothing.
    pub(super) fn is_closed(&self) -> bool {
        self.frame.as_ref().is_some_and(|frame| frame.is_function)
    }

    pub(super) fn full_names(&self, name: &str) -> Vec<String> {
        match self.classes {
            Some(classes) if !self.scopes.is_empty() => classes.full_names(name, &self.scopes),
            _ => vec![],
        }
    }

    /// Names in a function lead to its own variables, and to constants.
    fn outside_of_function(&mut self, name: &str, span: Span) -> Result<Value> {
        let mode = std::mem::replace(&mut self.mode, Mode::Structural);
        let found = self.named(name);
        self.mode = mode;
        match found {
            Named::Array(dims, elements) => Ok(Value::new(dims.to_vec(), elements.to_vec())),
            Named::Scalar(scalar) => Ok(Value::Scalar(scalar)),
            _ => match self.builtin(name) {
                Some(scalar) => Ok(Value::Scalar(scalar)),
                None if self.scope.dims(name).is_some() => {
                    let message = format!("`{name}` is not a variable of this function");
                    Err(Problem::new(span, message)
                        .hint("functions read their own variables and constants: add an input"))
                }
                None => Err(self.unknown_name(span)),
            },
        }
    }

    fn builtin(&self, name: &str) -> Option<Scalar> {
        if name == "time" {
            return self.scope.time(self.mode).map(Scalar::Real);
        }
        if let Some(classes) = self.classes
            && let Some(ordinal) = classes.literal(name, &self.scopes)
        {
            return Some(Scalar::Integer(ordinal));
        }
        let known = crate::flat::constant(name);
        let known = known.or_else(|| {
            self.full_names(name)
                .iter()
                .find_map(|full| crate::flat::constant(full))
        });
        Some(Scalar::Real(self.graph.constant(known?).node()))
    }

    pub(super) fn unassigned(&self, name: &str, span: Span) -> Problem {
        Problem::new(
            span,
            format!("`{name}` is read before it has a value in every case"),
        )
        .hint("assign it first, in each branch of an `if`")
    }

    /// `a[1].b[2].c`: a name as it is written, or the member `a.b.c` with all subscripts.
    pub(super) fn path(&mut self, parts: &'a [PathPart], span: Span) -> Result<Value> {
        let whole = plain(self.text(span));
        if self.is_known(&whole) {
            return self.name(span);
        }
        let (subscripts, named) = joined(parts, self.source);
        let literal = self.with_numbers(parts);
        if let Some(literal) = literal.filter(|literal| self.is_known(literal)) {
            return self.value_named(&literal, span);
        }
        self.index_named(&named, &subscripts, span)
    }

    fn is_known(&self, name: &str) -> bool {
        matches!(self.local(name), Some(Ok(_))) || !matches!(self.named(name), Named::Unknown)
    }

    /// `c[2].x` for `c[i].x` with i = 2; `None` where a subscript is a range.
    fn with_numbers(&mut self, parts: &'a [PathPart]) -> Option<String> {
        let mut name = String::new();
        for part in parts {
            if !name.is_empty() {
                name.push('.');
            }
            name.push_str(&plain(self.text(part.name)));
            let mut numbers = vec![];
            for &subscript in &part.subscripts {
                numbers.push(
                    self.known_integer(subscript, "a subscript")
                        .ok()?
                        .to_string(),
                );
            }
            if !numbers.is_empty() {
                name.push_str(&format!("[{}]", numbers.join(",")));
            }
        }
        Some(name)
    }

    pub(super) fn value_named(&mut self, name: &str, span: Span) -> Result<Value> {
        if let Some(Ok(local)) = self.local(name) {
            return local.value().ok_or_else(|| self.unassigned(name, span));
        }
        match self.named(name) {
            Named::Array(dims, elements) => Ok(Value::new(dims.to_vec(), elements.to_vec())),
            Named::Scalar(scalar) => Ok(Value::Scalar(scalar)),
            Named::Varying => Err(self.varying(span)),
            Named::Valueless => Err(self.without_value(span)),
            Named::Unknown => Err(self.unknown_name(span)),
        }
    }

    /// A variable of the function or algorithm around; `Err` where a function has none of that
    /// name.
    pub(super) fn local(&self, name: &str) -> Option<std::result::Result<&Local, ()>> {
        let frame = self.frame.as_ref()?;
        match frame.locals.get(name) {
            Some(local) => Some(Ok(local)),
            None if frame.is_function => Some(Err(())),
            None => None,
        }
    }
}

/// The subscripts of all parts, and their names joined.
pub(super) fn joined(parts: &[PathPart], source: &str) -> (Vec<ExprId>, String) {
    let subscripts = parts
        .iter()
        .flat_map(|part| part.subscripts.iter().copied());
    let names = parts.iter().map(|part| plain(part.name.text(source)));
    (subscripts.collect(), names.collect::<Vec<_>>().join("."))
}
