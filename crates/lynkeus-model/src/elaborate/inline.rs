//! Functions of the text, written out where they are called.

use super::evaluate::Evaluator;
use super::frame::{Frame, Local};
use super::records::Record;
use super::value::{Value, describe_dims};
use crate::syntax::ast::{Call, Causality, Class, ClassKind, Declaration, ExprId, Kind, TypeName};
use crate::syntax::{Problem, Result, Span, plain, shortened};

/// Most functions that may stand in each other.
const MAX_CALLS: usize = 40;

/// What one output of a function gives.
pub(super) enum Outcome {
    Value(Value),
    Record(Record),
}

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
            .find(|d| d.prefix.causality == Causality::Output);
        let path = self
            .ast
            .classes
            .get(place)
            .map_or("", |class| class.path.as_str());
        first.is_some_and(|first| self.record_type(first, path).is_some())
    }

    /// The record that a variable is declared as.
    fn record_type(&self, declaration: &Declaration, path: &str) -> Option<usize> {
        let TypeName::Named(name) = declaration.prefix.type_name else {
            return None;
        };
        let place = self.classes?.class(&plain(self.text(name)), &[path])?;
        (self.ast.classes.get(place)?.kind == ClassKind::Record).then_some(place)
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
        let scopes = std::mem::replace(&mut self.scopes, vec![&class.path]);
        let loops = std::mem::take(&mut self.loops);
        let outside = self.frame.replace(Frame {
            is_function: true,
            ..Frame::default()
        });
        self.calls.push(place);
        let done = self.carried_out(class, &parts, &declarations, given, span);
        self.calls.pop();
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
            .filter(|d| d.prefix.causality == Causality::Input);
        let mut positional = call.arguments.iter().copied();
        let mut found = vec![];
        let mut count = 0;
        for input in inputs {
            let by_name = |(name, _): &&(Span, ExprId)| plain(self.text(*name)) == input.label;
            let named = call.named.iter().find(by_name).map(|(_, id)| *id);
            count += usize::from(named.is_some());
            let Some(id) = positional.next().or(named) else {
                found.push(None);
                continue;
            };
            let is_record = self.record_type(input, &class.path).is_some();
            found.push(Some(match self.record(id)?.filter(|_| is_record) {
                Some(record) => Outcome::Record(record),
                None => Outcome::Value(self.value(id)?),
            }));
        }
        let (name, takes, given) = (&class.path, found.len(), call.arguments.len());
        if given > takes {
            let message = format!("function `{name}` takes {takes} arguments, found {given}");
            return Err(Problem::new(span, message));
        }
        if count < call.named.len() {
            let message = format!("function `{name}` has no input of this name");
            return Err(Problem::new(span, message));
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
            let value = match declaration.prefix.causality {
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
            .filter(|d| d.prefix.causality == Causality::Output);
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

    /// A variable of a function with its argument, or with the value it is declared with.
    fn introduce(
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
                    let mut local = Local::without_value(value.dims().to_vec(), false);
                    local.elements = value.elements().iter().copied().map(Some).collect();
                    names.push((member, full, local));
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
