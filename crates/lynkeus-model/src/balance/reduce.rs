//! States that follow from other states: constraints are differentiated and a state is given up.
//!
//! An equation whose variables are all known already is a constraint on the states, as where
//! two shafts are joined. Pantelides' algorithm finds the equations that make it; these are
//! differentiated, and one state of each set becomes a variable that follows from the others
//! (a dummy derivative). It is one that stands in its equation with a constant factor, so that
//! the choice is good everywhere.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Node, jacobian};

use super::diagnose::reached;
use super::matching;
use super::matching::Matching;
use super::system::{FlatEquation, Incidence, System, Unknown};
use crate::diagnostic::{Problem, Result};

/// Most times that constraints are looked for.
const MAX_PASSES: usize = 60;

/// The system without constraints among its states; `None` where it has none, or where they
/// cannot be resolved.
pub(super) fn reduced<'a>(system: &'a System<'a>) -> Result<Option<Reduction<'a>>> {
    let states = system
        .unknowns
        .iter()
        .filter_map(|u| Some((u.state?, u.symbol)));
    let mut reduction = Reduction {
        system,
        derivative: states.collect(),
        equations: system.equations.to_vec(),
        unknowns: system.unknowns.to_vec(),
        differentiated: HashSet::new(),
    };
    for _ in 0..MAX_PASSES {
        let constraints = reduction.constraints();
        if constraints.is_empty() {
            return Ok(Some(reduction));
        }
        let mut is_stuck = true;
        for (equations, unknowns) in constraints {
            is_stuck &= !reduction.resolve(&equations, &unknowns)?;
        }
        if is_stuck {
            break;
        }
    }
    Ok(None)
}

/// Equations and unknowns in which constraints are differentiated.
pub(super) struct Reduction<'a> {
    system: &'a System<'a>,
    /// symbols of derivatives by what they are the derivatives of
    derivative: HashMap<Node, Node>,
    pub equations: Vec<FlatEquation>,
    pub unknowns: Vec<Unknown>,
    /// equations whose derivative is among the equations
    differentiated: HashSet<usize>,
}

impl Reduction<'_> {
    /// Sets of equations with fewer unknowns than equations, each with the places of these
    /// unknowns; none where every equation has its unknown.
    fn constraints(&self) -> Vec<(Vec<usize>, Vec<usize>)> {
        let System {
            graph,
            inputs,
            time,
            ..
        } = *self.system;
        let now = System {
            graph,
            equations: &self.equations,
            unknowns: &self.unknowns,
            inputs,
            time,
        };
        let incidence = Incidence::new(&now);
        let matching = matching::maximum(&now, &incidence.of_equation);
        let mut used: HashSet<usize> = HashSet::new();
        let mut found = vec![];
        for start in free(&matching) {
            let (equations, unknowns) =
                reached(start, &incidence.of_equation, &matching.of_unknown);
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
            let equation = self.equations[place].clone();
            let left = self.total(equation.left, &equation)?;
            let right = self.total(equation.right, &equation)?;
            self.equations.push(FlatEquation {
                left,
                right,
                ..equation
            });
        }
        let Some(place) = self.unknowns.iter().position(|u| u.state == Some(given_up)) else {
            return Ok(false);
        };
        let state = self.unknowns[place].clone();
        self.unknowns[place].state = None;
        self.unknowns[place].name = format!("der({})", state.name);
        self.unknowns.push(Unknown {
            symbol: given_up,
            state: None,
            ..state
        });
        Ok(true)
    }

    /// The derivative of an unknown becomes an unknown as well.
    fn differentiated_unknown(&mut self, place: usize) {
        let unknown = self.unknowns[place].clone();
        if self.derivative.contains_key(&unknown.symbol) {
            return;
        }
        let name = match unknown.state {
            Some(_) => format!("der(der({}))", unknown.name),
            None => format!("der({})", unknown.name),
        };
        let symbol = self.system.graph.fresh(name.clone()).node();
        self.derivative.insert(unknown.symbol, symbol);
        self.unknowns.push(Unknown {
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
        let states: HashMap<Node, (i32, usize)> = self
            .unknowns
            .iter()
            .enumerate()
            .filter_map(|(place, u)| Some((u.state?, (u.rank, usize::MAX - place))))
            .collect();
        let mut best: Option<((i32, usize), Node)> = None;
        for &place in equations {
            let equation = &self.equations[place];
            let residual = graph.binary(Binary::Sub, equation.left, equation.right);
            let symbols = graph.symbols_of(&[residual]);
            let symbols: Vec<Node> = symbols
                .into_iter()
                .filter(|symbol| states.contains_key(symbol))
                .collect();
            let slopes = jacobian::reverse(graph, &[residual], &symbols);
            for (column, slope) in slopes.row(0) {
                let is_constant = graph
                    .constant_value(slope)
                    .is_some_and(|value| value != 0.0);
                let state = symbols[column];
                let key = states[&state];
                if is_constant && best.is_none_or(|(least, _)| key < least) {
                    best = Some((key, state));
                }
            }
        }
        best.map(|(_, state)| state)
    }

    /// The derivative in time of one side of an equation.
    fn total(&self, side: Node, equation: &FlatEquation) -> Result<Node> {
        let graph = self.system.graph;
        let symbols = graph.symbols_of(&[side]);
        let slopes = jacobian::reverse(graph, &[side], &symbols);
        let mut sum: Option<Node> = None;
        for (column, slope) in slopes.row(0) {
            let symbol = symbols[column];
            if self.system.inputs.contains(&symbol) {
                return Err(self.input_bound(symbol, equation));
            }
            let term = match self.derivative.get(&symbol) {
                Some(&derivative) => graph.binary(Binary::Mul, slope, derivative),
                None if symbol == self.system.time => slope,
                None => continue,
            };
            sum = Some(sum.map_or(term, |sum| graph.binary(Binary::Add, sum, term)));
        }
        Ok(sum.unwrap_or_else(|| graph.constant(0.0).node()))
    }

    fn input_bound(&self, input: Node, equation: &FlatEquation) -> Box<Problem> {
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

fn free(matching: &Matching) -> Vec<usize> {
    let partners = matching.of_equation.iter().enumerate();
    partners
        .filter(|(_, partner)| partner.is_none())
        .map(|(place, _)| place)
        .collect()
}
