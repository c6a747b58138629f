//! What every sample draws anew beside the independent noises of its sensors: errors of the readings of known
//! inputs, and what the noises of sensors have in common.
//!
//! Both are states after all others: d' = 0, and d ~ N(0, 1) anew in every row, whatever was known of it. An input that
//! is read with a deviation σ is u + σd until the next row: the state-transition matrix has Γ = ∂x(t + Δ)/∂u in the
//! column of d, and the covariance gets ΓσσΓᵀ, the same of a sensor that sees u. Sensors with deviations
//! D and correlations ϱ have R = DϱD; with the smallest eigenvalue λ of ϱ, ϱ = λI + GGᵀ, and y = h(x) + DGd + v
//! with independent v of variances λD². So whatever sensors report, R is theirs, and corrections stay those of one
//! reading after the other.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Node};

use super::likelihood::{ParametricLevel, ParametricPlant};
use super::model::NoisyPlant;
use crate::correlation::Correlation;
use crate::noise::{Level, Limits};

/// What is drawn anew: symbols for the standard normal numbers of a graph.
#[derive(Clone, Debug)]
pub struct Drawn<'g> {
    graph: &'g Graph,
    names: Vec<String>,
    symbols: Vec<Node>,
    /// the symbol of each input that is read with an error, and what it stands for
    read: HashMap<Node, Node>,
    correlation: Option<Correlation>,
}

/// The place of a symbol among those that are drawn; a graph has each once.
#[derive(Clone, PartialEq, Eq, Hash)]
struct Place(usize);

impl<'g> Drawn<'g> {
    /// Errors of inputs, by name and symbol, and common noises of sensors.
    pub fn new(
        graph: &'g Graph,
        inputs: &[(String, Node, Level)],
        correlation: Option<Correlation>,
    ) -> Self {
        let width = correlation.as_ref().map_or(0, Correlation::width);
        let symbol = |place: usize| {
            graph.noted(&Place(place)).unwrap_or_else(|| {
                let symbol = graph.fresh("drawn").node();
                graph.note(Place(place), symbol);
                symbol
            })
        };
        let symbols: Vec<Node> = (0..inputs.len() + width).map(symbol).collect();
        let errors = inputs.iter().zip(&symbols);
        let read = errors.map(|((_, input, level), error)| {
            let (u, d) = (graph.expr(*input), graph.expr(*error));
            let read = match *level {
                Level::Absolute(σ) => u + σ * d,
                Level::Relative(share) => u + share * u * d,
                Level::Uniform(bound) => u + bound / 3.0_f64.sqrt() * d,
            };
            (*input, read.node())
        });
        let common = (1..=width).map(|k| format!("common noise {k}"));
        let names = inputs.iter().map(|(name, ..)| format!("error of {name}"));
        Self {
            graph,
            names: names.chain(common).collect(),
            read: read.collect(),
            symbols,
            correlation,
        }
    }

    /// How many numbers are drawn.
    #[must_use]
    pub fn count(&self) -> usize {
        self.symbols.len()
    }

    /// Name and symbol of each.
    pub fn states(&self) -> impl Iterator<Item = (&String, Node)> {
        self.names.iter().zip(self.symbols.iter().copied())
    }

    /// Expressions with the inputs as they truly are, given their readings.
    #[must_use]
    pub fn truly(&self, nodes: &[Node]) -> Vec<Node> {
        match self.read.is_empty() {
            true => nodes.to_vec(),
            false => self.graph.substitute(nodes, &self.read),
        }
    }

    /// The share of the deviation of a sensor's noise that is its own.
    fn own(&self, sensor: usize) -> f64 {
        let own = self.correlation.as_ref();
        own.map_or(1.0, |own| own.own(sensor).sqrt())
    }

