//! Equations of the text to scalar equations over the graph.

use lynkeus_expr::{Binary, Node};

use super::clauses::FlatClause;
use super::evaluate::Evaluator;
use super::events::discrete;
use super::execute::{Ended, targets};
use super::scope::{Frame, Local, Mode, Named};
use super::symbols::Symbols;
use super::value::{
    Members, Scalar, Value, check_size, describe_dims, element_name, member, number,
};
use crate::Assertion;
use crate::balance::FlatEquation;
use crate::diagnostic::{Result, Span};
use crate::syntax::ast::{
    Equation, EquationKind, ExprId, Kind, Statement, StatementKind, Variability,
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
    pub clauses: Vec<FlatClause>,
}

/// All scalar equations of a model, declaration equations first.
pub(super) fn flatten(symbols: &Symbols<'_>) -> Result<Flat> {
    let model = symbols.model;
    let mut evaluator = Evaluator::new(symbols, Mode::Continuous);
    for (_, declaration, component) in symbols.all() {
        if declaration.variability == Variability::Continuous
            && let Some(binding) = declaration.binding
        {
            let value = evaluator.value(binding)?;
            let at = evaluator.span(binding);
            check_size(&declaration.label, &component.dims, &value.dims, at)?;
            let variable = Value {
                dims: component.dims.clone(),
                elements: component.elements.clone(),
            };
            evaluator.at = declaration.name.to(at);
            evaluator.equate(&variable, &value)?;
        }
    }
    evaluator.write_out(&model.equations)?;
    for algorithm in &model.algorithms {
        evaluator.algorithm(algorithm)?;
    }
    let mut equations = std::mem::take(&mut evaluator.equations);
    let mut clauses = std::mem::take(&mut evaluator.clauses);
    discrete(symbols, &mut equations, &mut clauses)?;
    let claims = std::mem::take(&mut evaluator.claims);
    let mut initial_unread = vec![];
    for equation in &model.initial {
        match evaluator.has_derivative(equation) {
            true => initial_unread.push(equation.span),
            false => evaluator.equation(equation)?,
        }
    }
    Ok(Flat {
        equations,
        initial: evaluator.equations,
        initial_unread,
        claims,
        clauses,
    })
}

impl<'a> Evaluator<'a> {
    fn has_derivative(&self, equation: &Equation) -> bool {
        let EquationKind::Equality(left, right) = equation.kind else {
            return false;
        };
        let mut parts = self.ast.parts(left).chain(self.ast.parts(right));
        parts.any(|part| match &part.kind {
            Kind::Call(call) => self.text(call.function) == "der",
            _ => false,
        })
    }

    /// The variables that an algorithm assigns, each with an equation of its own.
    fn algorithm(&mut self, statements: &'a [Statement]) -> Result<()> {
        if statements
            .iter()
            .any(|s| matches!(s.kind, StatementKind::When(_)))
        {
            return self.when_statements(statements);
        }
        let mut names = vec![];
        targets(self.source, self.ast, statements, &mut names);
        names.sort_unstable();
        names.dedup();
        let mut frame = Frame::default();
        for name in &names {
            if let Named::Array(dims, elements) = self.named(name) {
                self.budget.charge(elements.len() as u64, Span::default())?;
                let is_integer = elements.iter().all(|e| matches!(e, Scalar::Integer(_)));
                let local = Local::without_value(dims.to_vec(), is_integer);
                frame.locals.insert(name.clone(), local);
            }
        }
        self.frame = frame;
        let done = self.execute(statements);
        let frame = std::mem::take(&mut self.frame);
        done?;
        let spans = || statements.iter().map(|statement| statement.span);
        for name in names {
            let assigns = |span: &Span| plain(self.text(*span)).starts_with(name.as_str());
            let span = spans().find(assigns).or_else(|| spans().next());
            self.assigned(&name, &frame, span.unwrap_or_default())?;
        }
        Ok(())
    }

    fn assigned(&mut self, name: &str, frame: &Frame, span: Span) -> Result<()> {
        let (Some(local), Named::Array(dims, elements)) =
            (frame.locals.get(name), self.named(name))
        else {
            return Ok(());
        };
        self.at = span;
        for (offset, (&variable, value)) in elements.iter().zip(&local.elements).enumerate() {
            let Some(value) = *value else {
                let full = element_name(name, dims, offset);
                return Err(self.unassigned(&full, span));
            };
            self.equate(&variable.into(), &value.into())?;
        }
        Ok(())
    }

    fn write_out(&mut self, equations: &'a [Equation]) -> Result<()> {
        let mut equations = equations.iter();
        equations.try_for_each(|equation| self.equation(equation))
    }

