//! Solves the blocks of a sorted system one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Implicit, ImplicitUnknown, Node, Unary};

use super::linear::{Core, Given, Linear, Row, core};
use super::loops::{Torn, check_regular};
use super::matching::Matching;
use super::system::{FlatEquation, Incidence, System, Unknown, arguments, lines, listed};
use crate::diagnostic::{Problem, Result};
use crate::limits::{Budget, MAX_COUPLED, MAX_SOLVE_STEPS};

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

    /// Unknowns that need each other: what follows with a constant factor is taken out, the core
    /// is a system of linear equations; where it is not, it is an implicit function.
    fn coupled(&mut self, block: &[(usize, usize)]) -> Result<()> {
        let System {
            equations,
            unknowns,
            ..
        } = self.system;
        let pairs: Vec<(&FlatEquation, &Unknown)> = block
            .iter()
            .map(|&(equation, unknown)| (&equations[equation], &unknowns[unknown]))
            .collect();
        let Some(rows) = self.rows(&pairs)? else {
            return self.implicit(block);
        };
        let span = pairs.first().map(|(equation, _)| equation.span);
        let graph = self.system.graph;
        let core = core(graph, &self.budget, span.unwrap_or_default(), rows)?;
        if let Some((place, _)) = core.rows.iter().find(|(_, row)| row.len() == 0) {
            return Err(dependent(self.source, &pairs, *place));
        }
        if core.columns.len() > MAX_COUPLED {
            return Err(too_many_coupled(&pairs, core.columns.len()));
        }
        let values = self.linear_core(&core);
        for (&column, value) in core.columns.iter().zip(values) {
            self.solution.insert(pairs[column].1.symbol, value);
        }
        self.taken_out(&pairs, &core.given);
        Ok(())
    }

    /// A loop that is not linear, torn: the roots of what is left, and what follows from them.
    fn implicit(&mut self, block: &[(usize, usize)]) -> Result<()> {
        let torn = Torn::new(self.system, self.incidence, &self.linear(), block)?;
        if torn.unknowns.len() > MAX_COUPLED {
            return Err(self.too_many_torn(block));
        }
        check_regular(self.system.graph, &torn, self.source)?;
        let roots = self.roots(&torn)?;
        let symbols = torn.unknowns.iter().map(|unknown| unknown.symbol);
        self.solution.extend(symbols.zip(roots));
        let (symbols, values): (Vec<Node>, Vec<Node>) = torn.explicit.into_iter().unzip();
        let values = self.system.graph.substitute(&values, &self.solution);
        self.solution.extend(symbols.into_iter().zip(values));
        Ok(())
    }

    fn roots(&self, torn: &Torn<'_>) -> Result<Vec<Node>> {
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

    /// The equations as rows; none where one of them is not linear.
    fn rows(&self, pairs: &[(&FlatEquation, &Unknown)]) -> Result<Option<Vec<Row>>> {
        let graph = self.system.graph;
        let symbols = pairs.iter().map(|(_, unknown)| unknown.symbol);
        let places = symbols.enumerate().map(|(place, symbol)| (symbol, place));
        let (linear, places) = (self.linear(), places.collect());
        let row = |(equation, _): &(&FlatEquation, &Unknown)| {
            let residual = graph.binary(Binary::Sub, equation.left, equation.right);
            linear.row(residual, &places, equation.span)
        };
        pairs.iter().map(row).collect()
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
        let of_column: HashMap<usize, usize> = given
            .iter()
            .enumerate()
            .map(|(place, g)| (g.column, place))
            .collect();
        let values: Vec<Node> = given
            .iter()
            .map(|given| self.value_of(pairs, given))
            .collect();
        let needs = |place: usize| -> Vec<usize> {
            let Given { column, row, .. } = &given[place];
            let others = row.coefficients.keys().filter(|&other| other != column);
            others
                .filter_map(|other| of_column.get(other).copied())
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

    fn too_many_torn(&self, block: &[(usize, usize)]) -> Box<Problem> {
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

fn too_many_coupled(pairs: &[(&FlatEquation, &Unknown)], left: usize) -> Box<Problem> {
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
fn dependent(source: &str, pairs: &[(&FlatEquation, &Unknown)], place: usize) -> Box<Problem> {
    let names = listed(pairs.iter().map(|(_, unknown)| *unknown));
    let spans = pairs.iter().map(|(equation, _)| equation.span);
    let lines = lines(source, spans);
    let message = format!("these equations do not determine {names}");
    Problem::new(pairs[place].0.span, message)
        .label(format!("this one repeats or contradicts others on {lines}"))
        .hint(
            "a circuit without ground and a network without a fixed pressure look like this, and a \
             constraint between states that is hidden in the loop (index above 1): leave one \
             equation out, or replace it by its derivative with respect to time",
        )
}

fn undetermined(equation: &FlatEquation, unknown: &Unknown) -> Box<Problem> {
    let message = format!(
        "this equation{} cannot be solved for {}: its terms in it cancel",
        equation.which_element(),
        unknown.quoted()
    );
    Problem::new(equation.span, message).hint(format!("write it as {} = …", unknown.quoted()))
}
