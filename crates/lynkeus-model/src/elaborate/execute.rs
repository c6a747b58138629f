//! Statements, carried out on expressions: what is left are the values of the variables.

use lynkeus_expr::{Binary, Node, Unary};

use super::evaluate::{Evaluator, reference};
use super::scope::Frame;
use super::value::{Value, describe_dims, member_name};
use crate::Assertion;
use crate::diagnostic::{Problem, Result};
use crate::syntax::ast::{Assert, Ast, ExprId, ForIndex, Statement, StatementKind};

/// How a list of statements ended.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Ended {
    AtItsEnd,
    ByBreak,
    ByReturn,
}

/// Names that statements give values to.
pub(super) fn targets(source: &str, ast: &Ast, statements: &[Statement], into: &mut Vec<String>) {
    for statement in statements {
        match &statement.kind {
            StatementKind::Assign(targets, _) => {
                let targets = targets.iter().flatten();
                let names = targets.filter_map(|&id| Some(reference(source, ast, id)?.0));
                into.extend(names);
            }
            StatementKind::For(_, body) | StatementKind::While(_, body) => {
                self::targets(source, ast, body, into);
            }
            StatementKind::If(branches, otherwise) => {
                for (_, body) in branches {
                    self::targets(source, ast, body, into);
                }
                self::targets(source, ast, otherwise, into);
            }
            StatementKind::When(clauses) => {
                for (_, body) in clauses {
                    self::targets(source, ast, body, into);
                }
            }
            _ => {}
        }
    }
}

impl<'a> Evaluator<'a> {
    pub(super) fn execute(&mut self, statements: &'a [Statement]) -> Result<Ended> {
        for statement in statements {
            self.budget.charge(1, statement.span)?;
            let ended = self.deeper(statement.span, |evaluator| evaluator.statement(statement))?;
            if ended != Ended::AtItsEnd {
                return Ok(ended);
            }
        }
        Ok(Ended::AtItsEnd)
    }

    fn statement(&mut self, statement: &'a Statement) -> Result<Ended> {
        match &statement.kind {
            StatementKind::Assign(targets, value) => self.assign_all(targets, *value)?,
            StatementKind::For(iterators, body) => {
                return self.repeated(iterators, Self::value, &mut |e| e.execute(body));
            }
            StatementKind::While(condition, body) => return self.repeated_while(*condition, body),
            StatementKind::If(branches, otherwise) => {
                return self.branched(branches, otherwise);
            }
            StatementKind::When(_) => {
                let message = "a `when` within another statement";
                return Err(self
                    .problem(message)
                    .hint("it stands by itself in a section `algorithm` of the model"));
            }
            StatementKind::Assert(assert) => self.claim(assert)?,
            StatementKind::Break => return Ok(Ended::ByBreak),
            StatementKind::Return => return Ok(Ended::ByReturn),
        }
        Ok(Ended::AtItsEnd)
    }

    /// Notes an `assert`; one that is known to fail is refused.
    pub(super) fn claim(&mut self, assert: &Assert) -> Result<()> {
        if self.is_in_when {
            let message = "an `assert` within a `when` is not supported";
            return Err(self
                .problem(message)
                .hint("write it outside, where it always holds"));
        }
        let mut condition = self.condition(assert.condition)?;
        self.charge(self.conditions.len() as u64)?;
        for &(on_path, holds) in &self.conditions {
            let elsewhere = match holds {
                true => self.graph.unary(Unary::Not, on_path),
                false => on_path,
            };
            condition = self.graph.binary(Binary::Or, elsewhere, condition);
        }
        match self.graph.constant_value(condition) {
            Some(0.0) if !assert.is_warning => {
                let message = format!("this assertion does not hold: {}", assert.message);
                Err(self
                    .problem(message)
                    .hint("change the parameters that it is about"))
            }
            Some(value) if value != 0.0 => Ok(()),
            _ => {
                let claim = Assertion {
                    condition,
                    message: assert.message.clone(),
                    line: self.at.line(self.source),
                    is_warning: assert.is_warning,
                };
                self.claims.push((claim, self.at));
                Ok(())
            }
        }
    }

    /// Runs a body for all values of the iterators; `range` evaluates what they go over.
    pub(super) fn repeated(
        &mut self,
        iterators: &'a [ForIndex],
        range: fn(&mut Self, ExprId) -> Result<Value>,
        body: &mut dyn FnMut(&mut Self) -> Result<Ended>,
    ) -> Result<Ended> {
        let Some((first, rest)) = iterators.split_first() else {
            return body(self);
        };
        let value = range(self, first.range)?;
        for turn in self.range_elements(value, self.span(first.range))? {
            self.budget.charge(1, first.name)?;
            self.loops.push((self.text(first.name), turn));
            let ended = self.repeated(rest, range, body);
            self.loops.pop();
            match ended? {
                Ended::AtItsEnd => {}
                Ended::ByBreak => break,
                Ended::ByReturn => return Ok(Ended::ByReturn),
            }
        }
        Ok(Ended::AtItsEnd)
    }

