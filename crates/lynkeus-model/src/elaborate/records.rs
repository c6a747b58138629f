//! Records while a model is written out: values by the names of their members.

use super::evaluate::Evaluator;
use super::frame::Local;
use super::inline::Outcome;
use super::names::joined;
use super::value::Value;
use crate::flat::constant_label;
use crate::syntax::ast::{Call, Class, ClassKind, Declaration, ExprId, Kind, TypeName};
use crate::syntax::{Problem, Result, Span, plain};

/// The members of a record, those of inner records by their names in full, as `z.re`.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Record {
    pub members: Vec<(String, Value)>,
}

impl Record {
    pub(super) fn member(&self, name: &str) -> Option<&Value> {
        let mut members = self.members.iter();
        members
            .find(|(member, _)| member == name)
            .map(|(_, value)| value)
    }

    /// The members behind `prefix.`, where there are any.
    fn inner(&self, prefix: &str) -> Option<Record> {
        let inner = |(name, value): &(String, Value)| {
            let rest = name.strip_prefix(prefix)?.strip_prefix('.')?;
            Some((rest.to_owned(), value.clone()))
        };
        let members: Vec<(String, Value)> = self.members.iter().filter_map(inner).collect();
        (!members.is_empty()).then_some(Record { members })
    }
}

impl<'a> Evaluator<'a> {
    /// The record that an expression is; `None` where it is a number or an array.
    pub(super) fn record(&mut self, id: ExprId) -> Result<Option<Record>> {
        self.deeper(self.span(id), |evaluator| evaluator.record_here(id))
    }

    fn record_here(&mut self, id: ExprId) -> Result<Option<Record>> {
        let expression = self.ast.expression(id);
        let span = expression.span;
        match &expression.kind {
            Kind::Name => {
                let name = plain(self.text(span));
                self.record_named(&name, &[], span)
            }
            Kind::Index(base, subscripts) => {
                if !matches!(self.ast.expression(*base).kind, Kind::Name) {
                    return Ok(None);
                }
                let whole = plain(self.text(span));
                if let Some(record) = self.record_named(&whole, &[], span)? {
                    return Ok(Some(record));
                }
                let name = plain(self.text(self.span(*base)));
                self.record_named(&name, subscripts, span)
            }
            Kind::Path(parts) => {
                let whole = plain(self.text(span));
                if let Some(record) = self.record_named(&whole, &[], span)? {
                    return Ok(Some(record));
                }
                let (subscripts, name) = joined(parts, self.source);
                self.record_named(&name, &subscripts, span)
            }
            Kind::Member(record, name) => Ok(self.record(*record)?.and_then(|r| r.inner(name))),
            Kind::Call(call) => self.record_of_call(call, span),
            Kind::Array(elements) => self.array_of_records(elements, span),
            _ => Ok(None),
        }
    }

    /// The member of a record, as `Kind::Member` has it.
    pub(super) fn member(&mut self, record: ExprId, name: &str, span: Span) -> Result<Value> {
        let found = self.record(record)?;
        let value = found.as_ref().and_then(|record| record.member(name));
        value.cloned().ok_or_else(|| {
            Problem::new(span, format!("expected a record with the member `{name}`"))
        })
    }

    fn members_of(&self, name: &str) -> Option<Vec<String>> {
        let of_frame = self
            .frame
            .as_ref()
            .and_then(|frame| frame.records.get(name));
        let of_model = || self.scope.members(name).filter(|_| !self.is_closed());
        let of_package = || {
            let full = self.full_names(name).into_iter();
            let mut labels = full.map(|full| constant_label(&full));
            labels.find_map(|label| self.scope.members(&label))
        };
        let members = of_frame.map(Vec::as_slice).or_else(of_model);
        members.or_else(of_package).map(<[String]>::to_vec)
    }

    fn record_named(
        &mut self,
        name: &str,
        subscripts: &[ExprId],
        span: Span,
    ) -> Result<Option<Record>> {
        let Some(names) = self.members_of(name) else {
            return Ok(None);
        };
        let mut members = vec![];
        for member in names {
            let full = format!("{name}.{member}");
            self.budget.charge(1, span)?;
            if let Some(inner) = self.record_named(&full, subscripts, span)? {
                let inner = inner.members.into_iter();
                members.extend(inner.map(|(rest, value)| (format!("{member}.{rest}"), value)));
                continue;
            }
            let value = match subscripts {
                [] => self.value_named(&full, span)?,
                _ => self.index_named(&full, subscripts, span)?,
            };
            members.push((member, value));
        }
        Ok(Some(Record { members }))
    }

