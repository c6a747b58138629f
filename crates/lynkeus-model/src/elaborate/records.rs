//! Records while a model is written out: values by the names of their members.

use super::evaluate::Evaluator;
use super::inline::Outcome;
use super::names::joined;
use super::value::Value;
use crate::syntax::ast::{Call, ClassKind, ExprId, Kind, TypeName};
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
        of_frame
            .cloned()
            .or_else(|| self.scope.members(name).map(<[String]>::to_vec))
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
        let declarations = self.declarations_of(place)?;
        let mut given = call.arguments.iter().copied();
        let mut members = vec![];
        for declaration in declarations {
            let label = &declaration.label;
            let by_name = |(name, _): &&(Span, ExprId)| plain(self.text(*name)) == *label;
            let named = call.named.iter().find(by_name).map(|(_, id)| *id);
            let Some(id) = given.next().or(named).or(declaration.binding) else {
                let message = format!("the member `{label}` of the record is not given");
                return Err(Problem::new(span, message));
            };
            if let TypeName::Named(_) = declaration.prefix.type_name
                && let Some(inner) = self.record(id)?
            {
                let inner = inner.members.into_iter();
                members.extend(inner.map(|(rest, value)| (format!("{label}.{rest}"), value)));
                continue;
            }
            members.push((label.clone(), self.value(id)?));
        }
        if given.next().is_some() {
            let message = "the record has fewer members than are given here";
            return Err(Problem::new(span, message));
        }
        Ok(Some(Record { members }))
    }
}
