//! Functions and records of the text, written out where they are called.

use super::evaluate::{Evaluator, reference};
use super::scope::{Frame, Local};
use super::value::{Members, Value, check_size, element_count, member, member_name, number};
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::constant_label;
use crate::syntax::ast::{Call, Causality, Class, ClassKind, Declaration, ExprId, Kind, TypeName};
use crate::syntax::{plain, shortened};

/// Most functions that may stand in each other.
const MAX_CALLS: usize = 40;

impl<'a> Evaluator<'a> {
    /// The class of the text that a name means.
    fn class(&self, name: Span, scopes: &[&str]) -> Option<&'a Class> {
        let name = plain(self.text(name));
        self.symbols.classes.class(&name, scopes)
    }

    fn class_called(&self, call: &Call) -> Option<&'a Class> {
        self.class(call.function, &self.scopes)
    }

    /// The value of a call of a function of the text; `None` where there is no such function.
    pub(super) fn own_function(&mut self, call: &'a Call) -> Result<Option<Value>> {
        let class = self.class_called(call);
        let Some(class) = class.filter(|class| class.kind == ClassKind::Function) else {
            return Ok(None);
        };
        let mut outcomes = self.inlined(class, call)?.into_iter();
        let first = outcomes.next().ok_or_else(|| {
            let message = format!("function `{}` has no output", class.path);
            self.problem(message).hint("declare one: `output Real y;`")
        })?;
        let no_number = |_| self.problem("expected a number, found a record");
        number(first).map(Some).map_err(no_number)
    }

    /// The values of `(a, b) = f(x)`.
    pub(super) fn outcomes(&mut self, id: ExprId, wanted: usize) -> Result<Vec<Members>> {
        let span = self.span(id);
        let Kind::Call(call) = &self.ast.expression(id).kind else {
            return Err(Problem::new(span, "expected a call of a function"));
        };
        let Some(class) = self.class_called(call) else {
            let name = shortened(self.text(call.function));
            let message = format!("the text has no function `{name}` with several outputs");
            return Err(Problem::new(call.function, message));
        };
        let outcomes = self.standing(span, |evaluator| evaluator.inlined(class, call))?;
        if outcomes.len() < wanted {
            let (name, has) = (&class.path, outcomes.len());
            let message = format!("function `{name}` has {has} outputs, {wanted} are taken here");
            return Err(Problem::new(span, message));
        }
        Ok(outcomes)
    }

    /// Declarations of a class and of its bases, those of the bases first.
    fn declarations_of(&self, class: &'a Class) -> Result<Vec<&'a Declaration>> {
        let classes = self.with_bases(class)?.into_iter();
        Ok(classes.flat_map(|class| &class.declarations).collect())
    }

    /// A class behind its bases.
    fn with_bases(&self, class: &'a Class) -> Result<Vec<&'a Class>> {
        let (mut found, mut open) = (vec![], vec![class]);
        while let Some(class) = open.pop() {
            found.push(class);
            if found.len() > MAX_CALLS {
                let message = format!("`{}` is made from itself", class.path);
                return Err(Problem::new(class.name, message).hint("remove the `extends`"));
            }
            for base in &class.bases {
                let known = self.class(base.name, &[&class.path]);
                open.push(known.ok_or_else(|| {
                    let name = plain(self.text(base.name));
                    Problem::new(base.name, format!("`extends {name}` of another file"))
                })?);
            }
        }
        found.reverse();
        Ok(found)
    }

    /// True where the first output of a function is a record.
    fn gives_record(&self, class: &'a Class) -> bool {
        let declarations = self.declarations_of(class).unwrap_or_default();
        let first = with_causality(&declarations, Causality::Output).next();
        first.is_some_and(|first| self.record_type(first, class).is_some())
    }

    /// Carries out a function for the arguments of a call; gives its outputs in order.
    fn inlined(&mut self, class: &'a Class, call: &'a Call) -> Result<Vec<Members>> {
        self.check_callable(class)?;
        let parts = self.with_bases(class)?;
        let declarations = self.declarations_of(class)?;
        let mut given = self.given(&declarations, class, call)?.into_iter();
        self.calls.push(&class.path);
        let done = self.inside(class, |evaluator| {
            for declaration in &declarations {
                let value = match declaration.causality {
                    Causality::Input => given.next().flatten(),
                    _ => None,
                };
                evaluator.introduce(class, declaration, value)?;
            }
            for algorithm in parts.iter().flat_map(|part| &part.algorithms) {
                evaluator.execute(algorithm)?;
            }
            let outputs = with_causality(&declarations, Causality::Output);
            let outcomes = outputs.map(|output| evaluator.outcome(class, output));
            outcomes.collect()
        });
        self.calls.pop();
        done
    }

    /// What stands in a class that knows nothing of what is around it but constants.
    fn inside<T>(
        &mut self,
        class: &'a Class,
        run: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let scopes = std::mem::replace(&mut self.scopes, vec![&class.path]);
        let loops = std::mem::take(&mut self.loops);
        let outside = std::mem::replace(&mut self.frame, Frame::closed());
        let done = run(self);
        self.frame = outside;
        self.loops = loops;
        self.scopes = scopes;
        done
    }

    fn check_callable(&self, class: &Class) -> Result<()> {
        let name = class.path.as_str();
        if self.calls.contains(&name) {
            let message = format!("function `{name}` calls itself");
            return Err(self
                .problem(message)
                .hint("a recursion has no end when it is written out: use a `for` loop"));
        }
        if self.calls.len() >= MAX_CALLS {
            let message =
                format!("functions stand in each other more than {MAX_CALLS} levels deep");
            return Err(self.problem(message));
        }
        if class.is_external || class.is_partial || class.alias.is_some() {
            let message = format!("function `{name}` has no algorithm in this text");
            return Err(self
                .problem(message)
                .hint("write it in Modelica, or the formula where it is used"));
        }
        Ok(())
    }

    /// What the call gives to each input; its arguments are expressions of the caller.
    fn given(
        &mut self,
        declarations: &[&'a Declaration],
        class: &'a Class,
        call: &'a Call,
    ) -> Result<Vec<Option<Members>>> {
        let inputs: Vec<_> = with_causality(declarations, Causality::Input).collect();
        let mut found = vec![];
        let arguments = self.arguments_of(class, &inputs, call)?;
        for (input, id) in inputs.into_iter().zip(arguments) {
            found.push(match (id, self.record_type(input, class)) {
                (Some(id), Some(_)) => Some(self.members(id)?),
                (Some(id), None) => Some(number_of(self.value(id)?)),
                (None, _) => None,
            });
        }
        Ok(found)
    }

    /// The expressions that a call gives to each input of a function or member of a record, in
    /// order or by name.
    fn arguments_of(
        &self,
        class: &Class,
        declarations: &[&Declaration],
        call: &Call,
    ) -> Result<Vec<Option<ExprId>>> {
        let (kind, part) = match class.kind {
            ClassKind::Function => ("function", "input"),
            _ => ("record", "member"),
        };
        let (name, takes, given) = (&class.path, declarations.len(), call.arguments.len());
        if given > takes {
            let message = format!("{kind} `{name}` takes {takes} arguments, found {given}");
            return Err(self.problem(message));
        }
        let positional = call.arguments.iter().map(|&id| Some(id));
        let mut found: Vec<Option<ExprId>> = positional.collect();
        found.resize(takes, None);
        for &(label, id) in &call.named {
            let text = plain(self.text(label));
            let place = declarations.iter().position(|d| d.label == text);
            let Some(slot) = place.and_then(|place| found.get_mut(place)) else {
                let message = format!("{kind} `{name}` has no {part} of this name");
                return Err(Problem::new(label, message));
            };
            if slot.replace(id).is_some() {
                let message = format!("{part} `{text}` of {kind} `{name}` is given twice");
                return Err(Problem::new(label, message));
            }
        }
        Ok(found)
    }

    fn outcome(&self, class: &Class, output: &Declaration) -> Result<Members> {
        let label = &output.label;
        let frame = &self.frame;
        let of_number = [String::new()];
        let names = frame.records.get(label);
        let names = names.map_or(&of_number[..], Vec::as_slice);
        let member = |name: &String| {
            let full = member_name(label, name);
            let local = frame.locals.get(&full);
            let value = local.and_then(Local::value).ok_or_else(|| {
                let function = &class.path;
                let message =
                    format!("output `{full}` of function `{function}` is not given a value");
                Problem::new(output.name, message)
                    .hint("assign it in the algorithm, in every case of an `if`")
            });
            Ok((name.clone(), value?))
        };
        names.iter().map(member).collect()
    }
}

impl<'a> Evaluator<'a> {
    /// The class that a variable of another class is declared as.
    fn type_of(&self, declaration: &Declaration, of: &Class) -> Option<&'a Class> {
        match declaration.type_name {
            TypeName::Named(name) => self.class(name, &[&of.path]),
            _ => None,
        }
    }

    /// The record that it is declared as.
    fn record_type(&self, declaration: &Declaration, of: &Class) -> Option<&'a Class> {
        let class = self.type_of(declaration, of);
        class.filter(|class| class.kind == ClassKind::Record)
    }

    /// A variable of a function with its argument, or with the value it is declared with; without a
    /// value where its function assigns it.
    fn introduce(
        &mut self,
        class: &'a Class,
        declaration: &'a Declaration,
        given: Option<Members>,
    ) -> Result<()> {
        let name = &declaration.label;
        let type_name = declaration.type_name;
        match (self.type_of(declaration, class), type_name) {
            (Some(record), _) if record.kind == ClassKind::Record => {
                return self.introduce_record(class, declaration, record, given);
            }
            (Some(other), TypeName::Named(at)) if other.kind != ClassKind::Type => {
                let message = format!("`{}` is not a type of numbers", plain(self.text(at)));
                return Err(Problem::new(at, message).hint("write the formula where it is used"));
            }
            _ => {}
        }
        let value = match (given.map(number), declaration.binding) {
            (Some(Ok(value)), _) => Some(value),
            (Some(Err(_)), _) => {
                let message = format!("`{name}` takes a number, found a record");
                return Err(self.problem(message));
            }
            (None, Some(id)) => Some(self.value(id)?),
            (None, None) => {
                self.check_given(class, declaration)?;
                None
            }
        };
        let dims = self.dims_declared(declaration, value.as_ref())?;
        let mut local = Local::without_value(dims, declaration.is_integer());
        if let Some(value) = value {
            check_size(name, &local.dims, &value.dims, self.at)?;
            let elements = value.elements.into_iter();
            local.elements = elements
                .map(|scalar| Some(local.converted(scalar, self.graph)))
                .collect();
        }
        self.charge(local.elements.len() as u64)?;
        self.frame.locals.insert(name.clone(), local);
        Ok(())
    }

    fn introduce_record(
        &mut self,
        class: &'a Class,
        declaration: &'a Declaration,
        record: &'a Class,
        given: Option<Members>,
    ) -> Result<()> {
        let name = &declaration.label;
        let no_record = |span| {
            let message = format!("`{name}` takes a record, found a number");
            Problem::new(span, message)
        };
        let value = match (given, declaration.binding) {
            (Some(given), _) => Some(number(given).err().ok_or_else(|| no_record(self.at))?),
            (None, Some(id)) => {
                let record = self.record(id)?;
                Some(record.ok_or_else(|| no_record(self.span(id)))?)
            }
            (None, None) => None,
        };
        let mut members = vec![];
        match value {
            Some(value) => {
                let known = value.into_iter();
                members.extend(known.map(|(member, value)| (member, Local::of(value))));
            }
            None => {
                self.check_given(class, declaration)?;
                for member in self.declarations_of(record)? {
                    let dims = self.standing(member.name, |e| e.dims_declared(member, None))?;
                    let local = Local::without_value(dims, member.is_integer());
                    members.push((member.label.clone(), local));
                }
            }
        }
        let names = members.iter().map(|(member, _)| member.clone()).collect();
        self.frame.records.insert(name.clone(), names);
        let full = |(member, local)| (format!("{name}.{member}"), local);
        self.frame.locals.extend(members.into_iter().map(full));
        Ok(())
    }

    /// The size of a variable of a function; `:` is taken from its value.
    fn dims_declared(
        &mut self,
        declaration: &'a Declaration,
        value: Option<&Value>,
    ) -> Result<Vec<usize>> {
        let dims = self.sizes(&declaration.dimensions, |axis| {
            let found = value.and_then(|value| value.dims.get(axis));
            found.copied().ok_or_else(|| {
                let name = &declaration.label;
                let message = format!("the size `:` of `{name}` needs a value to be taken from");
                Problem::new(declaration.name, message)
            })
        })?;
        self.charge(element_count(&dims))?;
        Ok(dims)
    }

    /// Refuses an input that has no value; other variables are given theirs by statements.
    fn check_given(&self, class: &Class, declaration: &Declaration) -> Result<()> {
        if declaration.causality != Causality::Input {
            return Ok(());
        }
        let (name, function) = (&declaration.label, &class.path);
        Err(self.problem(format!(
            "input `{name}` of function `{function}` is not given"
        )))
    }
}

