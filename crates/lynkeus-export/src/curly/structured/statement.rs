//! Statements of a draft as Structured Text.

use super::print::{Printer, comment, lacks};
use crate::Refusal;
use crate::curly::syntax::{Declaration, Expr, If, Line, Otherwise, Range, Statement, Type, Value};

/// What becomes of a value: a statement, and the type that it wants.
type Then<'t> = &'t dyn Fn(&str) -> (String, Type);

impl<'p> Printer<'p> {
    pub fn block(&mut self, lines: &'p [Line]) -> Result<(), Refusal> {
        for (place, line) in lines.iter().enumerate() {
            if let Some(conditional) = skipping(&line.statement) {
                return self.skipped(conditional, &lines[place + 1..]);
            }
            let is_last = place + 1 == lines.len();
            self.statement(line, is_last)?;
        }
        Ok(())
    }

    /// A loop that goes on early does the rest otherwise.
    fn skipped(&mut self, conditional: &'p If, rest: &'p [Line]) -> Result<(), Refusal> {
        let before = conditional.then.split_last().map_or(&[][..], |all| all.1);
        if before.is_empty() {
            let head = self.negated(&conditional.condition)?;
            self.here.line(format!("IF {head} THEN"));
        } else {
            let head = self.value(&conditional.condition, Type::Truth)?;
            self.here.line(format!("IF {head} THEN"));
            self.inside(before)?;
            self.here.line("ELSE");
        }
        self.inside(rest)?;
        self.here.line("END_IF;");
        Ok(())
    }

    fn inside(&mut self, lines: &'p [Line]) -> Result<(), Refusal> {
        self.here.deeper();
        self.block(lines)?;
        self.here.back();
        Ok(())
    }

    fn statement(&mut self, line: &'p Line, is_last: bool) -> Result<(), Refusal> {
        match &line.statement {
            Statement::Unused(_) => {}
            Statement::Comment(words) => {
                for words in comment(words).lines() {
                    self.here.line(words);
                }
            }
            Statement::If(conditional) => {
                let condition = self.value(&conditional.condition, Type::Truth)?;
                self.here.line(format!("IF {condition} THEN"));
                self.branches(conditional)?;
            }
            Statement::For {
                start,
                condition,
                step,
                body,
            } => match Range::of(start.as_ref(), condition, step) {
                Some(range) => self.range(&range, body)?,
                None if start.is_none() => self.repeated(condition, body, Some(step))?,
                None => return Err(lacks("a loop that is no range and begins with a value")),
            },
            Statement::While { condition, body } => self.repeated(condition, body, None)?,
            Statement::Return(value) => {
                let name = self.here.name.clone();
                let kind = self.here.returns;
                self.set(value, None, &|value| (format!("{name} := {value};"), kind))?;
                if !(is_last && self.here.is_outermost()) {
                    self.here.line("RETURN;");
                }
            }
            simple => self.simple(simple, line.comment.as_deref())?,
        }
        Ok(())
    }

    /// A statement without others in it.
    fn simple(&mut self, statement: &'p Statement, words: Option<&str>) -> Result<(), Refusal> {
        match statement {
            Statement::Declare(declaration) => {
                self.declare(declaration)?;
                self.start(declaration, words)
            }
            Statement::Assign {
                target,
                operator: None,
                value,
            } => {
                let kind = self.kind_of(target);
                let target = self.value(target, kind)?;
                self.set(value, words, &|value| {
                    (format!("{target} := {value};"), kind)
                })
            }
            Statement::Assign {
                target,
                operator: Some(operator),
                value,
            } => {
                let kind = self.kind_of(target);
                let target = self.value(target, kind)?;
                let value = self.operand(value, *operator, kind)?;
                let sign = operator.sign();
                self.here
                    .line(format!("{target} := {target} {sign} {value};"));
                Ok(())
            }
            Statement::Count { target, is_up } => {
                let target = self.value(target, Type::Int)?;
                let sign = if *is_up { "+" } else { "-" };
                self.here.line(format!("{target} := {target} {sign} 1;"));
                Ok(())
            }
            Statement::Call(call) => {
                let value = self.value(call, Type::Void)?;
                let done = self.here.once("done()", |name| format!("{name} : BOOL;"));
                self.here.line(format!("{done} := {value};"));
                Ok(())
            }
            _ => Err(lacks("a statement of its kind")),
        }
    }

    /// A statement with a value, and what is said of it. What depends on a condition is told in branches.
    fn set(&mut self, value: &'p Expr, words: Option<&str>, then: Then<'_>) -> Result<(), Refusal> {
        let (_, wanted) = then("");
        let mut inner = value;
        while let Expr::Group(group) = inner {
            inner = group;
        }
        match inner {
            Expr::Choice(condition, first, second) if wanted != Type::Truth => {
                self.choose(condition, first, second, then)
            }
            _ => {
                let line = then(&self.value(value, wanted)?).0;
                let words = words.map_or(String::new(), comment).replace('\n', " ");
                self.here.line(format!("{line} {words}").trim_end());
                Ok(())
            }
        }
    }

