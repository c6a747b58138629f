//! How an observer's error spreads, for standard deviations.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::{Node, jacobian};

use crate::filter::root::Root;
use crate::filter::transition::Propagation;
use crate::filter::{Belief, NoisyModel, NoisyPlant, Sensor, check_counts};
use crate::linearised::OutputMap;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Events, Jacobian, Jacobians, Linearised};

/// The linearised error of a [sampled observer](crate::SampledObserver) z' = F(t, z, u, w), x̂ = g(z),
/// driven by the declared noises of plant and sensors.
///
/// The error of a measurement w is counted from what the estimate expects, as the innovation ν = w − h(x̂):
/// process noise moves the plant and its output alike, so that in (z, ν) it acts on the estimated
/// states alone, between samples as well. A reading with noise v leaves ν = v − C e, C = ∂h/∂x̂.
///
/// A measurement that is held falls behind the plant by ẏ = L_f h(x), x = x̂ − e. Its part L_f h(x̂) is
/// no noise; it is known along the estimate, and counts as the share of one more quantity, the lag, whose
/// size is 1: deviations are then roots of the mean square error, as if e were independent of x̂, as that
/// of a filter is.
#[derive(Clone, Debug)]
pub struct ErrorModel {
    /// the observer with its Jacobian in (z, ν), ∂g/∂z and ∂h/∂z; what each sensor should read, h(x̂) by z
    pub model: NoisyModel,
    /// place of the lag
    lag: Option<usize>,
    estimates: usize,
    /// readings are judged by what the observer makes of them
    pub judges: bool,
}

/// How measurements that are held fall behind.
#[derive(Clone, Copy, Debug)]
pub struct Lag<'a> {
    /// place of a state whose derivative is 0 and whose initial variance is 1
    pub state: usize,
    /// L_f h(x̂), one for each w
    pub rates: &'a [Node],
}

/// The equations of a [sampled observer](crate::SampledObserver): its states are z, then the measurements
/// w, each sensor's output is h(x̂).
struct ErrorEquations<'a> {
    observer: &'a NoisyPlant<'a>,
    lag: Option<Lag<'a>>,
    /// h(x̂)
    outputs: Vec<Node>,
}

/// A matrix by its places.
type Entries = BTreeMap<(usize, usize), Node>;

impl ErrorEquations<'_> {
    fn own(&self) -> usize {
        self.observer
            .states
            .len()
            .saturating_sub(self.outputs.len())
    }

    fn symbols(&self) -> Vec<Node> {
        self.observer.states.iter().map(|s| s.1).collect()
    }

    /// C = ∂h/∂z.
    fn views(&self) -> Entries {
        let symbols = self.symbols();
        let views = jacobian::forward(self.observer.graph, &self.outputs, &symbols[..self.own()]);
        let places = views.entries.into_iter();
        places.map(|(i, j, c)| ((i, j), c)).collect()
    }

    /// The Jacobian of nodes by (z, ν). w = ν + h(x̂) is put in its place first, so that what a
    /// correction has of x̂ goes out before a gain multiplies it.
    fn slopes(&self, nodes: &[Node]) -> Entries {
        let graph = self.observer.graph;
        let mut symbols = self.symbols();
        let (mut there, mut back) = (HashMap::new(), HashMap::new());
        for (w, output) in symbols.iter_mut().skip(self.own()).zip(&self.outputs) {
            let innovation = graph.fresh("innovation");
            let expected = graph.expr(*output);
            there.insert(*w, (innovation + expected).node());
            back.insert(innovation.node(), (graph.expr(*w) - expected).node());
            *w = innovation.node();
        }
        let nodes = graph.substitute(nodes, &there);
        let slopes = jacobian::forward(graph, &nodes, &symbols).entries;
        let values: Vec<Node> = slopes.iter().map(|entry| entry.2).collect();
        let values = graph.substitute(&values, &back);
        let places = slopes.iter().map(|&(i, j, _)| (i, j));
        places.zip(values).collect()
    }

    fn add(&self, entries: &mut Entries, place: (usize, usize), node: Node) {
        let graph = self.observer.graph;
        let sum = entries.get(&place).map_or(node, |before| {
            (graph.expr(*before) + graph.expr(node)).node()
        });
        entries.insert(place, sum);
    }

    /// z' and ν' = L_f h(x̂) − (h(x̂))', to which a measurement that is held adds its lag.
    fn rates(&self) -> Vec<Node> {
        let NoisyPlant {
            graph,
            time,
            derivatives,
            ..
        } = self.observer;
        let (own, following) = derivatives.split_at(self.own().min(derivatives.len()));
        let mut moving = vec![*time];
        moving.extend(self.symbols().into_iter().take(own.len()));
        let motion = [&[graph.constant(1.0).node()], own].concat();
        let expected = jacobian::along(graph, &self.outputs, &moving, &motion);
        let following = self.lag.map_or(following, |lag| lag.rates);
        let both = following.iter().zip(expected);
        let innovations = both.map(|(w, y)| (graph.expr(*w) - graph.expr(y)).node());
        own.iter().copied().chain(innovations).collect()
    }

    /// The Jacobian of the flow in (z, ν), with what holding leaves behind.
    fn flow(&self) -> Entries {
        let (graph, own) = (self.observer.graph, self.own());
        let mut flow = self.slopes(&self.rates());
        if let Some(lag) = &self.lag {
            let held = self.observer.derivatives.iter().skip(own).zip(lag.rates);
            for (sensor, (w, rate)) in held.enumerate() {
                let behind = graph.expr(*w) - graph.expr(*rate);
                self.add(&mut flow, (own + sensor, lag.state), behind.node());
            }
        }
        flow
    }
}

