//! Solves the blocks of a sorted system one after the other.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Implicit, ImplicitUnknown, Node, Unary, components};

use super::linear::{Elimination, Given, Row};
use super::loops::Torn;
use super::system::{FlatEquation, System, Unknown, arguments};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::MAX_COUPLED;

/// Solves blocks of equations that need each other, each behind those it needs.
pub(super) fn solve(system: &System<'_>) -> Result<HashMap<Node, Node>> {
    let mut solver = Solver {
        system,
        solution: HashMap::new(),
        replaced: HashMap::new(),
    };
    // an equation needs those that give its unknowns
    let given_by = |&unknown: &usize| system.matching.of_unknown[unknown];
    let needs = |unknowns: &Vec<usize>| unknowns.iter().filter_map(given_by).collect();
    let needs: Vec<Vec<usize>> = system.pattern.iter().map(needs).collect();
    for block in components(&needs) {
        let pair = |equation| Some((equation, system.matching.of_equation[equation]?));
        solver.block(&block.into_iter().filter_map(pair).collect::<Vec<_>>())?;
    }
    Ok(solver.solution)
}

struct Solver<'a> {
    system: &'a System<'a>,
    /// every solved unknown
    solution: HashMap<Node, Node>,
    /// nodes with the unknowns in them replaced
    replaced: HashMap<Node, Node>,
}

