//! `delay(expr, tau)` where it is called.

use lynkeus_expr::Node;

use super::delayed::{DELAY_STATES, Delayed, MAX_DELAY_STATES};
use super::evaluate::Evaluator;
use super::value::{Scalar, Value, element_name};
use crate::diagnostic::{Problem, Result, Span};
use crate::syntax::ast::Call;

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
