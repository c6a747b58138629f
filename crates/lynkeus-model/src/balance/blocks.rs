//! Solves the blocks of a sorted system one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Node, Unary};

use super::eliminate::{self, Core, Given};
use super::incidence::{Incidence, arguments};
use super::linear::Linear;
use super::matching::Matching;
use super::rows::{Row, Rows};
use super::{FlatEquation, System, Unknown};
use crate::limits::{Budget, MAX_COUPLED, MAX_SOLVE_STEPS};
use crate::syntax::{Problem, Result};

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
            let pairs: Vec<(&FlatEquation, &Unknown)> = block
                .iter()
                .filter_map(|&equation| {
                    let unknown = matching.of_equation.get(equation).copied().flatten()?;
                    Some((equations.get(equation)?, unknowns.get(unknown)?))
                })
                .collect();
            match pairs.as_slice() {
                [(equation, unknown)] => self.single(equation, unknown)?,
                _ => self.coupled(&pairs)?,
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

    fn single(&mut self, equation: &FlatEquation, unknown: &Unknown) -> Result<()> {
        let linear = self.linear();
        let left = linear.form(equation.left, unknown.symbol, equation.span)?;
        let right = linear.form(equation.right, unknown.symbol, equation.span)?;
        let solved = match (left, right) {
            (Some(left), Some(right)) => linear.solution(left, right),
            _ => None,
        };
        let value = solved.ok_or_else(|| not_linear(equation, unknown))?;
        let value = self.replace(value);
        self.solution.insert(unknown.symbol, value);
        Ok(())
    }

    /// Unknowns that need each other: what follows with a constant factor is taken out, the core
    /// is a system of linear equations.
    fn coupled(&mut self, pairs: &[(&FlatEquation, &Unknown)]) -> Result<()> {
        let core = self.core(pairs)?;
        if let Some((place, _)) = core.rows.iter().find(|(_, row)| row.len() == 0) {
            return Err(dependent(self.source, pairs, *place));
        }
        if core.rows.iter().any(|(_, row)| !row.nonlinear.is_empty()) {
            return Err(self.nonlinear(pairs, &core));
        }
        if core.columns.len() > MAX_COUPLED {
            return Err(too_many_coupled(pairs, core.columns.len()));
        }
        let values = self.linear_core(&core);
        for (&column, value) in core.columns.iter().zip(values) {
            self.solution.insert(pairs[column].1.symbol, value);
        }
        self.taken_out(pairs, &core.given);
        Ok(())
    }

    fn core(&self, pairs: &[(&FlatEquation, &Unknown)]) -> Result<Core> {
        let graph = self.system.graph;
        let symbols = pairs.iter().map(|(_, unknown)| unknown.symbol);
        let rows = Rows {
            linear: self.linear(),
            place: symbols
                .enumerate()
                .map(|(place, symbol)| (symbol, place))
                .collect(),
        };
        let row = |(equation, _): &(&FlatEquation, &Unknown)| {
            let residual = graph.binary(Binary::Sub, equation.left, equation.right);
            rows.row(residual, equation.span)
        };
        let found: Vec<Row> = pairs.iter().map(row).collect::<Result<_>>()?;
        let span = pairs.first().map(|(equation, _)| equation.span);
        eliminate::core(graph, &self.budget, span.unwrap_or_default(), found)
    }

    fn linear_core(&mut self, core: &Core) -> Vec<Node> {
        let graph = self.system.graph;
        let zero = graph.constant(0.0).node();
        let (mut matrix, mut right) = (vec![], vec![]);
        for (_, row) in &core.rows {
            for column in &core.columns {
                let coefficient = row.coefficients.get(column);
                matrix.push(coefficient.map_or(zero, |&node| self.replace(node)));
            }
            let rest = row.rest.map_or(zero, |node| self.replace(node));
            right.push(graph.unary(Unary::Neg, rest));
        }
        match (&matrix[..], &right[..]) {
            ([], []) => vec![],
            ([factor], [right]) => vec![graph.binary(Binary::Div, *right, *factor)],
            _ => graph.solve(&matrix, &right).x,
        }
    }

    /// The unknowns that were taken out, each behind those it needs.
    fn taken_out(&mut self, pairs: &[(&FlatEquation, &Unknown)], given: &[Given]) {
        let graph = self.system.graph;
        let of_symbol: HashMap<Node, usize> = given
            .iter()
            .enumerate()
            .map(|(place, g)| (pairs[g.column].1.symbol, place))
            .collect();
        let values: Vec<Node> = given
            .iter()
            .map(|given| self.value_of(pairs, given))
            .collect();
        let needs = |place: usize| -> Vec<usize> {
            let symbols = graph.symbols_of(&values[place..=place]);
            symbols
                .iter()
                .filter_map(|symbol| of_symbol.get(symbol).copied())
                .collect()
        };
        let mut done = vec![false; given.len()];
        let mut path: Vec<(usize, Vec<usize>)> = vec![];
        for root in (0..given.len()).rev() {
            if !std::mem::replace(&mut done[root], true) {
                path.push((root, needs(root)));
            }
            while let Some((place, open)) = path.last_mut() {
                if let Some(need) = open.pop() {
                    if !std::mem::replace(&mut done[need], true) {
                        path.push((need, needs(need)));
                    }
                    continue;
                }
                let (symbol, value) = (pairs[given[*place].column].1.symbol, values[*place]);
                let value = self.replace(value);
                self.solution.insert(symbol, value);
                path.pop();
            }
        }
    }

    /// −(rest + Σ coefficient · unknown) / factor
    fn value_of(&self, pairs: &[(&FlatEquation, &Unknown)], given: &Given) -> Node {
        let graph = self.system.graph;
        let mut sum = given.row.rest;
        for (&column, &coefficient) in &given.row.coefficients {
            if column != given.column {
                let term = graph.binary(Binary::Mul, coefficient, pairs[column].1.symbol);
                sum = Some(sum.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
            }
        }
        let Some(sum) = sum else {
            return graph.constant(0.0).node();
        };
        match given.factor {
            1.0 => graph.unary(Unary::Neg, sum),
            -1.0 => sum,
            factor => graph.binary(Binary::Div, sum, graph.constant(-factor).node()),
        }
    }

    /// A loop whose core is not linear.
    fn nonlinear(&self, pairs: &[(&FlatEquation, &Unknown)], core: &Core) -> Problem {
        let of_derivatives = pairs.iter().all(|(_, unknown)| unknown.state.is_some());
        let found = core
            .rows
            .iter()
            .find_map(|(place, row)| Some((*place, *row.nonlinear.first()?)));
        match found {
            Some((place, column)) if of_derivatives => not_linear(pairs[place].0, pairs[column].1),
            _ => self.algebraic_loop(pairs),
        }
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

    fn algebraic_loop(&self, pairs: &[(&FlatEquation, &Unknown)]) -> Problem {
        let names: Vec<String> = pairs
            .iter()
            .take(8)
            .map(|(_, unknown)| unknown.quoted())
            .collect();
        let more = if pairs.len() > 8 { ", …" } else { "" };
        let spans = pairs.iter().map(|(equation, _)| equation.span);
        let span = spans
            .clone()
            .min_by_key(|span| span.start)
            .unwrap_or_default();
        let lines = super::diagnose::lines(self.source, spans);
        let message = format!("algebraic loop: {}{more} need each other", names.join(", "));
        Problem::new(span, message)
            .label(format!("the equations of the loop are on {lines}"))
            .hint("solve them by hand, so that each variable follows from those before it")
    }
}

fn too_many_coupled(pairs: &[(&FlatEquation, &Unknown)], left: usize) -> Problem {
    let span = pairs
        .iter()
        .map(|(equation, _)| equation.span)
        .min_by_key(|span| span.start);
    let n = pairs.len();
    let message = format!(
        "{n} unknowns share their equations, {left} of them with factors that vary; at most \
         {MAX_COUPLED} may"
    );
    Problem::new(span.unwrap_or_default(), message)
        .hint("write the equations solved for their unknowns")
}

/// One equation of a linear loop follows from the others, or contradicts them.
fn dependent(source: &str, pairs: &[(&FlatEquation, &Unknown)], place: usize) -> Problem {
    let names: Vec<String> = pairs
        .iter()
        .take(8)
        .map(|(_, unknown)| unknown.quoted())
        .collect();
    let more = if pairs.len() > 8 { ", …" } else { "" };
    let spans = pairs.iter().map(|(equation, _)| equation.span);
    let lines = super::diagnose::lines(source, spans);
    let message = format!(
        "these equations do not determine {}{more}",
        names.join(", ")
    );
    Problem::new(pairs[place].0.span, message)
        .label(format!("this one repeats or contradicts others on {lines}"))
        .hint("a circuit without ground and a network without a fixed pressure look like this")
}

fn not_linear(equation: &FlatEquation, unknown: &Unknown) -> Problem {
    let element = equation
        .element
        .as_deref()
        .map(|element| format!(" (element {element})"));
    let message = format!(
        "this equation{} cannot be solved for {}: it is not linear in it",
        element.unwrap_or_default(),
        unknown.quoted()
    );
    Problem::new(equation.span, message).hint(format!("write it as {} = …", unknown.quoted()))
}
