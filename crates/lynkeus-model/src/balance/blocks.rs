//! Solves the blocks of a sorted system one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Implicit, ImplicitUnknown, Node, Unary};

use super::incidence::{Incidence, arguments};
use super::linear::{Form, Linear};
use super::loops::Torn;
use super::matching::Matching;
use super::{FlatEquation, System, Unknown, listed, singular};
use crate::limits::{Budget, MAX_COUPLED, MAX_SOLVE_STEPS};
use crate::syntax::{Problem, Result, Span};

pub(super) struct Solver<'a> {
    system: &'a System<'a>,
    incidence: &'a Incidence,
    source: &'a str,
    budget: Budget,
    /// every solved unknown
    solution: HashMap<Node, Node>,
    /// nodes with the unknowns in them replaced
    replaced: HashMap<Node, Node>,
}

impl<'a> Solver<'a> {
    pub(super) fn new(system: &'a System<'a>, incidence: &'a Incidence, source: &'a str) -> Self {
        let budget = Budget::new(MAX_SOLVE_STEPS, "steps to solve its equations");
        let (solution, replaced) = (HashMap::new(), HashMap::new());
        Self {
            system,
            incidence,
            source,
            budget,
            solution,
            replaced,
        }
    }

    pub(super) fn solve(
        mut self,
        blocks: &[Vec<usize>],
        matching: &Matching,
    ) -> Result<HashMap<Node, Node>> {
        let System {
            equations,
            unknowns,
            ..
        } = self.system;
        for block in blocks {
            let places: Vec<(usize, usize)> = block
                .iter()
                .filter_map(|&e| Some((e, matching.of_equation.get(e).copied().flatten()?)))
                .collect();
            let solved = match places[..] {
                [(equation, unknown)] => self.single(&equations[equation], &unknowns[unknown])?,
                _ => false,
            };
            if !solved {
                self.coupled(&places)?;
            }
        }
        Ok(self.solution)
    }