    /// What a sensor shows beside its own noise, of which a deviation is σ.
    fn shown(&self, sensor: usize, output: Node, σ: Node) -> Node {
        let Some(correlation) = &self.correlation else {
            return output;
        };
        let (g, σ) = (self.graph, self.graph.expr(σ));
        let common = correlation.common(sensor);
        let first = self.symbols.len() - common.len();
        let shares = common.iter().zip(&self.symbols[first..]);
        let shares = shares.filter(|(share, _)| **share != 0.0);
        let all = shares.map(|(share, d)| g.expr(*d) * *share);
        match all.reduce(|sum, one| sum + one) {
            None => output,
            Some(sum) => (g.expr(output) + σ * sum).node(),
        }
    }
}

/// Anywhere.
const FREE: Limits = Limits {
    low: f64::NEG_INFINITY,
    high: f64::INFINITY,
};

impl NoisyPlant<'_> {
    /// With what is drawn as its last states: to be compiled with [`NoisyModel::drawing`](super::NoisyModel::drawing).
    #[must_use]
    pub fn drawing(mut self, drawn: &Drawn<'_>) -> Self {
        let (g, count) = (self.graph, drawn.count());
        let nothing = g.constant(0.0).node();
        self.derivatives = drawn.truly(&self.derivatives);
        self.whens = self.whens.substituted(g, &drawn.read);
        for (i, sensor) in self.sensors.iter_mut().enumerate() {
            let h = drawn.truly(&[sensor.output])[0];
            let (σ, own) = match sensor.noise {
                Level::Absolute(σ) => (g.constant(σ), Level::Absolute(σ * drawn.own(i))),
                Level::Relative(p) => (p * g.expr(h), Level::Relative(p * drawn.own(i))),
                Level::Uniform(a) => (
                    g.constant(a / 3.0_f64.sqrt()),
                    Level::Uniform(a * drawn.own(i)),
                ),
            };
            (sensor.output, sensor.noise) = (drawn.shown(i, h, σ.node()), own);
        }
        if let Some(confined) = &mut self.confined {
            *confined = drawn.truly(confined);
            confined.resize(confined.len() + count, nothing);
        }
        if !self.ranges.is_empty() {
            self.ranges.resize(self.ranges.len() + count, FREE);
        }
        let states = drawn.states();
        let states = states.map(|(name, symbol)| (name.clone(), symbol, 0.0));
        self.states.extend(states);
        let n = self.states.len();
        self.derivatives.resize(n, nothing);
        self.process_noise.resize(n, 0.0);
        self.initial_variance.resize(n, 1.0);
        self
    }
}

impl ParametricPlant<'_> {
    /// With what is drawn as its last states.
    #[must_use]
    pub fn drawing(mut self, drawn: &Drawn<'_>) -> Self {
        let (g, count) = (self.graph, drawn.count());
        let [nothing, one] = [0.0, 1.0].map(|value| g.constant(value).node());
        self.derivatives = drawn.truly(&self.derivatives);
        self.whens = self.whens.substituted(g, &drawn.read);
        for (i, sensor) in self.sensors.iter_mut().enumerate() {
            let h = drawn.truly(&[sensor.output])[0];
            let own = drawn.own(i);
            let (σ, noise) = match sensor.noise {
                ParametricLevel::Variance(variance) => {
                    let variance = g.expr(variance);
                    let left = (variance * own.powi(2)).node();
                    (variance.sqrt(), ParametricLevel::Variance(left))
                }
                ParametricLevel::Share(share) => {
                    let share = g.expr(share);
                    let left = (share * own).node();
                    (share * g.expr(h), ParametricLevel::Share(left))
                }
            };
            (sensor.output, sensor.noise) = (drawn.shown(i, h, σ.node()), noise);
        }
        if !self.ranges.is_empty() {
            self.ranges.resize(self.ranges.len() + count, FREE);
        }
        self.states.extend(drawn.states().map(|state| state.1));
        let n = self.states.len();
        self.derivatives.resize(n, nothing);
        self.process_noise.resize(n, nothing);
        self.start.resize(n, (nothing, one));
        self.drawn = count;
        self
    }
}

#[cfg(test)]
mod tests;
