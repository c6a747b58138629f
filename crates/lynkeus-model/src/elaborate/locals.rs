//! The variables that a function declares.

use super::evaluate::Evaluator;
use super::frame::Local;
use super::inline::Outcome;
use super::records::Record;
use super::value::{Value, describe_dims};
use crate::syntax::ast::{Causality, Class, ClassKind, Declaration, Kind, TypeName};
use crate::syntax::{Problem, Result, Span, plain};

impl<'a> Evaluator<'a> {
    /// The record that a variable is declared as.
    pub(super) fn record_type(&self, declaration: &Declaration, path: &str) -> Option<usize> {
        let TypeName::Named(name) = declaration.prefix.type_name else {
            return None;
        };
        let place = self.classes?.class(&plain(self.text(name)), &[path])?;
        (self.ast.classes.get(place)?.kind == ClassKind::Record).then_some(place)
    }

    /// A variable of a function with its argument, or with the value it is declared with.
    pub(super) fn introduce(
        &mut self,
        class: &'a Class,
        declaration: &'a Declaration,
        given: Option<Outcome>,
        span: Span,
    ) -> Result<()> {
        let name = declaration.label.clone();
        if let Some(record) = self.record_type(declaration, &class.path) {
            return match self.record_given(class, declaration, given, span)? {
                Some(value) => {
                    self.know_record(&name, value);
                    Ok(())
                }
                None => self.open_record(record, &name),
            };
        }
        if let TypeName::Named(type_name) = declaration.prefix.type_name {
            self.check_number(class, type_name)?;
        }
        let value = match (given, declaration.binding) {
            (Some(Outcome::Value(value)), _) => Some(value),
            (Some(Outcome::Record(_)), _) => {
                let message = format!("`{name}` takes a number, found a record");
                return Err(Problem::new(span, message));
            }
            (None, Some(id)) => Some(self.value(id)?),
            (None, None) => {
                check_given(class, declaration, span)?;
                None
            }
        };
        let dims = self.dims_declared(declaration, value.as_ref(), span)?;
        let mut local = Local::without_value(dims, declaration.prefix.is_integer());
        if let Some(value) = value {
            if value.dims() != local.dims {
                let (has, found) = (describe_dims(&local.dims), describe_dims(value.dims()));
                let message = format!("`{name}` has the size {has}, its value has {found}");
                return Err(Problem::new(span, message));
            }
            let elements = value.into_array().elements.into_iter();
            let graph = self.graph;
            local.elements = elements
                .map(|scalar| Some(local.converted(scalar, graph)))
                .collect();
        }
        self.budget.charge(local.elements.len() as u64, span)?;
        if let Some(frame) = self.frame.as_mut() {
            frame.locals.insert(name, local);
        }
        Ok(())
    }

    /// Refuses variables of functions that are no numbers.
    fn check_number(&self, class: &Class, type_name: Span) -> Result<()> {
        let name = plain(self.text(type_name));
        let place = self
            .classes
            .and_then(|classes| classes.class(&name, &[&class.path]));
        let kind = place.and_then(|place| Some(self.ast.classes.get(place)?.kind));
        match kind {
            None | Some(ClassKind::Type) => Ok(()),
            Some(_) => {
                let message = format!("`{name}` is not a type of numbers");
                Err(Problem::new(type_name, message).hint("write the formula where it is used"))
            }
        }
    }

    /// The value of a variable that is a record: its argument, or what it is declared with; none
    /// of one that its function assigns.
    fn record_given(
        &mut self,
        class: &'a Class,
        declaration: &'a Declaration,
        given: Option<Outcome>,
        span: Span,
    ) -> Result<Option<Record>> {
        let number = |span: Span| {
            let name = &declaration.label;
            Problem::new(span, format!("`{name}` takes a record, found a number"))
        };
        match (given, declaration.binding) {
            (Some(Outcome::Record(record)), _) => Ok(Some(record)),
            (Some(Outcome::Value(_)), _) => Err(number(span)),
            (None, Some(id)) => {
                let record = self.record(id)?;
                record.map(Some).ok_or_else(|| number(self.span(id)))
            }
            (None, None) => {
                check_given(class, declaration, span)?;
                Ok(None)
            }
        }
    }

    fn know_record(&mut self, name: &str, value: Record) {
        let members = value.members.into_iter();
        let known = members.map(|(member, value)| (member, Local::of(&value)));
        self.insert_record(name, known.collect());
    }

    /// A record of which no member has a value yet.
    fn open_record(&mut self, record: usize, name: &str) -> Result<()> {
        let mut members = vec![];
        for declaration in self.declarations_of(record)? {
            let dims = self.dims_declared(declaration, None, declaration.name)?;
            let local = Local::without_value(dims, declaration.prefix.is_integer());
            members.push((declaration.label.clone(), local));
        }
        self.insert_record(name, members);
        Ok(())
    }

    fn insert_record(&mut self, name: &str, members: Vec<(String, Local)>) {
        if let Some(frame) = self.frame.as_mut() {
            let names = members.iter().map(|(member, _)| member.clone()).collect();
            frame.records.insert(name.to_owned(), names);
            let full = |(member, local)| (format!("{name}.{member}"), local);
            frame.locals.extend(members.into_iter().map(full));
        }
    }

    /// The size of a variable of a function; `:` is taken from its value.
    fn dims_declared(
        &mut self,
        declaration: &'a Declaration,
        value: Option<&Value>,
        span: Span,
    ) -> Result<Vec<usize>> {
        let mut dims = vec![];
        for (axis, &id) in declaration.dimensions.iter().enumerate() {
            let open = matches!(self.ast.expression(id).kind, Kind::All);
            dims.push(
                match (open, value.and_then(|value| value.dims().get(axis))) {
                    (true, Some(&dim)) => dim,
                    (true, None) => {
                        let name = &declaration.label;
                        let message =
                            format!("the size `:` of `{name}` needs a value to be taken from");
                        return Err(Problem::new(declaration.name, message));
                    }
                    (false, _) => self.length(id)?,
                },
            );
        }
        let count = super::value::element_count(&dims).unwrap_or(u64::MAX);
        self.budget.charge(count, span)?;
        Ok(dims)
    }
}

/// Refuses an input that has no value; other variables are given theirs by statements.
fn check_given(class: &Class, declaration: &Declaration, span: Span) -> Result<()> {
    if declaration.prefix.causality != Causality::Input {
        return Ok(());
    }
    let (name, function) = (&declaration.label, &class.path);
    let message = format!("input `{name}` of function `{function}` is not given");
    Err(Problem::new(span, message))
}
