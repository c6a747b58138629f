//! Plant and observer, compiled side by side.

use lynkeus::expr::{Evaluator, MissingInput, Node, Tape};
use lynkeus::model::Plant;
use lynkeus::observers::Observer;
use lynkeus::structure::AugmentedPlant;

use super::signals::Signal;

/// Where an estimated quantity's true value is found.
#[derive(Clone, Copy, Debug)]
enum Truth {
    State(usize),
    Input(usize),
}

pub struct Pair {
    /// (time, x, all inputs) → x', measured outputs
    plant: Evaluator,
    /// (time, z, inputs, derivatives, measured) → z', estimates, monitors
    observer: Evaluator,
    truths: Vec<Truth>,
    /// of the observer's inputs among the plant's; none of the switches of a sampled observer
    known: Vec<Option<usize>>,
    /// (input, order) of the derivatives that the observer reads
    derivatives: Vec<(usize, usize)>,
    pub states: usize,
    pub measured: usize,
    /// where the observer's states start
    pub start: Vec<f64>,
    /// per estimate the observer's state that it is, where it is one
    pub held: Vec<Option<usize>>,
    /// index of the monitor of regularity among the monitors
    rcond: Option<usize>,
    seen: Vec<f64>,
    own: Vec<f64>,
    plant_out: Vec<f64>,
    observer_out: Vec<f64>,
}

impl Pair {
    pub fn new(
        plant: &Plant,
        augmented: &AugmentedPlant<'_>,
        observer: &Observer,
    ) -> Result<Self, MissingInput> {
        let graph = &plant.graph;
        let nodes = |list: &[lynkeus::model::Variable]| list.iter().map(|v| v.node).collect();
        let (states, inputs): (Vec<Node>, Vec<Node>) = (nodes(&plant.states), nodes(&plant.inputs));
        let shown = |name: &str| {
            plant
                .outputs
                .iter()
                .find(|o| o.name == name)
                .map(|o| o.node)
        };
        // as the plant has them, disturbances included
        let h = augmented
            .outputs
            .iter()
            .filter_map(|o| shown(&o.variable.name));
        let right: Vec<Node> = plant.derivatives.iter().copied().chain(h).collect();
        let seen = [&[plant.time], &states[..], &inputs].concat();
        let z: Vec<Node> = observer.states.iter().map(|(s, _)| s.symbol).collect();
        let of = |signals: &[lynkeus::observers::Signal]| -> Vec<Node> {
            signals.iter().map(|s| s.symbol).collect()
        };
        let moving: Vec<Node> = observer
            .input_derivatives
            .iter()
            .map(|d| d.signal.symbol)
            .collect();
        let own = [
            &[observer.time],
            &z[..],
            &of(&observer.inputs),
            &moving,
            &of(&observer.measured),
        ]
        .concat();
        let estimates = observer.estimates.iter().map(|e| e.node);
        let monitors = observer.monitors.iter().map(|m| m.node);
        let left: Vec<Node> = observer
            .derivatives
            .iter()
            .copied()
            .chain(estimates)
            .chain(monitors)
            .collect();
        let input = |name: &str| plant.inputs.iter().position(|i| i.name == name);
        let truth = |name: &str| {
            let state = plant.states.iter().position(|s| s.name == name);
            state
                .map(Truth::State)
                .or_else(|| input(name).map(Truth::Input))
        };
        let names = observer.estimates.iter().map(|e| e.variable.name.as_str());
        Ok(Self {
            plant: Tape::new(graph, &seen, &right)?.evaluator(),
            observer: Tape::new(graph, &own, &left)?.evaluator(),
            truths: names.filter_map(truth).collect(),
            known: observer.inputs.iter().map(|s| input(&s.name)).collect(),
            derivatives: observer
                .input_derivatives
                .iter()
                .filter_map(|d| Some((input(&d.input)?, d.order)))
                .collect(),
            states: states.len(),
            measured: right.len() - states.len(),
            start: observer.states.iter().map(|(_, start)| *start).collect(),
            held: observer
                .estimates
                .iter()
                .map(|e| z.iter().position(|z| *z == e.node))
                .collect(),
            rcond: observer.monitors.iter().position(|m| m.name == "rcond"),
            seen: vec![0.0; seen.len()],
            own: vec![0.0; own.len()],
            plant_out: vec![0.0; right.len()],
            observer_out: vec![0.0; left.len()],
        })
    }

    /// Quantities that are estimated.
    pub fn estimates(&self) -> usize {
        self.truths.len()
    }

    /// (x', y) of the plant.
    pub fn plant(&mut self, t: f64, x: &[f64], u: &[f64]) -> &[f64] {
        self.seen[0] = t;
        self.seen[1..=x.len()].copy_from_slice(x);
        self.seen[1 + x.len()..].copy_from_slice(u);
        self.plant.eval(&self.seen, &mut self.plant_out);
        &self.plant_out
    }

    /// The true values of what is estimated.
    pub fn truth(&self, x: &[f64], u: &[f64], out: &mut Vec<f64>) {
        out.clear();
        out.extend(self.truths.iter().map(|truth| match truth {
            Truth::State(i) => x[*i],
            Truth::Input(i) => u[*i],
        }));
    }

    /// The joint slope; `state` is x, then z.
    pub fn slope(
        &mut self,
        t: f64,
        state: &[f64],
        u: &[f64],
        signals: &[Signal],
        noise: &[f64],
        out: &mut [f64],
    ) {
        let (x, z) = state.split_at(self.states);
        self.plant(t, x, u);
        let n = self.states;
        out[..n].copy_from_slice(&self.plant_out[..n]);
        self.own[0] = t;
        let mut at = 1;
        self.own[at..at + z.len()].copy_from_slice(z);
        at += z.len();
        for known in &self.known {
            // every measurement follows the model
            self.own[at] = known.map_or(1.0, |i| u[i]);
            at += 1;
        }
        for &(i, order) in &self.derivatives {
            self.own[at] = signals[i].derivative(t, order);
            at += 1;
        }
        let measured = self.plant_out[n..].iter().zip(noise).map(|(y, ν)| y + ν);
        for (own, y) in self.own[at..].iter_mut().zip(measured) {
            *own = y;
        }
        self.observer.eval(&self.own, &mut self.observer_out);
        out[n..].copy_from_slice(&self.observer_out[..z.len()]);
    }

    /// The estimates at the last point at which [`Pair::slope`] was taken.
    pub fn estimated(&self) -> &[f64] {
        let z = self.start.len();
        &self.observer_out[z..z + self.truths.len()]
    }

    /// Whether the observer says that it may have withdrawn its correction there.
    pub fn is_withdrawn(&self) -> bool {
        let first = self.start.len() + self.truths.len();
        // the tool says so below 6·10⁻⁴
        self.rcond
            .is_some_and(|i| self.observer_out[first + i] < 1e-3)
    }
}