    /// One of two values, each computed only where it is needed.
    pub fn choose(
        &mut self,
        condition: &'p Expr,
        first: &'p Expr,
        second: &'p Expr,
        then: Then<'_>,
    ) -> Result<(), Refusal> {
        let condition = self.value(condition, Type::Truth)?;
        self.here.line(format!("IF {condition} THEN"));
        self.here.deeper();
        self.set(first, None, then)?;
        self.here.back();
        self.here.line("ELSE");
        self.here.deeper();
        self.set(second, None, then)?;
        self.here.back();
        self.here.line("END_IF;");
        Ok(())
    }

    /// The value of a declaration.
    fn start(&mut self, declaration: &'p Declaration, words: Option<&str>) -> Result<(), Refusal> {
        let name = self.here.called(&declaration.name);
        let kind = declaration.kind;
        match &declaration.value {
            Value::None => {}
            Value::One(value) => {
                self.set(value, words, &|value| (format!("{name} := {value};"), kind))?
            }
            Value::List(list) => {
                for (place, value) in list.iter().enumerate() {
                    self.set(value, None, &|value| {
                        (format!("{name}[{place}] := {value};"), kind)
                    })?;
                }
            }
        }
        Ok(())
    }

    /// What is done where a condition holds, and otherwise.
    fn branches(&mut self, conditional: &'p If) -> Result<(), Refusal> {
        self.inside(&conditional.then)?;
        match &conditional.otherwise {
            Otherwise::Nothing => {}
            // an empty branch is none
            Otherwise::Block(lines) if lines.iter().all(is_comment) => self.block(lines)?,
            Otherwise::Block(lines) => {
                self.here.line("ELSE");
                self.inside(lines)?;
            }
            Otherwise::If(other) => return self.otherwise(other),
        }
        self.here.line("END_IF;");
        Ok(())
    }

    /// A condition after another one, which may need lines of its own before it.
    fn otherwise(&mut self, other: &'p If) -> Result<(), Refusal> {
        let begin = self.here.length();
        self.here.deeper();
        let condition = self.value(&other.condition, Type::Truth)?;
        self.here.back();
        let before = self.here.take_from(begin);
        if before.is_empty() {
            self.here.line(format!("ELSIF {condition} THEN"));
            return self.branches(other);
        }
        self.here.line("ELSE");
        self.here.put_back(before);
        self.here.deeper();
        self.here.line(format!("IF {condition} THEN"));
        self.branches(other)?;
        self.here.back();
        self.here.line("END_IF;");
        Ok(())
    }

    fn range(&mut self, range: &Range<'p>, body: &'p [Line]) -> Result<(), Refusal> {
        if self.is_empty(range) {
            return Ok(());
        }
        let name = self.here.called(range.name);
        let declared = format!("{name} : DINT;");
        if !self.here.locals.contains(&declared) {
            self.here.locals.push(declared);
        }
        let from = self.value(range.from, Type::Int)?;
        let to = match (range.is_inclusive, self.constant(range.to)) {
            (true, _) => self.value(range.to, Type::Int)?,
            (false, Some(beyond)) => (beyond - 1).to_string(),
            (false, None) => self.before(range.to)?,
        };
        let by = if range.is_up { "" } else { " BY -1" };
        self.here
            .line(format!("FOR {name} := {from} TO {to}{by} DO"));
        self.here.deeper();
        if let Some(only) = range.only {
            self.unless(only)?;
        }
        self.block(body)?;
        self.here.back();
        self.here.line("END_FOR;");
        Ok(())
    }

    /// Whether it is known that a loop has no turn: no compiler likes these.
    fn is_empty(&self, range: &Range<'p>) -> bool {
        let ends = (self.constant(range.from), self.constant(range.to));
        match ends {
            (Some(from), Some(to)) => {
                range.is_up && from >= to + i64::from(range.is_inclusive)
                    || !range.is_up && from < to
            }
            _ => false,
        }
    }

    /// Leaves a loop where a condition does not hold.
    fn unless(&mut self, condition: &'p Expr) -> Result<(), Refusal> {
        let not = self.negated(condition)?;
        self.here.line(format!("IF {not} THEN"));
        self.here.deeper();
        self.here.line("EXIT;");
        self.here.back();
        self.here.line("END_IF;");
        Ok(())
    }

    /// A loop that is no range.
    fn repeated(
        &mut self,
        condition: &'p Expr,
        body: &'p [Line],
        step: Option<&'p Statement>,
    ) -> Result<(), Refusal> {
        if self.is_simple(condition) {
            let condition = self.value(condition, Type::Truth)?;
            self.here.line(format!("WHILE {condition} DO"));
        } else {
            self.here.line("WHILE TRUE DO");
            self.here.deeper();
            self.unless(condition)?;
            self.here.back();
        }
        self.inside(body)?;
        if let Some(step) = step {
            self.here.deeper();
            self.simple(step, None)?;
            self.here.back();
        }
        self.here.line("END_WHILE;");
        Ok(())
    }
}

/// A condition after which a loop goes on with its next value.
fn skipping(statement: &Statement) -> Option<&If> {
    let Statement::If(conditional) = statement else {
        return None;
    };
    let last = conditional.then.last()?;
    let is = last.statement == Statement::Continue && conditional.otherwise == Otherwise::Nothing;
    is.then_some(conditional)
}

fn is_comment(line: &Line) -> bool {
    matches!(line.statement, Statement::Comment(_))
}