    fn equation(&mut self, equation: &'a Equation) -> Result<()> {
        self.standing(equation.span, |evaluator| evaluator.equation_here(equation))
    }

    fn equation_here(&mut self, equation: &'a Equation) -> Result<()> {
        self.charge(1)?;
        match &equation.kind {
            EquationKind::Equality(left, right) => {
                let left = self.members(*left)?;
                self.equate_members(left, *right)
            }
            EquationKind::Several(targets, call) => self.several(targets, *call),
            EquationKind::Assert(assert) => self.claim(assert),
            EquationKind::For(iterators, body) => {
                let mut body = |e: &mut Self| e.write_out(body).map(|()| Ended::AtItsEnd);
                let ended = self.repeated(iterators, Self::structural, &mut body);
                ended.map(|_| ())
            }
            EquationKind::If(branches, otherwise) => self.choose(branches, otherwise),
            EquationKind::When(clauses) => self.when(clauses),
            EquationKind::Reinit(state, value) => self.reinit(*state, *value),
        }
    }

    fn equate_members(&mut self, left: Members, right: ExprId) -> Result<()> {
        let left = match number(left) {
            Ok(left) => {
                let right = self.value(right)?;
                return self.equate(&left, &right);
            }
            Err(members) => members,
        };
        let right = self.record(right)?.unwrap_or_default();
        for (name, value) in left {
            let other = member(&right, &name).ok_or_else(|| {
                let message = format!("expected a record with the member `{name}` on both sides");
                self.problem(message)
            })?;
            self.equate(&value, other)?;
        }
        Ok(())
    }

    fn several(&mut self, targets: &[Option<ExprId>], call: ExprId) -> Result<()> {
        let outcomes = self.outcomes(call, targets.len())?;
        for (target, outcome) in targets.iter().zip(outcomes) {
            let Some(target) = *target else {
                continue;
            };
            match number(outcome) {
                Ok(value) => {
                    let left = self.value(target)?;
                    self.equate(&left, &value)?;
                }
                Err(record) => self.equate_members(record, target)?,
            }
        }
        Ok(())
    }

    fn equate(&mut self, left: &Value, right: &Value) -> Result<()> {
        if left.dims != right.dims {
            let (left, right) = (describe_dims(&left.dims), describe_dims(&right.dims));
            let message = format!("the sides differ in size: left is {left}, right is {right}");
            return Err(self.problem(message));
        }
        self.charge(left.elements.len() as u64)?;
        for (offset, (&a, &b)) in left.elements.iter().zip(&right.elements).enumerate() {
            let (a, b) = a.with(b, self.graph).ok_or_else(|| {
                self.problem("an equation between a Boolean and a number")
                    .hint("write `if a then 1 else 0` for the number of a condition")
            })?;
            let is_array = !left.dims.is_empty();
            let element = is_array.then(|| element_name("", &left.dims, offset));
            self.equations.push(FlatEquation {
                left: a,
                right: b,
                span: self.at,
                element,
            });
        }
        Ok(())
    }

    /// A known condition takes its branch; otherwise the branches are joined equation by
    /// equation.
    fn choose(
        &mut self,
        branches: &'a [(ExprId, Vec<Equation>)],
        otherwise: &'a [Equation],
    ) -> Result<()> {
        let pairs = branches.iter().map(|(c, body)| (*c, body.as_slice()));
        let join = |evaluator: &mut Self, condition, yes: Vec<FlatEquation>, no: Vec<_>| {
            if yes.len() != no.len() {
                let (one, two) = (yes.len(), no.len());
                let message = format!("the branches have {one} and {two} equations");
                return Err(evaluator
                    .problem(message)
                    .hint("every branch, `else` included, needs the same number of equations"));
            }
            let pairs = yes.into_iter().zip(no);
            let join = |(yes, no)| evaluator.either(condition, yes, no);
            Ok(pairs.map(join).collect())
        };
        let joined = self.chosen(pairs, otherwise, Self::apart, join)?;
        self.charge(joined.len() as u64)?;
        self.equations.extend(joined);
        Ok(())
    }

    /// The equations of a branch by themselves.
    pub(super) fn apart(&mut self, body: &'a [Equation]) -> Result<Vec<FlatEquation>> {
        let outside = std::mem::take(&mut self.equations);
        let done = self.write_out(body);
        let inside = std::mem::replace(&mut self.equations, outside);
        done.map(|()| inside)
    }

    fn either(&self, condition: Node, yes: FlatEquation, no: FlatEquation) -> FlatEquation {
        let graph = self.graph;
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
