//! States that follow from other states: constraints are differentiated and a state is given up.
//!
//! An equation whose variables are all known already is a constraint on the states, as where
//! two shafts are joined. Pantelides' algorithm finds the equations that make it; these are
//! differentiated, and one state of each set becomes a variable that follows from the others
//! (a dummy derivative). It is one that stands in its equation with a constant factor, so that
//! the choice is good everywhere.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, jacobian};

use super::diagnose::reached;
use super::system::{FlatEquation, System, Unknown};
use crate::diagnostic::{Problem, Result};

/// Most times that constraints are looked for.
const MAX_PASSES: usize = 60;

/// The system without constraints among its states; `None` where it has none, or where they
/// cannot be resolved.
pub(super) fn reduced(system: System<'_>) -> Result<Option<System<'_>>> {
    let states = system.unknowns.iter();
    let states = states.filter_map(|u| Some((u.state?, u.symbol)));
    let mut reduction = Reduction {
        derivative: states.collect(),
        system,
        differentiated: HashSet::new(),
    };
    for _ in 0..MAX_PASSES {
        let constraints = reduction.constraints();
        if constraints.is_empty() {
            return Ok(Some(reduction.system));
        }
        let mut is_stuck = true;
        for (equations, unknowns) in constraints {
            is_stuck &= !reduction.resolve(&equations, &unknowns)?;
        }
        if is_stuck {
            break;
        }
        reduction.system.arrange();
    }
    Ok(None)
}

/// A system in which constraints are differentiated.
struct Reduction<'a> {
    system: System<'a>,
    /// symbols of derivatives by what they are the derivatives of
    derivative: HashMap<Node, Node>,
    /// equations whose derivative is among the equations
    differentiated: HashSet<usize>,
}

impl Reduction<'_> {
    /// Sets of equations with fewer unknowns than equations, each with the places of these
    /// unknowns; none where every equation has its unknown.
    fn constraints(&self) -> Vec<(Vec<usize>, Vec<usize>)> {
        let System {
            pattern, matching, ..
        } = &self.system;
        let mut used: HashSet<usize> = HashSet::new();
        let mut found = vec![];
        for start in 0..pattern.len() {
            if matching.of_equation[start].is_some() {
                continue;
            }
            let (equations, unknowns) = reached(start, pattern, &matching.of_unknown);
            if equations.iter().any(|equation| used.contains(equation)) {
                continue;
            }
            used.extend(&equations);
            found.push((equations, unknowns));
        }
        found
    }

    /// Differentiates a set of equations and gives up one of its states.
    fn resolve(&mut self, equations: &[usize], unknowns: &[usize]) -> Result<bool> {
        let Some(given_up) = self.candidate(equations) else {
            return Ok(false);
        };
        for &place in unknowns {
            self.differentiated_unknown(place);
        }
        for &place in equations {
            if !self.differentiated.insert(place) {
                continue;
            }
            let equation = self.system.equations[place].clone();
            let left = self.total(equation.left, &equation)?;
            let right = self.total(equation.right, &equation)?;
            self.system.equations.push(FlatEquation {
                left,
                right,
                ..equation
            });
        }
        let unknowns = &mut self.system.unknowns;
        let Some(place) = unknowns.iter().position(|u| u.state == Some(given_up)) else {
            return Ok(false);
        };
        let state = unknowns[place].clone();
        unknowns[place].state = None;
        unknowns[place].name = format!("der({})", state.name);
        unknowns.push(Unknown {
            symbol: given_up,
            state: None,
            ..state
        });
        Ok(true)
    }

    /// The derivative of an unknown becomes an unknown as well.
    fn differentiated_unknown(&mut self, place: usize) {
        let unknown = self.system.unknowns[place].clone();
        if self.derivative.contains_key(&unknown.symbol) {
            return;
        }
        let name = match unknown.state {
            Some(_) => format!("der(der({}))", unknown.name),
            None => format!("der({})", unknown.name),
        };
        let symbol = self.system.graph.fresh(name.clone()).node();
        self.derivative.insert(unknown.symbol, symbol);
        self.system.unknowns.push(Unknown {
            symbol,
            name,
            state: None,
            ..unknown
        });
    }

    /// The state that is wanted least among those that an equation gives with a constant
    /// factor.
    fn candidate(&self, equations: &[usize]) -> Option<Node> {
        let graph = self.system.graph;
        let unknowns = self.system.unknowns.iter().enumerate();
        let states: HashMap<Node, (i32, usize)> = unknowns
            .filter_map(|(place, u)| Some((u.state?, (u.rank, usize::MAX - place))))
            .collect();
        let mut best: Option<((i32, usize), Node)> = None;
        for &place in equations {
            let equation = &self.system.equations[place];
            let residual = graph.binary(Binary::Sub, equation.left, equation.right);
            let mut symbols = graph.symbols_of(&[residual]);
            symbols.retain(|symbol| states.contains_key(symbol));
            for (state, slope) in jacobian::gradient(graph, residual, &symbols) {
                let (slope, key) = (graph.constant_value(slope), states[&state]);
                if slope.is_some_and(|value| value != 0.0)
                    && best.is_none_or(|(least, _)| key < least)
                {
                    best = Some((key, state));
                }
            }
        }
        best.map(|(_, state)| state)
    }

    /// The derivative in time of one side of an equation.
    fn total(&self, side: Node, equation: &FlatEquation) -> Result<Node> {
        let System {
            graph,
            time,
            inputs,
            ..
        } = self.system;
        total_derivative(graph, side, time, |symbol| match inputs.contains(&symbol) {
            true => Err(self.input_bound(symbol, equation)),
            false => Ok(self.derivative.get(&symbol).copied()),
        })
    }

    fn input_bound(&self, input: Node, equation: &FlatEquation) -> Problem {
        let name = self.system.graph.symbol_name(input).unwrap_or_default();
        let message = format!("this equation binds states to the input `{name}`");
        Problem::new(equation.span, message)
            .label("its derivative in time would be needed (index above 1)")
            .hint(format!(
                "make `{name}` a state of a model of its own, or add what lies between it and \
                 the states, such as a spring or a lag"
            ))
    }
}

/// Σ ∂e/∂s der(s) over the symbols of an expression that have a derivative, and ∂e/∂t.
pub(crate) fn total_derivative(
    graph: &Graph,
    expression: Node,
    time: Node,
    derivative: impl Fn(Node) -> Result<Option<Node>>,
) -> Result<Node> {
    let symbols = graph.symbols_of(&[expression]);
    let mut sum: Option<Node> = None;
    for (symbol, slope) in jacobian::gradient(graph, expression, &symbols) {
        let term = match derivative(symbol)? {
            Some(derivative) => graph.binary(Binary::Mul, slope, derivative),
            None if symbol == time => slope,
            None => continue,
        };
        sum = Some(sum.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
    }
    Ok(sum.unwrap_or_else(|| graph.constant(0.0).node()))
}