    fn repeated_while(&mut self, condition: ExprId, body: &'a [Statement]) -> Result<Ended> {
        loop {
            let span = self.span(condition);
            self.budget.charge(1, span)?;
            let node = self.condition(condition)?;
            match self.graph.constant_value(node) {
                Some(0.0) => return Ok(Ended::AtItsEnd),
                Some(_) => {}
                None => {
                    let message = "this `while` depends on variables";
                    return Err(Problem::new(span, message)
                        .hint("use a `for` loop of a known length with an `if` inside"));
                }
            }
            match self.execute(body)? {
                Ended::AtItsEnd => {}
                Ended::ByBreak => return Ok(Ended::AtItsEnd),
                Ended::ByReturn => return Ok(Ended::ByReturn),
            }
        }
    }

    /// A known condition takes its branch; otherwise each variable takes the value of one
    /// branch or another.
    fn branched(
        &mut self,
        branches: &'a [(ExprId, Vec<Statement>)],
        otherwise: &'a [Statement],
    ) -> Result<Ended> {
        let around = self.conditions.len();
        let take = |evaluator: &mut Self, body: &'a [Statement]| {
            if evaluator.conditions.len() == around {
                let ended = evaluator.execute(body)?;
                return Ok((ended, std::mem::take(&mut evaluator.frame)));
            }
            let before = evaluator.frame.clone();
            evaluator.whole(body)?;
            let after = std::mem::replace(&mut evaluator.frame, before);
            Ok((Ended::AtItsEnd, after))
        };
        let join = |evaluator: &mut Self, condition: Node, (_, yes): (_, Frame), no| {
            let (ended, no): (Ended, Frame) = no;
            evaluator.charge(yes.size() as u64)?;
            Ok((ended, Frame::joined(condition, yes, no, evaluator.graph)))
        };
        let pairs = branches.iter().map(|(c, body)| (*c, body.as_slice()));
        let (ended, frame) = self.chosen(pairs, otherwise, take, join)?;
        self.frame = frame;
        Ok(ended)
    }

    /// Statements from which nothing leads away.
    fn whole(&mut self, statements: &'a [Statement]) -> Result<()> {
        match self.execute(statements)? {
            Ended::AtItsEnd => Ok(()),
            Ended::ByBreak | Ended::ByReturn => {
                let message = "`break` or `return` under a condition that depends on variables";
                Err(self.problem(message).hint("use `if … else …` without them"))
            }
        }
    }

    fn assign_all(&mut self, targets: &'a [Option<ExprId>], value: ExprId) -> Result<()> {
        let outcomes = match targets {
            [Some(_)] => vec![self.members(value)?],
            _ => self.outcomes(value, targets.len())?,
        };
        for (target, outcome) in targets.iter().zip(outcomes) {
            let Some(target) = *target else {
                continue;
            };
            let (name, subscripts) = reference(self.source, self.ast, target).ok_or_else(|| {
                let message = "expected a variable before `:=`";
                Problem::new(self.span(target), message)
            })?;
            for (member, value) in outcome {
                let subscripts = match member.as_str() {
                    "" => &subscripts[..],
                    _ => &[],
                };
                self.assign_to(&member_name(&name, &member), subscripts, value)?;
            }
        }
        Ok(())
    }

    fn assign_to(&mut self, name: &str, subscripts: &[ExprId], value: Value) -> Result<()> {
        let at = self.at;
        let unknown = || {
            let message = format!("`{name}` cannot be given a value here");
            Problem::new(at, message)
                .hint("an algorithm assigns its own variables: outputs and protected ones")
        };
        let dims = self.local(name).ok_or_else(unknown)?.dims.clone();
        let (kept, offsets) = self.selected(name, &dims, subscripts)?;
        let Value { dims, elements } = value;
        if kept != dims {
            let (has, found) = (describe_dims(&kept), describe_dims(&dims));
            let message = format!("`{name}` takes {has} here, its value has {found}");
            return Err(self.problem(message));
        }
        self.charge(offsets.len() as u64)?;
        let graph = self.graph;
        let local = self.frame.locals.get_mut(name);
        let local = local.ok_or_else(unknown)?;
        for (offset, scalar) in offsets.into_iter().zip(elements) {
            local.elements[offset] = Some(local.converted(scalar, graph));
        }
        Ok(())
    }
}
