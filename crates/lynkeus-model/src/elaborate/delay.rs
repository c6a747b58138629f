//! `delay(expr, tau)` of a constant tau: the last tau of an expression, held by a few states.
//!
//! With P_i the Legendre polynomials on [0, 1], e(t − rτ) = Σ P_i(r) z_i(t) at r = 0 … 1 is transported as ∂e/∂t =
//! −(1/τ) ∂e/∂r with the present e at r = 0. Galerkin's method, the inflow taken weakly, gives
//! τ z_i' = (2i + 1) (Σ_{j≤i} (−1)^(i−j+1) z_j − Σ_{j>i} z_j + (−1)^i e), and what leaves is e(t − τ) = Σ z_i. From e to
//! what leaves that is Padé's approximant of exp(−sτ) with q − 1 zeros and q poles (A. Voelker, C. Eliasmith, Neural
//! Computation 30 (2018) 569–609). z_0 is the mean of e over the last τ.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Interval, Node};

use super::assemble::computed;
use super::evaluate::Evaluator;
use super::symbols::Symbols;
use super::value::{Scalar, Value, element_name};
use crate::balance::{FlatEquation, Unknown};
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::Call;
use crate::{Delay, Plant, Variable};

/// States of a delay where nobody says how many.
pub const DELAY_STATES: usize = 6;
/// More are not sound in numbers, and worth little.
pub const MAX_DELAY_STATES: usize = 10;

/// An expression that is delayed.
#[derive(Clone, Debug)]
pub(crate) struct Delayed {
    /// what is delayed
    input: Node,
    /// by how much
    tau: Node,
    at: Span,
    text: String,
    /// the states are its elements
    name: String,
    /// z_i, and their derivatives
    states: Vec<[Node; 2]>,
}

impl<'a> Evaluator<'a> {
    /// `delay(expr, tau)`, `delay(expr, tau, max)`.
    pub(super) fn delay(&mut self, call: &'a Call) -> Result<Value> {
        let [input, tau] = match call.arguments.len() {
            // the longest delay there may be is nothing but room
            3 => [call.arguments[0], call.arguments[1]],
            _ => self.arguments(call)?,
        };
        if self.symbols.given.is_some() {
            let message = "`delay` stands only in the equations of a model";
            return Err(Problem::new(call.function, message));
        }
        let at = self.at;
        let value = self.value(input)?;
        let tau = self.scalar(tau)?;
        self.at = at;
        let tau = self.real(tau)?;
        let is_known = |symbol: &Node| self.symbols.parameters.contains(symbol);
        if !self.graph.symbols_of(&[tau]).iter().all(is_known) {
            let message = "the time of `delay` changes: expected a number or a parameter";
            return Err(Problem::new(at, message).hint(
                "where a flow carries something, write the plug flow itself: docs/modelica.md, Delays",
            ));
        }
        match self.graph.constant_value(tau) {
            Some(0.0) => return Ok(value),
            Some(tau) if !(tau > 0.0 && tau.is_finite()) => {
                let message = format!("a delay of {tau}: expected a time >= 0");
                return Err(Problem::new(at, message));
            }
            _ => {}
        }
        self.map(value, |scalar| {
            let input = self.real(scalar)?;
            match self.graph.constant_value(input) {
                Some(_) => Ok(Scalar::Real(input)),
                None => self.delayed(input, tau, at).map(Scalar::Real),
            }
        })
    }

    /// What leaves the states that hold the last `tau` of an expression.
    fn delayed(&self, input: Node, tau: Node, at: Span) -> Result<Node> {
        let graph = self.graph;
        let count = self.symbols.options.delay_states.unwrap_or(DELAY_STATES);
        let count = count.clamp(1, MAX_DELAY_STATES);
        self.charge((count * count) as u64)?;
        let mut delays = self.symbols.delays.borrow_mut();
        let mut known = delays.iter();
        if let Some(known) = known.find(|d| (d.input, d.tau) == (input, tau)) {
            return Ok(known.output(graph));
        }
        let name = graph.symbol_name(input);
        let base = name.as_deref().map_or("delay".to_owned(), |name| {
            let plain = name.split(['[', '(']).next().unwrap_or(name);
            format!("{plain}_delay")
        });
        let is_free = |name: &String| {
            let is_declared = self.symbols.by_name.contains_key(name.as_str());
            !is_declared && delays.iter().all(|other| other.name != *name)
        };
        let numbered = (2..).map(|k| format!("{base}_{k}"));
        let name = std::iter::once(base.clone()).chain(numbered).find(is_free);
        let name = name.unwrap_or(base);
        let states = (0..count).map(|i| {
            let state = element_name(&name, &[count], i);
            let derivative = graph.symbol(&format!("der({state})")).node();
            [graph.symbol(&state).node(), derivative]
        });
        let delayed = Delayed {
            input,
            tau,
            at,
            text: self.text(at).to_owned(),
            states: states.collect(),
            name,
        };
        let output = delayed.output(graph);
        delays.push(delayed);
        Ok(output)
    }
}

