//! Functions and records of the text, written out where they are called.

use super::evaluate::{Evaluator, joined};
use super::scope::{Frame, Local};
use super::value::{Outcome, Record, Value, check_size, element_count};
use crate::diagnostic::{Problem, Result, Span};
use crate::flat::constant_label;
use crate::syntax::ast::{Call, Causality, Class, ClassKind, Declaration, ExprId, Kind, TypeName};
use crate::syntax::{plain, shortened};

/// Most functions that may stand in each other.
const MAX_CALLS: usize = 40;

impl<'a> Evaluator<'a> {
    /// The class of the text that a call names.
    pub(super) fn class_called(&self, call: &Call) -> Option<(usize, &'a Class)> {
        let name = plain(self.text(call.function));
        let place = self.classes?.class(&name, &self.scopes)?;
        Some((place, self.ast.classes.get(place)?))
    }

    /// The value of a call of a function of the text; `None` where there is no such function.
    pub(super) fn own_function(&mut self, call: &'a Call, span: Span) -> Result<Option<Value>> {
        let Some((place, class)) = self.class_called(call) else {
            return Ok(None);
        };
        if class.kind != ClassKind::Function {
            return Ok(None);
        }
        match self.inlined(place, call, span)?.into_iter().next() {
            Some(Outcome::Value(value)) => Ok(Some(value)),
            Some(Outcome::Record(_)) => {
                Err(Problem::new(span, "expected a number, found a record"))
            }
            None => {
                let name = &class.path;
                let message = format!("function `{name}` has no output");
                Err(Problem::new(span, message).hint("declare one: `output Real y;`"))
            }
        }
    }

    /// The values of `(a, b) = f(x)`.
    pub(super) fn outcomes(&mut self, id: ExprId, wanted: usize) -> Result<Vec<Outcome>> {
        let span = self.span(id);
        let Kind::Call(call) = &self.ast.expression(id).kind else {
            return Err(Problem::new(span, "expected a call of a function"));
        };
        let Some((place, class)) = self.class_called(call) else {
            let name = shortened(self.text(call.function));
            let message = format!("the text has no function `{name}` with several outputs");
            return Err(Problem::new(call.function, message));
        };
        let outcomes = self.inlined(place, call, span)?;
        if outcomes.len() < wanted {
            let (name, has) = (&class.path, outcomes.len());
            let message = format!("function `{name}` has {has} outputs, {wanted} are taken here");
            return Err(Problem::new(span, message));
        }
        Ok(outcomes)
    }