impl<'a> Evaluator<'a> {
    /// The record that an expression is; `None` where it is a number or an array.
    pub(super) fn record(&mut self, id: ExprId) -> Result<Option<Members>> {
        self.deeper(self.span(id), |evaluator| evaluator.record_here(id))
    }

    fn record_here(&mut self, id: ExprId) -> Result<Option<Members>> {
        let expression = self.ast.expression(id);
        let span = expression.span;
        match &expression.kind {
            Kind::Member(record, name) => {
                let record = self.record(*record)?;
                Ok(record.and_then(|record| inner(&record, name)))
            }
            Kind::Call(call) => self.record_of_call(call),
            Kind::Array(elements) => self.array_of_records(elements),
            _ => {
                let Some((name, subscripts)) = reference(self.source, self.ast, id) else {
                    return Ok(None);
                };
                let whole = plain(self.text(span));
                match self.record_named(&whole, &[])? {
                    None if whole != name => self.record_named(&name, &subscripts),
                    found => Ok(found),
                }
            }
        }
    }

    /// The record that an expression is, or its value.
    pub(super) fn members(&mut self, id: ExprId) -> Result<Members> {
        match self.record(id)? {
            Some(record) => Ok(record),
            None => Ok(number_of(self.value(id)?)),
        }
    }