/// Entries in the order of their places.
fn listed(entries: Entries) -> Vec<(usize, usize, Node)> {
    let entries = entries.into_iter();
    entries.map(|((i, j), node)| (i, j, node)).collect()
}

impl ErrorModel {
    /// Compiles the linearisation of an observer: its states are z, then the measurements w; its sensors'
    /// outputs are h(x̂), one for each w; `estimates` are g(z).
    ///
    /// # Errors
    /// [`Error::MissingInput`], and [`Error::Setting`] for wrong numbers of noises.
    pub fn new(
        observer: &NoisyPlant<'_>,
        estimates: &[Node],
        lag: Option<Lag<'_>>,
    ) -> Result<Self, Error> {
        check_counts(observer)?;
        let equations = ErrorEquations {
            observer,
            lag,
            outputs: observer.sensors.iter().map(|s| s.output).collect(),
        };
        // C first: nodes are made in this order
        let output = listed(equations.views());
        let jacobians = Jacobians {
            state: listed(equations.flow()),
            estimate: listed(equations.slopes(estimates)),
            output,
        };
        let flow = Linearised::new(
            observer.graph,
            observer.time,
            &observer.states,
            &observer.inputs,
            &observer.derivatives,
            &[],
            &jacobians,
        )?;
        Ok(Self {
            model: NoisyModel::of(observer, flow, None)?,
            lag: lag.map(|lag| lag.state),
            estimates: estimates.len(),
            judges: true,
        })
    }

    /// The covariance from an exact start: of the lag alone.
    fn settled(&self) -> Root {
        let starts = self.model.initial_variance.iter().enumerate();
        let starts = starts.map(|(i, v)| if Some(i) == self.lag { *v } else { 0.0 });
        Root::diagonal(&starts.collect::<Vec<f64>>())
    }
}

/// The covariance of an observer's states, and of its innovations, along its run.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    propagation: Propagation,
    belief: Belief,
    /// the covariance from an exact start, where readings are judged
    settled: Option<Root>,
    jacobians: Jacobians<Jacobian>,
    /// of the flow's outputs
    values: Vec<f64>,
    sensors: Vec<Sensor>,
    expected: OutputMap,
    pub deviations: Vec<f64>,
}

impl Persist for Spread {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.propagation.walk(walk)?;
        self.belief.walk(walk)?;
        if let Some(settled) = &mut self.settled {
            settled.walk(walk)?;
        }
        walk.numbers(&mut self.deviations)
    }
}

impl Spread {
    pub fn new(errors: &ErrorModel, run: EstimatorSettings) -> Result<Self, Error> {
        let model = &errors.model;
        let flow = model.flow.system();
        Ok(Self {
            propagation: Propagation::new(&model.flow, &model.process_noise, run)?,
            belief: Belief::new(flow.start(), &model.initial_variance),
            settled: errors.judges.then(|| errors.settled()),
            jacobians: model.flow.jacobians().clone(),
            values: vec![0.0; flow.outputs().len()],
            sensors: model.sensors.clone(),
            expected: OutputMap::new(&model.output_map),
            deviations: vec![0.0; errors.estimates],
        })
    }

