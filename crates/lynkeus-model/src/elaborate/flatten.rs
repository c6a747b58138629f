//! Equations of the text to scalar equations over the graph.

use lynkeus_expr::{Binary, Node};

use super::evaluate::Evaluator;
use super::scope::Mode;
use super::symbols::{Context, Symbols};
use super::value::{Scalar, Value, describe_dims, element_name};
use crate::balance::FlatEquation;
use crate::syntax::ast::{
    Causality, Declaration, Equation, EquationKind, ExprId, Iterator as Loop, ModelSyntax,
    Variability,
};
use crate::syntax::{Problem, Result, Span};

/// All scalar equations of a model, declaration equations first.
pub(super) fn flatten<'a>(
    context: &Context<'a>,
    symbols: &Symbols<'a>,
    model: &'a ModelSyntax,
) -> Result<Vec<FlatEquation>> {
    let evaluator = symbols.evaluator(context, Mode::Continuous);
    let mut flattener = Flattener {
        evaluator,
        equations: vec![],
    };
    for (declaration, component) in symbols.all() {
        if declaration.prefix.variability == Variability::Continuous
            && let Some(binding) = declaration.binding
        {
            let variable = Value::new(component.dims.clone(), component.elements.clone());
            flattener.declaration(context, declaration, variable, binding)?;
        }
    }
    flattener.all(&model.equations)?;
    Ok(flattener.equations)
}

struct Flattener<'a> {
    evaluator: Evaluator<'a>,
    equations: Vec<FlatEquation>,
}

impl<'a> Flattener<'a> {
    fn declaration(
        &mut self,
        context: &Context<'_>,
        declaration: &Declaration,
        variable: Value,
        binding: ExprId,
    ) -> Result<()> {
        let name = declaration.name.text(context.source);
        let span = declaration.name.to(self.evaluator.span(binding));
        if declaration.prefix.causality == Causality::Input {
            let message = format!("input `{name}` must not have an equation");
            return Err(Problem::new(span, message)
                .hint("give a starting value with `start = …`, or make it a parameter"));
        }
        let value = self.evaluator.value(binding)?;
        if variable.dims() != value.dims() {
            let (has, found) = (describe_dims(variable.dims()), describe_dims(value.dims()));
            let message = format!("`{name}` has the size {has}, its value has {found}");
            return Err(Problem::new(self.evaluator.span(binding), message));
        }
        self.equate(variable, value, span)
    }

    fn all(&mut self, equations: &'a [Equation]) -> Result<()> {
        equations.iter().try_for_each(|equation| self.one(equation))
    }

    fn one(&mut self, equation: &'a Equation) -> Result<()> {
        self.evaluator.budget.charge(1, equation.span)?;
        match &equation.kind {
            EquationKind::Equality(left, right) => {
                let (left, right) = (self.evaluator.value(*left)?, self.evaluator.value(*right)?);
                self.equate(left, right, equation.span)
            }
            EquationKind::For(iterators, body) => self.repeat(iterators, body),
            EquationKind::If(branches, otherwise) => {
                self.choose(branches, otherwise, equation.span)
            }
        }
    }

    fn repeat(&mut self, iterators: &'a [Loop], body: &'a [Equation]) -> Result<()> {
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
            let (a, b) = (self.side(a, span)?, self.side(b, span)?);
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
            Problem::new(span, "an equation between Booleans is not supported")
                .hint("use Real variables and `if` expressions")
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
        let mut open = vec![];
        let mut last = otherwise;
        for (condition, body) in branches {
            let node = self.evaluator.condition(*condition)?;
            match self.evaluator.graph.constant_value(node) {
                Some(0.0) => {}
                Some(_) => {
                    last = body;
                    break;
                }
                None => open.push((node, body)),
            }
        }
        let mut joined = self.apart(last)?;
        for (condition, body) in open.into_iter().rev() {
            let branch = self.apart(body)?;
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
        self.evaluator.budget.charge(joined.len() as u64, span)?;
        self.equations.extend(joined);
        Ok(())
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