    /// The member of a record, as `Kind::Member` has it.
    pub(super) fn member(&mut self, record: ExprId, name: &str) -> Result<Value> {
        let found = self.record(record)?;
        let value = found.as_ref().and_then(|record| member(record, name));
        value
            .cloned()
            .ok_or_else(|| self.problem(format!("expected a record with the member `{name}`")))
    }

    fn members_of(&self, name: &str) -> Option<Vec<String>> {
        let of_frame = self.frame.records.get(name);
        let records = &self.symbols.model.records;
        let of_model = || records.get(name).filter(|_| !self.is_closed());
        let of_package = || {
            let full = self.full_names(name).into_iter();
            let mut labels = full.map(|full| constant_label(&full));
            labels.find_map(|label| records.get(&label))
        };
        of_frame.or_else(of_model).or_else(of_package).cloned()
    }

    fn record_named(&mut self, name: &str, subscripts: &[ExprId]) -> Result<Option<Members>> {
        let Some(names) = self.members_of(name) else {
            return Ok(None);
        };
        let mut members = vec![];
        for member in names {
            let full = format!("{name}.{member}");
            self.charge(1)?;
            if let Some(inner) = self.record_named(&full, subscripts)? {
                let inner = inner.into_iter();
                members.extend(inner.map(|(rest, value)| (member_name(&member, &rest), value)));
                continue;
            }
            let value = match subscripts {
                [] => self.value_named(&full, self.at)?,
                _ => self.index_named(&full, subscripts, self.at)?,
            };
            members.push((member, value));
        }
        Ok(Some(members))
    }