    /// The signals from here on.
    pub fn start(&mut self, signals: &[f64]) {
        self.propagation.driven.start(signals);
    }

    /// The known inputs at the end of the interval to come.
    pub fn aim(&mut self, from: f64, to: f64, inputs: &[f64]) {
        self.propagation.driven.aim(from, to, inputs);
    }

    /// State and covariance to a time.
    pub fn advance(&mut self, from: f64, to: f64, x: &mut [f64]) -> Result<(), Error> {
        self.belief.x.copy_from_slice(x);
        let done = self.propagation.predict(&mut self.belief, from, to);
        // where an error ends it early, as far as it came
        x.copy_from_slice(&self.belief.x);
        done?;
        if let Some(settled) = &mut self.settled {
            self.propagation.carry(settled);
        }
        Ok(())
    }

    /// The measurements of the sensors that report are new readings, with errors of their own; z is
    /// after them.
    pub fn reset(&mut self, t: f64, z: &[f64], readings: &[f64]) {
        let evaluation = &mut self.propagation.driven.evaluation;
        evaluation.enter(t);
        evaluation.outputs(t, z, &mut self.values);
        for (sensor, reading) in readings.iter().enumerate() {
            if !reading.is_finite() {
                continue;
            }
            let views = self.jacobians.output.row(&self.values, sensor);
            let own: Vec<(usize, f64)> = views.collect();
            let state = self.belief.root.n - self.sensors.len() + sensor;
            let deviation = self.sensors[sensor].noise.variance(*reading).sqrt();
            for root in std::iter::once(&mut self.belief.root).chain(&mut self.settled) {
                read(root, state, &own, deviation);
            }
        }
    }

    /// What is expected of the sensors at (t, z) under the signals, before they are read there: h(x̂)
    /// with the standard deviation of a reading around it, √(HPHᵀ + R), and the same once the start is
    /// forgotten. Nothing where readings are not judged, or the model has no value.
    pub fn expected(&mut self, t: f64, z: &[f64], signals: &[f64]) -> Vec<[f64; 3]> {
        let (expected, Some(settled)) = (&mut self.expected, &self.settled) else {
            return vec![];
        };
        expected.evaluate(t, z, signals);
        if !expected.is_finite() {
            return vec![];
        }
        let n = self.belief.root.n;
        let (mut row, mut projected) = (vec![0.0; n], vec![0.0; n]);
        let each = |(i, (value, sensor)): (usize, (&f64, &Sensor))| {
            expected.write_slopes(i, &mut row);
            let mut deviation = |root: &Root| {
                root.transposed_times(&row, &mut projected);
                let own: f64 = projected.iter().map(|p| p * p).sum();
                (own + sensor.noise.variance(*value)).sqrt()
            };
            [*value, deviation(&self.belief.root), deviation(settled)]
        };
        let values = expected.outputs().iter().zip(&self.sensors);
        values.enumerate().map(each).collect()
    }

    /// The standard deviations of the estimates at (t, z).
    pub fn measure(&mut self, t: f64, z: &[f64]) {
        let evaluation = &mut self.propagation.driven.evaluation;
        evaluation.enter(t);
        evaluation.outputs(t, z, &mut self.values);
        let n = self.belief.root.n;
        let (mut row, mut projected) = (vec![0.0; n], vec![0.0; n]);
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            self.jacobians.estimate.write_row(&self.values, i, &mut row);
            self.belief.root.transposed_times(&row, &mut projected);
            *deviation = projected.iter().map(|p| p * p).sum::<f64>().sqrt();
        }
    }
}

/// ν = v − C e becomes what a sensor's state is off by: `views` are the entries of its row of C.
fn read(root: &mut Root, state: usize, views: &[(usize, f64)], deviation: f64) {
    let n = root.n;
    let mut expected = vec![0.0; n];
    for (j, c) in views {
        for (expected, s) in expected.iter_mut().zip(root.row(*j)) {
            *expected -= c * s;
        }
    }
    root.entries[state * n..(state + 1) * n].copy_from_slice(&expected);
    // one column more for the new error, then back to n
    let mut rows: Vec<f64> = (0..n)
        .flat_map(|k| (0..n).map(move |i| (i, k)))
        .map(|(i, k)| root.entries[i * n + k])
        .collect();
    rows.extend((0..n).map(|i| if i == state { deviation } else { 0.0 }));
    root.of_rows(&mut rows, &mut vec![0.0; n]);
}

#[cfg(test)]
mod tests;
