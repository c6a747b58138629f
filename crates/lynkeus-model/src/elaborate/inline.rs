//! Functions of the text, written out where they are called.

use super::evaluate::Evaluator;
use super::frame::{Frame, Local};
use super::records::Record;
use super::value::Value;
use crate::syntax::ast::{Call, Causality, Class, ClassKind, Declaration, ExprId, Kind};
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
            .filter(|d| d.prefix.causality == Causality::Input);
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
}