/// −x for an odd power of −1.
fn signed(power: usize, x: Expr<'_>) -> Expr<'_> {
    if power.is_multiple_of(2) { x } else { -x }
}

impl Delayed {
    fn output(&self, graph: &Graph) -> Node {
        let states = self.states.iter().map(|[z, _]| graph.expr(*z));
        let sum = states.reduce(|sum, z| sum + z);
        sum.map_or(self.input, |sum| sum.node())
    }

    /// The derivatives of its states.
    pub fn unknowns(&self) -> impl Iterator<Item = Unknown> {
        let states = self.states.iter().enumerate();
        states.map(|(i, [state, derivative])| Unknown {
            symbol: *derivative,
            name: element_name(&self.name, &[self.states.len()], i),
            span: self.at,
            state: Some(*state),
            rank: 40,
            start: 0.0,
            range: Interval::ENTIRE,
        })
    }

    /// What these are.
    pub fn equations(&self, graph: &Graph) -> Vec<FlatEquation> {
        let input = graph.expr(self.input);
        let of = |i: usize| {
            let states = self.states.iter().enumerate();
            let carried = states.map(|(j, [z, _])| match j <= i {
                true => signed(i - j + 1, graph.expr(*z)),
                false => -graph.expr(*z),
            });
            let sum = carried.fold(signed(i, input), |sum, term| sum + term);
            let rate = sum * (2 * i + 1) as f64 / graph.expr(self.tau);
            FlatEquation {
                left: self.states[i][1],
                right: rate.node(),
                span: self.at,
                element: None,
            }
        };
        (0..self.states.len()).map(of).collect()
    }

    /// Its states among those of the plant; they start as if what is delayed had always been what it is at the start.
    pub fn join(self, symbols: &Symbols<'_>, solution: &HashMap<Node, Node>, plant: &mut Plant) {
        let graph = symbols.graph;
        let mut known = symbols.parameter_values();
        known.insert(symbols.time(), Some(0.0));
        let starts = plant.states.iter().chain(&plant.inputs);
        known.extend(starts.map(|variable| (variable.node, variable.start)));
        let input = graph.substitute(&[self.input], solution)[0];
        let start = computed(graph, input, |symbol| known.get(&symbol).copied()?);
        let all = plant.states.iter().chain(&plant.inputs);
        let mut all = all.chain(&plant.outputs).chain(&plant.algebraics);
        let name = graph.symbol_name(self.input);
        let own = all
            .find(|variable| Some(&variable.name) == name.as_ref())
            .cloned();
        let count = self.states.len();
        for (i, [state, derivative]) in self.states.iter().enumerate() {
            let Some(derivative) = solution.get(derivative) else {
                continue;
            };
            let mut variable = Variable::new(element_name(&self.name, &[count], i), *state);
            variable.start = if i == 0 { start } else { Some(0.0) };
            variable.unit = own.as_ref().and_then(|own| own.unit.clone());
            if let (0, Some(own)) = (i, &own) {
                (variable.min, variable.max) = (own.min, own.max);
            }
            plant.states.push(variable);
            plant.derivatives.push(*derivative);
        }
        plant.delays.push(Delay {
            text: self.text,
            states: self.name,
            count,
        });
    }

    /// What whoever reads the model should know of it.
    pub fn told(&self) -> Problem {
        let count = self.states.len();
        let states = if count == 1 { "state" } else { "states" };
        let message = format!(
            "a delay is held by {count} {states}, `{}`, and what it gives is right for what moves slowly",
            self.name
        );
        Problem::new(self.at, message).hint(format!(
            "up to some {count} rad per delay; `delay_states` of the study sets how many, up to {MAX_DELAY_STATES}"
        ))
    }
}