/// A block is given as its pairs of equation and unknown, by their places.
impl Solver<'_> {
    fn block(&mut self, block: &[(usize, usize)]) -> Result<()> {
        if let &[(equation, unknown)] = block
            && self.single(
                &self.system.equations[equation],
                &self.system.unknowns[unknown],
            )?
        {
            return Ok(());
        }
        self.coupled(block)
    }

    /// Whether the equation is linear in the unknown, which is then solved.
    fn single(&mut self, equation: &FlatEquation, unknown: &Unknown) -> Result<bool> {
        let Some(sides) = self.system.sides(equation, unknown.symbol)? else {
            return Ok(false);
        };
        let value = self.system.solution(sides);
        let value = value.ok_or_else(|| undetermined(equation, unknown))?;
        let value = self.replace(value);
        self.solution.insert(unknown.symbol, value);
        Ok(true)
    }

    /// Unknowns that need each other: what follows with a constant factor is taken out, the core
    /// is a system of linear equations; where it is not, it is an implicit function.
    fn coupled(&mut self, block: &[(usize, usize)]) -> Result<()> {
        let Some(rows) = self.rows(block)? else {
            return self.implicit(block);
        };
        let span = block.first().map(|pair| self.system.equations[pair.0].span);
        let elimination = Elimination::new(self.system, span.unwrap_or_default(), rows)?;
        let mut left = elimination.left();
        if let Some((place, _)) = left.find(|(_, row)| row.coefficients.is_empty()) {
            return Err(self.dependent(block, place));
        }
        let columns = elimination.columns();
        if columns.len() > MAX_COUPLED {
            return Err(self.too_many_coupled(block, columns.len()));
        }
        let values = self.linear_core(&elimination, &columns);
        let system = self.system;
        let symbol = |column: usize| system.unknowns[block[column].1].symbol;
        let symbols = columns.iter().map(|&column| symbol(column));
        self.solution.extend(symbols.zip(values));
        let value = |given: &Given| (symbol(given.column), self.value_of(given, symbol));
        let values: Vec<(Node, Node)> = elimination.given.iter().map(value).collect();
        // each is made of those that were taken out later
        for (symbol, value) in values.into_iter().rev() {
            let value = self.replace(value);
            self.solution.insert(symbol, value);
        }
        Ok(())
    }

    /// A loop that is not linear, torn: the roots of what is left, and what follows from them.
    fn implicit(&mut self, block: &[(usize, usize)]) -> Result<()> {
        let torn = Torn::new(self.system, block)?;
        if torn.unknowns.len() > MAX_COUPLED {
            return Err(self.too_many_torn(block));
        }
        torn.check_regular()?;
        let roots = self.roots(&torn)?;
        let symbols = torn.unknowns().map(|unknown| unknown.symbol);
        self.solution.extend(symbols.zip(roots));
        let (symbols, values): (Vec<Node>, Vec<Node>) = torn.explicit.into_iter().unzip();
        let values = self.system.graph.substitute(&values, &self.solution);
        self.solution.extend(symbols.into_iter().zip(values));
        Ok(())
    }

    fn roots(&self, torn: &Torn<'_>) -> Result<Vec<Node>> {
        let graph = self.system.graph;
        let residuals = graph.substitute(&torn.residuals, &self.solution);
        let unknown = |unknown: &Unknown| ImplicitUnknown {
            symbol: unknown.symbol,
            start: unknown.start,
            range: unknown.range,
        };
        let unknowns: Vec<ImplicitUnknown> = torn.unknowns().map(unknown).collect();
        Implicit::solve(graph, &unknowns, &residuals).map_err(|error| {
            let first = torn.equations.first();
            let span = first.map(|&place| self.system.equations[place].span);
            Problem::new(span.unwrap_or_default(), error.to_string())
        })
    }

    /// The equations as rows; none where one of them is not linear.
    fn rows(&self, block: &[(usize, usize)]) -> Result<Option<Vec<Row>>> {
        let System {
            graph,
            equations,
            unknowns,
            ..
        } = self.system;
        let symbols = block.iter().map(|&(_, unknown)| unknowns[unknown].symbol);
        let places = symbols.zip(0..).collect();
        let row = |&(equation, _): &(usize, usize)| {
            let FlatEquation {
                left, right, span, ..
            } = equations[equation];
            let residual = graph.binary(Binary::Sub, left, right);
            self.system.row(residual, &places, span)
        };
        block.iter().map(row).collect()
    }

    fn linear_core(&mut self, elimination: &Elimination<'_>, columns: &[usize]) -> Vec<Node> {
        let graph = self.system.graph;
        let zero = graph.constant(0.0).node();
        let (mut matrix, mut right) = (vec![], vec![]);
        for (_, row) in elimination.left() {
            for column in columns {
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

    /// −(rest + Σ coefficient · unknown) / factor
    fn value_of(&self, given: &Given, symbol: impl Fn(usize) -> Node) -> Node {
        let graph = self.system.graph;
        let mut sum = given.row.rest;
        for (&column, &coefficient) in &given.row.coefficients {
            if column != given.column {
                let term = graph.binary(Binary::Mul, coefficient, symbol(column));
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
            if self.system.contains(node) {
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
        if !self.system.contains(node) {
            return node;
        }
        match self.solution.get(&node) {
            Some(&value) => value,
            None => graph.rebuilt(graph, node, new).unwrap_or(node),
        }
    }

    fn too_many_torn(&self, block: &[(usize, usize)]) -> Box<Problem> {
        let message = format!(
            "{} unknowns need each other: {}; at most {MAX_COUPLED} may be left when equations \
             like `v = R*i` are used",
            block.len(),
            self.system.listed(block.iter().map(|pair| pair.1)),
        );
        Problem::new(self.first_span(block), message)
            .hint("write more of the equations solved for a variable, as `a = …`")
    }

    fn too_many_coupled(&self, block: &[(usize, usize)], left: usize) -> Box<Problem> {
        let n = block.len();
        let message = format!(
            "{n} unknowns share their equations, {left} of them with factors that vary; at most \
             {MAX_COUPLED} may"
        );
        Problem::new(self.first_span(block), message)
            .hint("write the equations solved for their unknowns")
    }

    fn first_span(&self, block: &[(usize, usize)]) -> Span {
        let spans = block.iter().map(|pair| self.system.equations[pair.0].span);
        spans.min_by_key(|span| span.start).unwrap_or_default()
    }

    /// One equation of a linear loop follows from the others, or contradicts them.
    fn dependent(&self, block: &[(usize, usize)], place: usize) -> Box<Problem> {
        let names = self.system.listed(block.iter().map(|pair| pair.1));
        let lines = self.system.lines(block.iter().map(|pair| pair.0));
        let message = format!("these equations do not determine {names}");
        Problem::new(self.system.equations[block[place].0].span, message)
            .label(format!("this one repeats or contradicts others on {lines}"))
            .hint(
                "a circuit without ground and a network without a fixed pressure look like this, \
                 and a constraint between states that is hidden in the loop (index above 1): \
                 leave one equation out, or replace it by its derivative with respect to time",
            )
    }
}

fn undetermined(equation: &FlatEquation, unknown: &Unknown) -> Box<Problem> {
    let message = format!(
        "this equation{} cannot be solved for {}: its terms in it cancel",
        equation.which_element(),
        unknown.quoted()
    );
    Problem::new(equation.span, message).hint(format!("write it as {} = …", unknown.quoted()))
}
