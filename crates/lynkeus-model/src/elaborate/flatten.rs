//! Equations of the text to scalar equations over the graph.

use crate::Assertion;
use lynkeus_expr::{Binary, Node};

use super::evaluate::{Branches, Evaluator};
use super::execute;
use super::scope::{Context, Frame, Local, Mode, Named};
use super::symbols::Symbols;
use super::value::{Outcome, Record, Scalar, Value, check_size, describe_dims, element_name};
use crate::balance::FlatEquation;
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::{
    Declaration, Equation, EquationKind, ExprId, ForIndex, Kind, Statement, Variability,
};
use crate::syntax::plain;

/// A model written out.
pub(super) struct Flat {
    pub equations: Vec<FlatEquation>,
    /// of the section `initial equation`; with the places of those that are not read
    pub initial: Vec<FlatEquation>,
    pub initial_unread: Vec<Span>,
    /// what is to hold along a run, and where that stands
    pub claims: Vec<(Assertion, Span)>,
}

/// All scalar equations of a model, declaration equations first.
pub(super) fn flatten<'a>(context: &Context<'a>, symbols: &Symbols<'a>) -> Result<Flat> {
    let model = context.model;
    let evaluator = symbols.evaluator(context, Mode::Continuous);
    let mut flattener = Flattener {
        evaluator,
        equations: vec![],
    };
    for (declaration, component) in symbols.all() {
        if declaration.variability == Variability::Continuous
            && let Some(binding) = declaration.binding
        {
            let variable = Value::new(component.dims.clone(), component.elements.clone());
            flattener.declaration(declaration, variable, binding)?;
        }
    }
    flattener.all(&model.equations)?;
    for algorithm in &model.algorithms {
        flattener.algorithm(algorithm)?;
    }
    let equations = std::mem::take(&mut flattener.equations);
    let claims = std::mem::take(&mut flattener.evaluator.claims);
    let mut initial_unread = vec![];
    for equation in &model.initial {
        match flattener.has_derivative(equation) {
            true => initial_unread.push(equation.span),
            false => flattener.one(equation)?,
        }
    }
    Ok(Flat {
        equations,
        initial: flattener.equations,
        initial_unread,
        claims,
    })
}

struct Flattener<'a> {
    evaluator: Evaluator<'a>,
    equations: Vec<FlatEquation>,
}

impl<'a> Flattener<'a> {
    fn has_derivative(&self, equation: &Equation) -> bool {
        let sides = match &equation.kind {
            EquationKind::Equality(left, right) => [*left, *right],
            _ => return false,
        };
        let ast = self.evaluator.ast;
        let mut parts = sides.into_iter().flat_map(|side| ast.parts(side));
        parts.any(|part| match &part.kind {
            Kind::Call(call) => self.evaluator.text(call.function) == "der",
            _ => false,
        })
    }

    /// The variables that an algorithm assigns, each with an equation of its own.
    fn algorithm(&mut self, statements: &'a [Statement]) -> Result<()> {
        let evaluator = &mut self.evaluator;
        let mut names = vec![];
        execute::targets(evaluator.source, evaluator.ast, statements, &mut names);
        names.sort_unstable();
        names.dedup();
        let mut frame = Frame::default();
        for name in &names {
            if let Named::Array(dims, elements) = evaluator.named(name) {
                evaluator
                    .budget
                    .charge(elements.len() as u64, Span::default())?;
                let is_integer = elements.iter().all(|e| matches!(e, Scalar::Integer(_)));
                let local = Local::without_value(dims.to_vec(), is_integer);
                frame.locals.insert(name.clone(), local);
            }
        }
        evaluator.frame = Some(frame);
        let done = evaluator.execute(statements);
        let frame = evaluator.frame.take().unwrap_or_default();
        done?;
        let span = statements.first().map(|s| s.span).unwrap_or_default();
        for name in names {
            let span = statements
                .iter()
                .map(|statement| statement.span)
                .find(|span| plain(self.evaluator.text(*span)).starts_with(name.as_str()))
                .unwrap_or(span);
            self.assigned(&name, &frame, span)?;
        }
        Ok(())
    }

    fn assigned(&mut self, name: &str, frame: &Frame, span: Span) -> Result<()> {
        let (Some(local), Named::Array(dims, elements)) =
            (frame.locals.get(name), self.evaluator.named(name))
        else {
            return Ok(());
        };
        for (offset, (&variable, value)) in elements.iter().zip(&local.elements).enumerate() {
            let Some(value) = *value else {
                let full = element_name(name, dims, offset);
                return Err(self.evaluator.unassigned(&full, span));
            };
            self.equate(Value::Scalar(variable), Value::Scalar(value), span)?;
        }
        Ok(())
    }

    fn declaration(
        &mut self,
        declaration: &Declaration,
        variable: Value,
        binding: ExprId,
    ) -> Result<()> {
        let name = &declaration.label;
        let span = declaration.name.to(self.evaluator.span(binding));
        let value = self.evaluator.value(binding)?;
        check_size(
            name,
            variable.dims(),
            value.dims(),
            self.evaluator.span(binding),
        )?;
        self.equate(variable, value, span)
    }

    fn all(&mut self, equations: &'a [Equation]) -> Result<()> {
        equations.iter().try_for_each(|equation| self.one(equation))
    }