    fn array_of_records(&mut self, elements: &'a [ExprId], span: Span) -> Result<Option<Record>> {
        let Some((&first, rest)) = elements.split_first() else {
            return Ok(None);
        };
        let Some(first) = self.record(first)? else {
            return Ok(None);
        };
        let mut columns: Vec<(String, Vec<Value>)> = first
            .members
            .into_iter()
            .map(|(name, value)| (name, vec![value]))
            .collect();
        for &id in rest {
            let record = self.record(id)?;
            for (name, column) in &mut columns {
                let value = record.as_ref().and_then(|record| record.member(name));
                let value = value.cloned().ok_or_else(|| {
                    Problem::new(self.span(id), format!("expected a record with `{name}`"))
                })?;
                column.push(value);
            }
        }
        let stacked = columns
            .into_iter()
            .map(|(name, values)| Ok((name, self.stack(values, span)?)));
        Ok(Some(Record {
            members: stacked.collect::<Result<_>>()?,
        }))
    }

    /// `R(1, 2)`, or a function whose first output is a record.
    fn record_of_call(&mut self, call: &'a Call, span: Span) -> Result<Option<Record>> {
        let Some((place, class)) = self.class_called(call) else {
            return Ok(None);
        };
        if class.kind == ClassKind::Function {
            if !self.gives_record(place) {
                return Ok(None);
            }
            let mut outcomes = self.inlined(place, call, span)?.into_iter();
            return Ok(match outcomes.next() {
                Some(Outcome::Record(record)) => Some(record),
                _ => None,
            });
        }
        if class.kind != ClassKind::Record {
            return Ok(None);
        }
        self.constructed(place, class, call, span).map(Some)
    }

    fn constructed(
        &mut self,
        place: usize,
        class: &'a Class,
        call: &'a Call,
        span: Span,
    ) -> Result<Record> {
        let declarations = self.declarations_of(place)?;
        let given = self.arguments_of(class, &declarations, call, span)?;
        let mut found = vec![];
        for (declaration, id) in declarations.iter().zip(&given) {
            let value = id.map(|id| self.member_value(declaration, id));
            found.push(value.transpose()?);
        }
        // what is not given may be made from what is
        let members = self.inside(class, |evaluator| {
            found
                .iter()
                .flatten()
                .for_each(|value| evaluator.know(value));
            let mut members = vec![];
            for (declaration, value) in declarations.iter().zip(found) {
                members.extend(match value {
                    Some(value) => value,
                    None => evaluator.default(declaration, span)?,
                });
            }
            Ok(members)
        })?;
        Ok(Record { members })
    }

    /// What a member is where nothing is given to it.
    fn default(
        &mut self,
        declaration: &'a Declaration,
        span: Span,
    ) -> Result<Vec<(String, Value)>> {
        let Some(id) = declaration.binding else {
            let label = &declaration.label;
            let message = format!("the member `{label}` of the record is not given");
            return Err(Problem::new(span, message));
        };
        let value = self.member_value(declaration, id)?;
        self.know(&value);
        Ok(value)
    }

    /// A member of a record with its value, or those of the record that it is.
    fn member_value(
        &mut self,
        declaration: &Declaration,
        id: ExprId,
    ) -> Result<Vec<(String, Value)>> {
        let label = &declaration.label;
        if let TypeName::Named(_) = declaration.prefix.type_name
            && let Some(inner) = self.record(id)?
        {
            let inner = inner.members.into_iter();
            return Ok(inner
                .map(|(rest, value)| (format!("{label}.{rest}"), value))
                .collect());
        }
        Ok(vec![(label.clone(), self.value(id)?)])
    }

    /// Makes values known by their names to what is evaluated next.
    fn know(&mut self, members: &[(String, Value)]) {
        let Some(frame) = &mut self.frame else {
            return;
        };
        for (name, value) in members {
            frame.locals.insert(name.clone(), Local::of(value));
        }
    }
}