    fn array_of_records(&mut self, elements: &'a [ExprId]) -> Result<Option<Members>> {
        let Some((&first, rest)) = elements.split_first() else {
            return Ok(None);
        };
        let Some(first) = self.record(first)? else {
            return Ok(None);
        };
        let mut columns: Vec<(String, Vec<Value>)> = first
            .into_iter()
            .map(|(name, value)| (name, vec![value]))
            .collect();
        for &id in rest {
            let record = self.record(id)?.unwrap_or_default();
            for (name, column) in &mut columns {
                column.push(member(&record, name).cloned().ok_or_else(|| {
                    Problem::new(self.span(id), format!("expected a record with `{name}`"))
                })?);
            }
        }
        let stacked = columns
            .into_iter()
            .map(|(name, values)| Ok((name, self.stack(values)?)));
        stacked.collect::<Result<_>>().map(Some)
    }

    /// `R(1, 2)`, or a function whose first output is a record.
    fn record_of_call(&mut self, call: &'a Call) -> Result<Option<Members>> {
        match self.class_called(call) {
            Some(class) if class.kind == ClassKind::Record => {
                self.constructed(class, call).map(Some)
            }
            Some(class) if class.kind == ClassKind::Function && self.gives_record(class) => {
                let mut outcomes = self.inlined(class, call)?.into_iter();
                Ok(outcomes.next().and_then(|first| number(first).err()))
            }
            _ => Ok(None),
        }
    }