    fn one(&mut self, equation: &'a Equation) -> Result<()> {
        self.evaluator.budget.charge(1, equation.span)?;
        match &equation.kind {
            EquationKind::Equality(left, right) => {
                if let Some(left) = self.evaluator.record(*left)? {
                    return self.equate_records(left, *right, equation.span);
                }
                let (left, right) = (self.evaluator.value(*left)?, self.evaluator.value(*right)?);
                self.equate(left, right, equation.span)
            }
            EquationKind::Several(targets, call) => self.several(targets, *call, equation.span),
            EquationKind::Assert(assert) => self.evaluator.claim(assert, equation.span),
            EquationKind::For(iterators, body) => self.repeat(iterators, body),
            EquationKind::If(branches, otherwise) => {
                self.choose(branches, otherwise, equation.span)
            }
        }
    }

    fn equate_records(&mut self, left: Record, right: ExprId, span: Span) -> Result<()> {
        let right = self.evaluator.record(right)?;
        for (name, value) in left.members {
            let other = right.as_ref().and_then(|right| right.member(&name));
            let other = other.cloned().ok_or_else(|| {
                let message = format!("expected a record with the member `{name}` on both sides");
                Problem::new(span, message)
            })?;
            self.equate(value, other, span)?;
        }
        Ok(())
    }

    fn several(&mut self, targets: &[Option<ExprId>], call: ExprId, span: Span) -> Result<()> {
        let outcomes = self.evaluator.outcomes(call, targets.len())?;
        for (target, outcome) in targets.iter().zip(outcomes) {
            let Some(target) = *target else {
                continue;
            };
            match outcome {
                Outcome::Value(value) => {
                    let left = self.evaluator.value(target)?;
                    self.equate(left, value, span)?;
                }
                Outcome::Record(record) => self.equate_records(record, target, span)?,
            }
        }
        Ok(())
    }

    fn repeat(&mut self, iterators: &'a [ForIndex], body: &'a [Equation]) -> Result<()> {
        let Some((first, rest)) = iterators.split_first() else {
            return self.all(body);
        };
        for turn in self.evaluator.turns(first)? {
            self.evaluator.budget.charge(1, first.name)?;
            self.evaluator
                .loops
                .push((first.name.text(self.evaluator.source), turn));
            let done = self.repeat(rest, body);
            self.evaluator.loops.pop();
            done?;
        }
        Ok(())
    }

    fn equate(&mut self, left: Value, right: Value, span: Span) -> Result<()> {
        if left.dims() != right.dims() {
            let (left, right) = (describe_dims(left.dims()), describe_dims(right.dims()));
            let message = format!("the sides differ in size: left is {left}, right is {right}");
            return Err(Problem::new(span, message));
        }
        let count = left.elements().len();
        self.evaluator.budget.charge(count as u64, span)?;
        for (offset, (&a, &b)) in left.elements().iter().zip(right.elements()).enumerate() {
            let (a, b) = match (a, b) {
                (Scalar::Boolean(a), Scalar::Boolean(b)) => (a, b),
                _ => (self.side(a, span)?, self.side(b, span)?),
            };
            let element = match left.dims() {
                [] => None,
                dims => Some(element_name("", dims, offset)),
            };
            self.equations.push(FlatEquation {
                left: a,
                right: b,
                span,
                element,
            });
        }
        Ok(())
    }

    fn side(&self, scalar: Scalar, span: Span) -> Result<Node> {
        scalar.real(self.evaluator.graph).ok_or_else(|| {
            Problem::new(span, "an equation between a Boolean and a number")
                .hint("write `if a then 1 else 0` for the number of a condition")
        })
    }

    /// A known condition takes its branch; otherwise the branches are joined equation by
    /// equation.
    fn choose(
        &mut self,
        branches: &'a [(ExprId, Vec<Equation>)],
        otherwise: &'a [Equation],
        span: Span,
    ) -> Result<()> {
        let pairs = branches.iter().map(|(c, body)| (*c, body.as_slice()));
        let branches = self.evaluator.branches(pairs, otherwise)?;
        let around = self.evaluator.pass(&branches);
        let joined = self.joined(branches, span);
        self.evaluator.conditions.truncate(around);
        let joined = joined?;
        self.evaluator.budget.charge(joined.len() as u64, span)?;
        self.equations.extend(joined);
        Ok(())
    }

    fn joined(
        &mut self,
        branches: Branches<&'a [Equation]>,
        span: Span,
    ) -> Result<Vec<FlatEquation>> {
        let mut joined = self.apart(branches.last)?;
        for (condition, body) in branches.open.into_iter().rev() {
            self.evaluator.enter();
            let branch = self.apart(body)?;
            self.evaluator.conditions.pop();
            if branch.len() != joined.len() {
                let (one, two) = (branch.len(), joined.len());
                let message = format!("the branches have {one} and {two} equations");
                return Err(Problem::new(span, message)
                    .hint("every branch, `else` included, needs the same number of equations"));
            }
            let pairs = branch.into_iter().zip(joined);
            joined = pairs
                .map(|(yes, no)| self.join(condition, yes, no))
                .collect();
        }
        Ok(joined)
    }

    /// The equations of a branch by themselves.
    fn apart(&mut self, body: &'a [Equation]) -> Result<Vec<FlatEquation>> {
        let outside = std::mem::take(&mut self.equations);
        let done = self.all(body);
        let inside = std::mem::replace(&mut self.equations, outside);
        done.map(|()| inside)
    }

    fn join(&self, condition: Node, yes: FlatEquation, no: FlatEquation) -> FlatEquation {
        let graph = self.evaluator.graph;
        if yes.left == no.left {
            let right = graph.select(condition, yes.right, no.right);
            return FlatEquation { right, ..yes };
        }
        let residual =
            |equation: &FlatEquation| graph.binary(Binary::Sub, equation.left, equation.right);
        let left = graph.select(condition, residual(&yes), residual(&no));
        let right = graph.constant(0.0).node();
        FlatEquation { left, right, ..yes }
    }
}
