//! The variables that a function declares.

use super::evaluate::Evaluator;
use super::frame::Local;
use super::inline::Outcome;
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
            return self.introduce_record(record, &name, given);
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
            (None, None) if declaration.prefix.causality == Causality::Input => {
                let message = format!("input `{name}` of function `{}` is not given", class.path);
                return Err(Problem::new(span, message));
            }
            (None, None) => None,
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

    fn introduce_record(
        &mut self,
        record: usize,
        name: &str,
        given: Option<Outcome>,
    ) -> Result<()> {
        let mut names = vec![];
        match given {
            Some(Outcome::Record(given)) => {
                for (member, value) in given.members {
                    let full = format!("{name}.{member}");
                    names.push((member, full, Local::of(&value)));
                }
            }
            _ => {
                for declaration in self.declarations_of(record)? {
                    let full = format!("{name}.{}", declaration.label);
                    let dims = self.dims_declared(declaration, None, declaration.name)?;
                    let local = Local::without_value(dims, declaration.prefix.is_integer());
                    names.push((declaration.label.clone(), full, local));
                }
            }
        }
        if let Some(frame) = self.frame.as_mut() {
            let members = names.iter().map(|(member, ..)| member.clone()).collect();
            frame.records.insert(name.to_owned(), members);
            frame
                .locals
                .extend(names.into_iter().map(|(_, full, local)| (full, local)));
        }
        Ok(())
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
