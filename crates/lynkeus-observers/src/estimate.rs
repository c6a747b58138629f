//! What every family does alike: the copy of the plant that runs on the estimate.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Node};
use lynkeus_model::Variable;
use lynkeus_structure::{Extended, Measurement};

use crate::kalman::is_or_has;
use crate::{Estimate, Initial, Observer, Signal, Tunables, Tuning, TuningError, prolongation};

/// The keys of every observer, read.
pub struct Common {
    pub initial: Initial,
    /// the plant's functions see the estimate limited to its range
    pub clamp: bool,
    /// outside of it they are continued (`prolongation`)
    pub prolong: bool,
    /// θ is a symbol
    pub tunable: bool,
}

impl Common {
    pub fn read(tuning: &Tuning) -> Result<Self, TuningError> {
        Ok(Self {
            initial: tuning.initial.clone(),
            clamp: tuning.clamp,
            prolong: tuning.flag(prolongation::PROLONG.name)?,
            tunable: tuning.tunable,
        })
    }
}

/// The plant's expressions over the estimate.
pub(crate) struct Copy<'e, 'p> {
    pub extended: &'e Extended<'p>,
    /// x̂, one per extended state
    pub hats: Vec<Signal>,
    /// y, one per measured output
    pub measured: Vec<Signal>,
    /// x ↦ x̂, limited to [min, max] if the tuning says so
    seen: HashMap<Node, Node>,
    pub common: &'e Common,
}

impl<'e, 'p> Copy<'e, 'p> {
    pub fn new(extended: &'e Extended<'p>, common: &'e Common) -> Self {
        let graph = extended.graph();
        let hat = |state: &Variable| Signal::fresh(graph, "estimate of", &state.name);
        let y = |o: &Measurement| Signal::fresh(graph, "measured", &o.variable.name);
        let mut copy = Self {
            extended,
            hats: extended.states.iter().map(hat).collect(),
            measured: extended.outputs.iter().map(y).collect(),
            seen: HashMap::new(),
            common,
        };
        let seen =
            |(i, hat): (usize, &Signal)| (extended.states[i].node, copy.seen_as(i, hat.symbol));
        copy.seen = copy.hats.iter().enumerate().map(seen).collect();
        copy
    }

    /// How the plant's functions see a state whose estimate is `hat`.
    pub fn seen_as(&self, state: usize, hat: Node) -> Node {
        match self.common.clamp || self.common.prolong {
            true => limited(self.extended.graph(), hat, &self.extended.states[state]),
            false => hat,
        }
    }

    /// Expressions of the plant at the estimate: f(x̂, u) from f(x, u).
    pub fn at_estimate(&self, expressions: &[Node]) -> Vec<Node> {
        self.extended.graph().substitute(expressions, &self.seen)
    }

    /// The same where some states, by their places, have another estimate.
    pub fn at_estimate_with(&self, expressions: &[Node], others: &[(usize, Node)]) -> Vec<Node> {
        let mut seen = self.seen.clone();
        let image =
            |&(i, hat): &(usize, Node)| (self.extended.states[i].node, self.seen_as(i, hat));
        seen.extend(others.iter().map(image));
        self.extended.graph().substitute(expressions, &seen)
    }

    /// x̂ with its starts: the named value, else the default, else the plant's
    /// `start`, else the middle of its range, else 0.
    pub fn states(&self) -> Result<Vec<(Signal, f64)>, TuningError> {
        let initial = &self.common.initial;
        if let Some(name) = initial
            .values
            .keys()
            .find(|n| !self.hats.iter().any(|hat| is_or_has(n, &hat.name)))
        {
            let names: Vec<&str> = self.hats.iter().map(|h| h.name.as_str()).collect();
            let expected = format!("names of estimated quantities ({})", names.join(", "));
            return Err(TuningError::new("initial", expected, format!("\"{name}\"")));
        }
        let start = |variable: &Variable| {
            initial
                .of(&variable.name)
                .or(initial.default)
                .or(variable.start)
                .unwrap_or_else(|| middle(variable))
        };
        let states = self.hats.iter().zip(&self.extended.states);
        Ok(states
            .map(|(hat, variable)| (hat.clone(), start(variable)))
            .collect())
    }

    /// The estimates where the observer's first states are x̂ itself.
    pub fn estimates(&self) -> Vec<Estimate> {
        let pairs = self.hats.iter().zip(&self.extended.states).enumerate();
        let estimate = |(i, (hat, variable)): (usize, (&Signal, &Variable))| Estimate {
            variable: variable.clone(),
            node: hat.symbol,
            unknown_input: i >= self.extended.plant_states(),
        };
        pairs.map(estimate).collect()
    }
}

impl Copy<'_, '_> {
    /// The measured value of the state that output `i` shows: y = slope·x + offset
    /// solved for x. None where the output is no affine function of one state.
    pub fn measured_state(&self, i: usize) -> Option<(usize, Node)> {
        let graph = self.extended.graph();
        let output = &self.extended.outputs[i];
        let (state, slope, offset) = output.state?;
        let x = (graph.expr(self.measured[i].symbol) - graph.expr(offset)) / graph.expr(slope);
        Some((state, x.node()))
    }

    /// x̂ − x as measured, for the state that output `i` shows.
    pub fn innovation(&self, i: usize) -> Option<Node> {
        let graph = self.extended.graph();
        let (state, measured) = self.measured_state(i)?;
        let innovation = graph.expr(self.hats[state].symbol) - graph.expr(measured);
        Some(innovation.node())
    }

    /// An observer whose states are x̂ alone.
    pub fn observer(
        &self,
        family: &'static str,
        derivatives: Vec<Node>,
    ) -> Result<Observer, TuningError> {
        let signal = |v: &Variable| Signal {
            name: v.name.clone(),
            symbol: v.node,
        };
        Ok(Observer {
            family,
            time: self.extended.plant.time,
            states: self.states()?,
            derivatives,
            inputs: self.extended.inputs.iter().map(signal).collect(),
            input_derivatives: vec![],
            generated: vec![],
            measured: self.measured.clone(),
            estimates: self.estimates(),
            monitors: vec![],
            filter: None,
            tunables: Tunables::default(),
        })
    }
}

/// max(min, min(max, x̂)) with the ends that are declared.
pub(crate) fn limited(graph: &Graph, hat: Node, variable: &Variable) -> Node {
    let mut image = graph.expr(hat);
    if variable.max.is_finite() {
        image = image.min(graph.constant(variable.max));
    }
    if variable.min.is_finite() {
        image = image.max(graph.constant(variable.min));
    }
    image.node()
}

/// The middle of a range, 0 where it has none.
pub(crate) fn middle(variable: &Variable) -> f64 {
    let middle = variable.min + (variable.max - variable.min) / 2.0;
    if middle.is_finite() { middle } else { 0.0 }
}