    fn linear(&self) -> Linear<'_> {
        let System { graph, .. } = self.system;
        Linear {
            graph,
            incidence: self.incidence,
            budget: &self.budget,
        }
    }

    /// Whether the equation is linear in the unknown, which is then solved.
    fn single(&mut self, equation: &FlatEquation, unknown: &Unknown) -> Result<bool> {
        let linear = self.linear();
        let left = linear.form(equation.left, unknown.symbol, equation.span)?;
        let right = linear.form(equation.right, unknown.symbol, equation.span)?;
        let (Some(left), Some(right)) = (left, right) else {
            return Ok(false);
        };
        let value = linear.solution(left, right);
        let value = value.ok_or_else(|| undetermined(equation, unknown))?;
        let value = self.replace(value);
        self.solution.insert(unknown.symbol, value);
        Ok(true)
    }

    /// Unknowns that share their equations: a linear system, or an implicit function.
    fn coupled(&mut self, block: &[(usize, usize)]) -> Result<()> {
        let torn = Torn::new(self.system, self.incidence, &self.linear(), block)?;
        let names: Vec<Node> = torn.unknowns.iter().map(|unknown| unknown.symbol).collect();
        if names.len() > MAX_COUPLED {
            return Err(self.too_many_coupled(block));
        }
        singular::check(self.system.graph, &torn, self.source)?;
        let roots = match self.rows(&torn, &names)? {
            Some(rows) => self.linear_roots(rows),
            None => self.nonlinear_roots(&torn)?,
        };
        self.solution.extend(names.into_iter().zip(roots));
        let (symbols, values): (Vec<Node>, Vec<Node>) = torn.explicit.into_iter().unzip();
        let values = self.system.graph.substitute(&values, &self.solution);
        self.solution.extend(symbols.into_iter().zip(values));
        Ok(())
    }

    /// Coefficients of the unknowns and the rest, of each residual; none where one is not
    /// linear.
    fn rows(&self, torn: &Torn<'_>, unknowns: &[Node]) -> Result<Option<Vec<Row>>> {
        let mut rows = vec![];
        for (residual, equation) in torn.residuals.iter().zip(&torn.equations) {
            match self.row(*residual, unknowns, equation.span)? {
                Some(row) => rows.push(row),
                None => return Ok(None),
            }
        }
        Ok(Some(rows))
    }

    fn row(&self, residual: Node, unknowns: &[Node], span: Span) -> Result<Option<Row>> {
        let linear = self.linear();
        let mut rest = Some(residual);
        let mut coefficients = vec![];
        for &unknown in unknowns {
            let form = match rest {
                Some(node) => linear.form(node, unknown, span)?,
                None => Some(Form::default()),
            };
            let Some(form) = form else {
                return Ok(None);
            };
            coefficients.push(form.coefficient);
            rest = form.rest;
        }
        for &coefficient in coefficients.iter().flatten() {
            let read = linear.below(coefficient, span)?;
            if read.iter().any(|node| unknowns.contains(node)) {
                return Ok(None);
            }
        }
        Ok(Some(Row { coefficients, rest }))
    }

    fn linear_roots(&mut self, rows: Vec<Row>) -> Vec<Node> {
        let graph = self.system.graph;
        let zero = graph.constant(0.0).node();
        let (mut matrix, mut right) = (vec![], vec![]);
        for Row { coefficients, rest } in rows {
            for coefficient in coefficients {
                matrix.push(coefficient.map_or(zero, |node| self.replace(node)));
            }
            let rest = rest.map_or(zero, |node| self.replace(node));
            right.push(graph.unary(Unary::Neg, rest));
        }
        match (&matrix[..], &right[..]) {
            (&[slope], &[right]) => vec![graph.binary(Binary::Div, right, slope)],
            _ => graph.solve(&matrix, &right).x,
        }
    }

    fn nonlinear_roots(&self, torn: &Torn<'_>) -> Result<Vec<Node>> {
        let graph = self.system.graph;
        let residuals = graph.substitute(&torn.residuals, &self.solution);
        let unknowns: Vec<ImplicitUnknown> = torn
            .unknowns
            .iter()
            .map(|unknown| ImplicitUnknown {
                symbol: unknown.symbol,
                start: unknown.start,
                range: unknown.range,
            })
            .collect();
        Implicit::solve(graph, &unknowns, &residuals).map_err(|error| {
            let span = torn.equations.first().map(|equation| equation.span);
            Problem::new(span.unwrap_or_default(), error.to_string())
        })
    }

    /// The expression with solved unknowns in place of their symbols.
    fn replace(&mut self, root: Node) -> Node {
        let mut stack = vec![root];
        while let Some(&node) = stack.last() {
            if self.replaced.contains_key(&node) {
                stack.pop();
                continue;
            }
            let open = arguments(self.system.graph.op(node))
                .filter(|argument| !self.replaced.contains_key(argument));
            let before = stack.len();
            if self.incidence.contains(node) {
                stack.extend(open);
            }
            if stack.len() == before {
                let new = self.rebuilt(node);
                self.replaced.insert(node, new);
                stack.pop();
            }
        }
        self.replaced.get(&root).copied().unwrap_or(root)
    }

    fn rebuilt(&self, node: Node) -> Node {
        let graph = self.system.graph;
        let new = |argument: Node| self.replaced.get(&argument).copied().unwrap_or(argument);
        if !self.incidence.contains(node) {
            return node;
        }
        match self.solution.get(&node) {
            Some(&value) => value,
            None => graph.rebuilt(graph, node, new).unwrap_or(node),
        }
    }

    fn too_many_coupled(&self, block: &[(usize, usize)]) -> Problem {
        let System {
            equations,
            unknowns,
            ..
        } = self.system;
        let spans = block.iter().map(|&(equation, _)| equations[equation].span);
        let span = spans.min_by_key(|span| span.start).unwrap_or_default();
        let message = format!(
            "{} unknowns need each other: {}; at most {MAX_COUPLED} may be left when equations \
             like `v = R*i` are used",
            block.len(),
            listed(block.iter().map(|&(_, unknown)| &unknowns[unknown])),
        );
        Problem::new(span, message)
            .hint("write more of the equations solved for a variable, as `a = …`")
    }
}

/// Σ coefficient·unknown + rest; `None` is zero.
struct Row {
    coefficients: Vec<Option<Node>>,
    rest: Option<Node>,
}

fn undetermined(equation: &FlatEquation, unknown: &Unknown) -> Problem {
    let element = equation
        .element
        .as_deref()
        .map(|element| format!(" (element {element})"));
    let message = format!(
        "this equation{} cannot be solved for {}: its terms in it cancel",
        element.unwrap_or_default(),
        unknown.quoted()
    );
    Problem::new(equation.span, message).hint(format!("write it as {} = …", unknown.quoted()))
}
