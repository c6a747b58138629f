//! Solves the blocks of a sorted system one after the other.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Node, Unary};

use super::incidence::{Incidence, arguments};
use super::linear::{Form, Linear};
use super::matching::Matching;
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

    /// Derivatives that share their equations linearly: a mass matrix.
    fn coupled(&mut self, pairs: &[(&FlatEquation, &Unknown)]) -> Result<()> {
        if pairs.iter().any(|(_, unknown)| unknown.state.is_none()) {
            return Err(self.algebraic_loop(pairs));
        }
        if pairs.len() > MAX_COUPLED {
            return Err(too_many_coupled(pairs));
        }
        let zero = self.system.graph.constant(0.0).node();
        let (mut matrix, mut right) = (vec![], vec![]);
        for (equation, _) in pairs {
            let (row, rest) = self.row(equation, pairs)?;
            for coefficient in row {
                matrix.push(coefficient.map_or(zero, |node| self.replace(node)));
            }
            let rest = rest.map_or(zero, |node| self.replace(node));
            let negated = self.system.graph.unary(Unary::Neg, rest);
            right.push(negated);
        }
        let solved = self.system.graph.solve(&matrix, &right);
        for ((_, unknown), value) in pairs.iter().zip(solved.x) {
            self.solution.insert(unknown.symbol, value);
        }
        Ok(())
    }

    /// Coefficients of the unknowns and the rest, of left − right.
    fn row(
        &self,
        equation: &FlatEquation,
        pairs: &[(&FlatEquation, &Unknown)],
    ) -> Result<(Vec<Option<Node>>, Option<Node>)> {
        let linear = self.linear();
        let graph = self.system.graph;
        let mut rest = Some(graph.binary(Binary::Sub, equation.left, equation.right));
        let mut row = vec![];
        for (_, unknown) in pairs {
            let form = match rest {
                Some(node) => linear.form(node, unknown.symbol, equation.span)?,
                None => Some(Form::default()),
            };
            let form = form.ok_or_else(|| not_linear(equation, unknown))?;
            row.push(form.coefficient);
            rest = form.rest;
        }
        let symbols: HashSet<Node> = pairs.iter().map(|(_, unknown)| unknown.symbol).collect();
        for (coefficient, (_, unknown)) in row.iter().zip(pairs) {
            let Some(coefficient) = *coefficient else {
                continue;
            };
            let read = linear.below(coefficient, equation.span)?;
            if read.iter().any(|node| symbols.contains(node)) {
                return Err(not_linear(equation, unknown));
            }
        }
        Ok((row, rest))
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

fn too_many_coupled(pairs: &[(&FlatEquation, &Unknown)]) -> Problem {
    let span = pairs
        .iter()
        .map(|(equation, _)| equation.span)
        .min_by_key(|span| span.start);
    let n = pairs.len();
    let message = format!("{n} derivatives share their equations; at most {MAX_COUPLED} may");
    Problem::new(span.unwrap_or_default(), message)
        .hint("write the equations solved for their derivatives")
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