    fn constructed(&mut self, class: &'a Class, call: &'a Call) -> Result<Members> {
        let declarations = self.declarations_of(class)?;
        let given = self.arguments_of(class, &declarations, call)?;
        let mut found = vec![];
        for (declaration, id) in declarations.iter().zip(&given) {
            let value = id.map(|id| self.member_value(declaration, id));
            found.push(value.transpose()?);
        }
        // what is not given may be made from what is
        self.inside(class, |evaluator| {
            let given = found.iter().flatten();
            given.for_each(|value| evaluator.know(value));
            let mut members = vec![];
            for (declaration, value) in declarations.iter().zip(found) {
                members.extend(match (value, declaration.binding) {
                    (Some(value), _) => value,
                    (None, Some(id)) => {
                        let value = evaluator.member_value(declaration, id)?;
                        evaluator.know(&value);
                        value
                    }
                    (None, None) => {
                        let label = &declaration.label;
                        let message = format!("the member `{label}` of the record is not given");
                        return Err(evaluator.problem(message));
                    }
                });
            }
            Ok(members)
        })
    }

    /// A member of a record with its value, or those of the record that it is.
    fn member_value(&mut self, declaration: &Declaration, id: ExprId) -> Result<Members> {
        let members = match declaration.type_name {
            TypeName::Named(_) => self.members(id)?,
            _ => number_of(self.value(id)?),
        };
        let full =
            |(member, value): (String, Value)| (member_name(&declaration.label, &member), value);
        Ok(members.into_iter().map(full).collect())
    }

    /// Makes values known by their names to what is evaluated next.
    fn know(&mut self, members: &Members) {
        for (name, value) in members {
            let local = Local::of(value.clone());
            self.frame.locals.insert(name.clone(), local);
        }
    }
}

fn with_causality<'a>(
    declarations: &[&'a Declaration],
    causality: Causality,
) -> impl Iterator<Item = &'a Declaration> {
    let declarations = declarations.iter().copied();
    declarations.filter(move |declaration| declaration.causality == causality)
}

/// A number or an array as the one member without a name.
fn number_of(value: Value) -> Members {
    vec![(String::new(), value)]
}

/// The members behind `prefix.`, where there are any.
fn inner(record: &Members, prefix: &str) -> Option<Members> {
    let inner = |(name, value): &(String, Value)| {
        let rest = name.strip_prefix(prefix)?.strip_prefix('.')?;
        Some((rest.to_owned(), value.clone()))
    };
    let members: Members = record.iter().filter_map(inner).collect();
    (!members.is_empty()).then_some(members)
}
