//! `delay(expr, tau)` of a constant tau: the last tau of an expression, held by a few states.
//!
//! With P_i the Legendre polynomials on [0, 1], e(t − rτ) = Σ P_i(r) z_i(t) at r = 0 … 1 is transported as ∂e/∂t =
//! −(1/τ) ∂e/∂r with the present e at r = 0. Galerkin's method, the inflow taken weakly, gives
//! τ z_i' = (2i + 1) (Σ_{j≤i} (−1)^(i−j+1) z_j − Σ_{j>i} z_j + (−1)^i e), and what leaves is e(t − τ) = Σ z_i. From e to
//! what leaves that is Padé's approximant of exp(−sτ) with q − 1 zeros and q poles (A. Voelker, C. Eliasmith, Neural
//! Computation 30 (2018) 569–609). z_0 is the mean of e over the last τ.

use std::collections::HashMap;

use lynkeus_expr::{Expr, Graph, Interval, Node};

use super::value::element_name;
use crate::balance::{FlatEquation, Unknown};
use crate::diagnostic::{Problem, Span};
use crate::{Delay, Plant, Variable};

/// States of a delay where nobody says how many.
pub const DELAY_STATES: usize = 6;
/// More are not sound in numbers, and worth little.
pub const MAX_DELAY_STATES: usize = 10;

/// An expression that is delayed.
#[derive(Clone, Debug)]
pub(crate) struct Delayed {
    /// what is delayed
    pub input: Node,
    /// by how much
    pub tau: Node,
    pub at: Span,
    pub text: String,
    /// the states are its elements
    pub name: String,
    /// z_i, and their derivatives
    pub states: Vec<[Node; 2]>,
}

/// −x for an odd power of −1.
fn signed(power: usize, x: Expr<'_>) -> Expr<'_> {
    if power.is_multiple_of(2) { x } else { -x }
}

impl Delayed {
    /// What leaves its states.
    pub fn output(&self, graph: &Graph) -> Node {
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
            is_discrete: false,
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
    pub fn join(
        self,
        graph: &Graph,
        solution: &HashMap<Node, Node>,
        start: impl Fn(Node, &Plant) -> Option<f64>,
        plant: &mut Plant,
    ) {
        let input = graph.substitute(&[self.input], solution)[0];
        let start = start(input, plant);
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
