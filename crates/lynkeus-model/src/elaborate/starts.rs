//! Start values from the section `initial equation`.

use std::collections::HashMap;

use lynkeus_expr::{Binary, Graph, Node, Tape, Unary, jacobian};

use super::flatten::Flat;
use super::symbols::Symbols;
use crate::Variable;
use crate::balance::FlatEquation;
use crate::syntax::{Problem, Span};

/// Sets the start of each state that an initial equation fixes; a warning for every other.
pub(super) fn fix<'a>(
    graph: &Graph,
    symbols: &Symbols<'a>,
    flat: &Flat,
    solution: &HashMap<Node, Node>,
    states: &mut [Variable],
) -> Vec<Problem> {
    let mut at_start = solution.clone();
    at_start.insert(symbols.time, graph.constant(0.0).node());
    let by_symbol: HashMap<Node, usize> = states
        .iter()
        .enumerate()
        .map(|(place, state)| (state.node, place))
        .collect();
    let starts = Starts {
        graph,
        values: symbols.parameter_values(),
        by_symbol,
    };
    let mut warnings: Vec<Problem> = flat
        .initial_unread
        .iter()
        .map(|&span| unread(span))
        .collect();
    for equation in &flat.initial {
        let sides = graph.substitute(&[equation.left, equation.right], &at_start);
        let [left, right] = sides[..] else {
            continue;
        };
        let found = starts
            .explicit(left, right)
            .or_else(|| starts.explicit(right, left));
        let found = found.or_else(|| starts.solved(graph.binary(Binary::Sub, left, right)));
        match found {
            Some((place, node, value)) if place < states.len() => {
                let state = &mut states[place];
                state.start = value;
                state.start_node = (!graph.symbols_of(&[node]).is_empty()).then_some(node);
                state.fixed = true;
            }
            _ => warnings.push(does_not_fix(equation)),
        }
    }
    warnings
}

struct Starts<'g> {
    graph: &'g Graph,
    /// values of the parameters that are symbols, where they have one
    values: HashMap<Node, Option<f64>>,
    by_symbol: HashMap<Node, usize>,
}

impl Starts<'_> {
    /// `x = e` with e free of variables.
    fn explicit(&self, state: Node, start: Node) -> Option<(usize, Node, Option<f64>)> {
        let place = *self.by_symbol.get(&state)?;
        let symbols = self.graph.symbols_of(&[start]);
        let known = symbols
            .iter()
            .all(|symbol| self.values.contains_key(symbol));
        let value = self.number(start);
        (known && (value.is_some() || !symbols.is_empty())).then_some((place, start, value))
    }

    /// The state that a residual fixes, with its start as an expression of the parameters and
    /// as a number.
    fn solved(&self, residual: Node) -> Option<(usize, Node, Option<f64>)> {
        let graph = self.graph;
        let symbols = graph.symbols_of(&[residual]);
        let is_state = |symbol: &&Node| self.by_symbol.contains_key(symbol);
        let others = |symbol: &&Node| !is_state(symbol) && !self.values.contains_key(symbol);
        if symbols.iter().any(|symbol| others(&symbol)) {
            return None;
        }
        let mut states = symbols.iter().filter(is_state);
        let (&state, None) = (states.next()?, states.next()) else {
            return None;
        };
        let slope = jacobian::reverse(graph, &[residual], &[state]).get(0, 0)?;
        if graph.symbols_of(&[slope]).contains(&state) {
            return None;
        }
        let zero = HashMap::from([(state, graph.constant(0.0).node())]);
        let rest = *graph.substitute(&[residual], &zero).first()?;
        let start = match graph.constant_value(slope) {
            Some(0.0) => return None,
            Some(1.0) => graph.unary(Unary::Neg, rest),
            Some(-1.0) => rest,
            _ => graph.unary(Unary::Neg, graph.binary(Binary::Div, rest, slope)),
        };
        let value = self.number(start);
        if value.is_none() && graph.symbols_of(&[start]).is_empty() {
            return None;
        }
        Some((*self.by_symbol.get(&state)?, start, value))
    }

    fn number(&self, node: Node) -> Option<f64> {
        if let Some(value) = self.graph.constant_value(node) {
            return Some(value);
        }
        let symbols = self.graph.symbols_of(&[node]);
        let values: Option<Vec<f64>> = symbols
            .iter()
            .map(|symbol| self.values.get(symbol).copied()?)
            .collect();
        let tape = Tape::new(self.graph, &symbols, &[node]).ok()?;
        let mut out = [f64::NAN];
        tape.evaluator().eval(&values?, &mut out);
        out[0].is_finite().then_some(out[0])
    }
}

fn unread(span: Span) -> Problem {
    Problem::new(span, "an initial equation of a derivative has no effect")
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}

fn does_not_fix(equation: &FlatEquation) -> Problem {
    let message = "this initial equation fixes the start of no state by itself: it has no effect";
    Problem::new(equation.span, message)
        .hint("starts are taken from `start = …` and from initial equations as `x = …`")
}