    /// Declarations of a class and of its bases, those of the bases first.
    pub(super) fn declarations_of(&self, place: usize) -> Result<Vec<&'a Declaration>> {
        let classes = self.with_bases(place)?;
        Ok(classes
            .into_iter()
            .flat_map(|class| &class.declarations)
            .collect())
    }

    /// A class behind its bases.
    fn with_bases(&self, place: usize) -> Result<Vec<&'a Class>> {
        let (mut found, mut open) = (vec![], vec![place]);
        while let Some(place) = open.pop() {
            let Some(class) = self.ast.classes.get(place) else {
                continue;
            };
            found.push(class);
            if found.len() > MAX_CALLS {
                let message = format!("`{}` is made from itself", class.path);
                return Err(Problem::new(class.name, message).hint("remove the `extends`"));
            }
            for base in &class.bases {
                let name = plain(self.text(base.name));
                let known = self
                    .classes
                    .and_then(|classes| classes.class(&name, &[&class.path]));
                open.push(known.ok_or_else(|| {
                    let message = format!("`extends {name}` of another file");
                    Problem::new(base.name, message)
                })?);
            }
        }
        found.reverse();
        Ok(found)
    }

    /// True where the first output of a function is a record.
    pub(super) fn gives_record(&self, place: usize) -> bool {
        let declarations = self.declarations_of(place).unwrap_or_default();
        let first = declarations
            .into_iter()
            .find(|d| d.causality == Causality::Output);
        let path = self
            .ast
            .classes
            .get(place)
            .map_or("", |class| class.path.as_str());
        first.is_some_and(|first| self.record_type(first, path).is_some())
    }

    /// Carries out a function for the arguments of a call; gives its outputs in order.
    pub(super) fn inlined(
        &mut self,
        place: usize,
        call: &'a Call,
        span: Span,
    ) -> Result<Vec<Outcome>> {
        let Some(class) = self.ast.classes.get(place) else {
            return Ok(vec![]);
        };
        self.check_callable(place, class, span)?;
        let parts = self.with_bases(place)?;
        let declarations = self.declarations_of(place)?;
        let given = self.given(&declarations, class, call, span)?;
        self.calls.push(place);
        let done = self.inside(class, |evaluator| {
            evaluator.carried_out(class, &parts, &declarations, given, span)
        });
        self.calls.pop();
        done
    }

    /// What stands in a class that knows nothing of what is around it but constants.
    pub(super) fn inside<T>(
        &mut self,
        class: &'a Class,
        run: impl FnOnce(&mut Self) -> Result<T>,
    ) -> Result<T> {
        let scopes = std::mem::replace(&mut self.scopes, vec![&class.path]);
        let loops = std::mem::take(&mut self.loops);
        let outside = self.frame.replace(Frame::closed());
        let done = run(self);
        self.frame = outside;
        self.loops = loops;
        self.scopes = scopes;
        done
    }

    fn check_callable(&self, place: usize, class: &Class, span: Span) -> Result<()> {
        let name = &class.path;
        if self.calls.contains(&place) {
            let message = format!("function `{name}` calls itself");
            return Err(Problem::new(span, message)
                .hint("a recursion has no end when it is written out: use a `for` loop"));
        }
        if self.calls.len() >= MAX_CALLS {
            let message =
                format!("functions stand in each other more than {MAX_CALLS} levels deep");
            return Err(Problem::new(span, message));
        }
        if class.is_external || class.is_partial || class.alias.is_some() {
            let message = format!("function `{name}` has no algorithm in this text");
            return Err(Problem::new(span, message)
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
        span: Span,
    ) -> Result<Vec<Option<Outcome>>> {
        let inputs = declarations
            .iter()
            .filter(|d| d.causality == Causality::Input);
        let inputs: Vec<&Declaration> = inputs.copied().collect();
        let mut found = vec![];
        for (input, id) in inputs
            .iter()
            .zip(self.arguments_of(class, &inputs, call, span)?)
        {
            let Some(id) = id else {
                found.push(None);
                continue;
            };
            let is_record = self.record_type(input, &class.path).is_some();
            found.push(Some(match self.record(id)?.filter(|_| is_record) {
                Some(record) => Outcome::Record(record),
                None => Outcome::Value(self.value(id)?),
            }));
        }
        Ok(found)
    }

    /// The expressions that a call gives to each input of a function or member of a record, in
    /// order or by name.
    pub(super) fn arguments_of(
        &self,
        class: &Class,
        declarations: &[&Declaration],
        call: &Call,
        span: Span,
    ) -> Result<Vec<Option<ExprId>>> {
        let (kind, part) = match class.kind {
            ClassKind::Function => ("function", "input"),
            _ => ("record", "member"),
        };
        let (name, takes, given) = (&class.path, declarations.len(), call.arguments.len());
        if given > takes {
            let message = format!("{kind} `{name}` takes {takes} arguments, found {given}");
            return Err(Problem::new(span, message));
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

    fn carried_out(
        &mut self,
        class: &'a Class,
        parts: &[&'a Class],
        declarations: &[&'a Declaration],
        given: Vec<Option<Outcome>>,
        span: Span,
    ) -> Result<Vec<Outcome>> {
        let mut given = given.into_iter();
        for declaration in declarations {
            let value = match declaration.causality {
                Causality::Input => given.next().flatten(),
                _ => None,
            };
            self.introduce(class, declaration, value, span)?;
        }
        for part in parts {
            for algorithm in &part.algorithms {
                self.execute(algorithm)?;
            }
        }
        let outputs = declarations
            .iter()
            .filter(|d| d.causality == Causality::Output);
        let mut outcomes = vec![];
        for output in outputs {
            outcomes.push(self.outcome(class, output)?);
        }
        Ok(outcomes)
    }

    fn outcome(&self, class: &Class, output: &Declaration) -> Result<Outcome> {
        let missing = |name: &str| {
            let function = &class.path;
            let message = format!("output `{name}` of function `{function}` is not given a value");
            Problem::new(output.name, message)
                .hint("assign it in the algorithm, in every case of an `if`")
        };
        let frame = self.frame.as_ref();
        let value = |name: &str| {
            let local = frame.and_then(|frame| frame.locals.get(name));
            local.and_then(Local::value).ok_or_else(|| missing(name))
        };
        let Some(names) = frame.and_then(|frame| frame.records.get(&output.label)) else {
            return Ok(Outcome::Value(value(&output.label)?));
        };
        let members = names.iter().map(|name| {
            let full = format!("{}.{name}", output.label);
            Ok((name.clone(), value(&full)?))
        });
        Ok(Outcome::Record(Record {
            members: members.collect::<Result<_>>()?,
        }))
    }
}

impl<'a> Evaluator<'a> {
    /// The record that a variable is declared as.
    pub(super) fn record_type(&self, declaration: &Declaration, path: &str) -> Option<usize> {
        let TypeName::Named(name) = declaration.type_name else {
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
        if let TypeName::Named(type_name) = declaration.type_name {
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
        let mut local = Local::without_value(dims, declaration.is_integer());
        if let Some(value) = value {
            check_size(&name, &local.dims, value.dims(), span)?;
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
            let local = Local::without_value(dims, declaration.is_integer());
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
        let count = element_count(&dims).unwrap_or(u64::MAX);
        self.budget.charge(count, span)?;
        Ok(dims)
    }
}

/// Refuses an input that has no value; other variables are given theirs by statements.
fn check_given(class: &Class, declaration: &Declaration, span: Span) -> Result<()> {
    if declaration.causality != Causality::Input {
        return Ok(());
    }
    let (name, function) = (&declaration.label, &class.path);
    let message = format!("input `{name}` of function `{function}` is not given");
    Err(Problem::new(span, message))
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
        if let TypeName::Named(_) = declaration.type_name
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
