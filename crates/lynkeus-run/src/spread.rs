//! How an observer's error spreads, for standard deviations.

use std::collections::HashMap;

use lynkeus_expr::{Node, jacobian};

use crate::filter::root::Root;
use crate::filter::transition::Propagation;
use crate::filter::{Belief, Innovation, NoisyModel, NoisyPlant, Reading, Sensor, check_counts};
use crate::linearised::{Entries, OutputMap};
use crate::runner::Sample;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{EstimatorSettings, Events, Jacobian, Jacobians, Linearised, Result};

/// How measurements that are held fall behind.
#[derive(Clone, Copy, Debug)]
pub struct Lag<'a> {
    /// place of a state whose derivative is 0 and whose initial variance is 1
    pub state: usize,
    /// L_f h(x̂), one for each w
    pub rates: &'a [Node],
}

impl NoisyModel {
    /// Compiles the linearised error of a [observer](crate::Updates::Jumps) z' = F(t, z, u, w),
    /// x̂ = g(z), driven by the declared noises of plant and sensors. The states are z, then the
    /// measurements w; the sensors' outputs are h(x̂), one for each w; `estimates` are g(z).
    ///
    /// The error of a measurement w is counted from what the estimate expects, as the innovation ν = w − h(x̂):
    /// process noise moves the plant and its output alike, so that in (z, ν) it acts on the estimated
    /// states alone, between samples as well. A reading with noise v leaves ν = v − C e, C = ∂h/∂x̂. The
    /// flow has its Jacobian in (z, ν), ∂g/∂z and ∂h/∂z.
    ///
    /// A measurement that is held falls behind the plant by ẏ = L_f h(x), x = x̂ − e. Its part L_f h(x̂) is
    /// no noise; it is known along the estimate, and counts as the share of one more quantity, the lag, whose
    /// size is 1: deviations are then roots of the mean square error, as if e were independent of x̂, as that
    /// of a filter is.
    ///
    /// # Errors
    /// [`crate::Error::MissingInput`], and [`crate::Error::Setting`] for wrong numbers of noises.
    pub fn of_observer(
        observer: &NoisyPlant<'_>,
        estimates: &[Node],
        lag: Option<Lag<'_>>,
    ) -> Result<Self> {
        check_counts(observer)?;
        // C first: nodes are made in this order
        let mut output = observer.views();
        let mut state = observer.error_flow(lag);
        let mut estimate = observer.error_slopes(estimates);
        for entries in [&mut output, &mut state, &mut estimate] {
            entries.sort_by_key(|&(i, j, _)| (i, j));
        }
        let flow = Linearised::new(
            observer.graph,
            observer.time,
            &observer.states,
            &observer.inputs,
            &observer.derivatives,
            &[],
            &Jacobians {
                state,
                estimate,
                output,
            },
        )?;
        Ok(Self {
            lag: lag.map(|lag| lag.state),
            estimates: estimates.len(),
            ..Self::of(observer, flow, None)?
        })
    }

    /// The covariance from an exact start: of the lag, and what every row draws anew.
    fn settled(&self) -> Root {
        let starts = self.initial_variance.iter().enumerate();
        let end = self.initial_variance.len() - self.sensors.len();
        let drawn = end - self.drawn..end;
        let is_there = |i: usize| Some(i) == self.lag || drawn.contains(&i);
        let starts = starts.map(|(i, v)| if is_there(i) { *v } else { 0.0 });
        Root::diagonal(&starts.collect::<Vec<f64>>())
    }
}

/// Of an observer.
impl NoisyPlant<'_> {
    /// How many of the states are z.
    fn own(&self) -> usize {
        self.states.len().saturating_sub(self.sensors.len())
    }

    fn symbols(&self) -> Vec<Node> {
        self.states.iter().map(|s| s.1).collect()
    }

    fn outputs(&self) -> Vec<Node> {
        self.sensors.iter().map(|s| s.output).collect()
    }

    /// C = ∂h/∂z.
    fn views(&self) -> Entries {
        let own = &self.symbols()[..self.own()];
        jacobian::forward(self.graph, &self.outputs(), own).entries
    }

    /// The Jacobian of nodes by (z, ν). w = ν + h(x̂) is put in its place first, so that what a
    /// correction has of x̂ goes out before a gain multiplies it.
    fn error_slopes(&self, nodes: &[Node]) -> Entries {
        let graph = self.graph;
        let mut symbols = self.symbols();
        let (mut there, mut back) = (HashMap::new(), HashMap::new());
        for (w, sensor) in symbols.iter_mut().skip(self.own()).zip(&self.sensors) {
            let innovation = graph.fresh("innovation");
            let expected = graph.expr(sensor.output);
            there.insert(*w, (innovation + expected).node());
            back.insert(innovation.node(), (graph.expr(*w) - expected).node());
            *w = innovation.node();
        }
        let nodes = graph.substitute(nodes, &there);
        let mut slopes = jacobian::forward(graph, &nodes, &symbols).entries;
        let values: Vec<Node> = slopes.iter().map(|entry| entry.2).collect();
        let values = graph.substitute(&values, &back);
        let entries = slopes.iter_mut().zip(values);
        entries.for_each(|(entry, value)| entry.2 = value);
        slopes
    }

    /// z' and ν' = L_f h(x̂) − (h(x̂))', to which a measurement that is held adds its lag.
    fn error_rates(&self, lag: Option<Lag<'_>>) -> Vec<Node> {
        let graph = self.graph;
        let all = &self.derivatives;
        let (own, following) = all.split_at(self.own().min(all.len()));
        let mut moving = vec![self.time];
        moving.extend(self.symbols().into_iter().take(own.len()));
        let motion = [&[graph.constant(1.0).node()], own].concat();
        let expected = jacobian::along(graph, &self.outputs(), &moving, &motion);
        let following = lag.map_or(following, |lag| lag.rates);
        let both = following.iter().zip(expected);
        let innovations = both.map(|(w, y)| (graph.expr(*w) - graph.expr(y)).node());
        own.iter().copied().chain(innovations).collect()
    }

    /// The Jacobian of the flow in (z, ν), with what holding leaves behind.
    fn error_flow(&self, lag: Option<Lag<'_>>) -> Entries {
        let (graph, own) = (self.graph, self.own());
        let mut flow = self.error_slopes(&self.error_rates(lag));
        let Some(lag) = lag else {
            return flow;
        };
        let held = self.derivatives.iter().skip(own).zip(lag.rates);
        for (sensor, (w, rate)) in held.enumerate() {
            let behind = graph.expr(*w) - graph.expr(*rate);
            let at = (own + sensor, lag.state);
            match flow.iter_mut().find(|entry| (entry.0, entry.1) == at) {
                Some(entry) => entry.2 = (graph.expr(entry.2) + behind).node(),
                None => flow.push((at.0, at.1, behind.node())),
            }
        }
        flow
    }
}

/// The covariance of an observer's states, and of its innovations, along its run.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    pub propagation: Propagation,
    pub belief: Belief,
    /// the covariance from an exact start, where readings are judged
    settled: Option<Root>,
    jacobians: Jacobians<Jacobian>,
    /// of the flow's outputs
    values: Vec<f64>,
    sensors: Vec<Sensor>,
    /// so many states before the measurements are drawn anew in every row
    drawn: usize,
    /// so many states before these are the observer's
    pub own: usize,
    expected: OutputMap,
    /// of the last readings; empty where they are not judged
    pub innovations: Vec<Innovation>,
    pub deviations: Vec<f64>,
}

impl Persist for Spread {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.propagation.walk(walk)?;
        self.belief.walk(walk)?;
        if let Some(settled) = &mut self.settled {
            walk.numbers(&mut settled.entries)?;
        }
        for innovation in &mut self.innovations {
            innovation.walk(walk)?;
        }
        walk.numbers(&mut self.deviations)
    }
}

impl Spread {
    /// Whether readings are judged.
    pub fn new(model: &NoisyModel, judges: bool, run: EstimatorSettings) -> Result<Self> {
        let flow = model.flow.system();
        let judged = if judges { model.sensors.len() } else { 0 };
        Ok(Self {
            propagation: Propagation::new(&model.flow, &model.process_noise, run)?,
            belief: Belief::new(flow.start(), &model.initial_variance),
            settled: judges.then(|| model.settled()),
            jacobians: model.flow.jacobians().clone(),
            values: vec![0.0; flow.outputs().len()],
            sensors: model.sensors.clone(),
            drawn: model.drawn,
            own: model
                .lag
                .unwrap_or(flow.states().len() - model.sensors.len() - model.drawn),
            expected: OutputMap::new(&model.output_map),
            innovations: vec![Innovation::default(); judged],
            deviations: vec![0.0; model.estimates],
        })
    }

    /// State and covariance to the time of a sample.
    pub fn advance(&mut self, from: f64, to: &Sample<'_>, x: &mut [f64]) -> Result<()> {
        self.belief.x.copy_from_slice(x);
        self.propagation.driven.aim(from, to.t, to.inputs);
        let done = self.propagation.predict(&mut self.belief, from, to.t);
        // where an error ends it early, as far as it came
        x.copy_from_slice(&self.belief.x);
        done?;
        if let Some(settled) = &mut self.settled {
            self.propagation.carry(settled);
        }
        Ok(())
    }

    /// The flow's outputs, the entries of the Jacobians.
    fn evaluate(&mut self, t: f64, z: &[f64]) {
        let evaluation = &mut self.propagation.driven;
        evaluation.enter(t);
        evaluation.outputs(t, z, &mut self.values);
    }

    /// What every row draws anew.
    pub fn renew(&mut self) {
        let end = self.belief.root.n - self.sensors.len();
        for root in std::iter::once(&mut self.belief.root).chain(&mut self.settled) {
            (end - self.drawn..end).for_each(|place| read(root, place, &[], 1.0));
        }
    }

    /// The measurements of the sensors that report are new readings, with errors of their own; z is
    /// after them.
    pub fn reset(&mut self, t: f64, z: &[f64], readings: &[f64]) {
        self.evaluate(t, z);
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

    /// What is said of readings before they count, at z under the signals: h(x̂) is expected with the
    /// standard deviation of a reading around it, √(HPHᵀ + R), and the same once the start is forgotten.
    /// Nothing where readings are not judged, or the model has no value.
    pub fn judge(&mut self, sample: &Sample<'_>, z: &[f64], signals: &[f64]) {
        let Some(settled) = &self.settled else {
            return;
        };
        let expected = &mut self.expected;
        let is_known = expected.linearise(sample.t, z, signals).is_ok();
        let n = self.belief.root.n;
        let (mut row, mut projected) = (vec![0.0; n], vec![0.0; n]);
        for (i, innovation) in self.innovations.iter_mut().enumerate() {
            let reading = sample.readings.get(i).copied().unwrap_or(f64::NAN);
            if !(is_known && reading.is_finite()) {
                *innovation = Innovation::default();
                continue;
            }
            let predicted = expected.outputs()[i];
            let noise = self.sensors[i].noise.variance(predicted);
            expected.write_slopes(i, &mut row);
            let mut deviation = |root: &Root| (variance(root, &row, &mut projected) + noise).sqrt();
            *innovation = Innovation {
                value: reading - predicted,
                deviation: deviation(&self.belief.root),
                settled: deviation(settled),
                predicted,
                reading: Reading::Taken,
            };
        }
    }

    /// The standard deviations of the estimates at (t, z).
    pub fn measure(&mut self, t: f64, z: &[f64]) {
        self.evaluate(t, z);
        let n = self.belief.root.n;
        let (mut row, mut projected) = (vec![0.0; n], vec![0.0; n]);
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            self.jacobians.estimate.write_row(&self.values, i, &mut row);
            *deviation = variance(&self.belief.root, &row, &mut projected).sqrt();
        }
    }
}

/// The variance of a sum of the states, with such weights.
fn variance(root: &Root, weights: &[f64], projected: &mut [f64]) -> f64 {
    root.transposed_times(weights, projected);
    projected.iter().map(|p| p * p).sum()
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
    let places = (0..n).flat_map(|k| (0..n).map(move |i| i * n + k));
    let mut rows: Vec<f64> = places.map(|place| root.entries[place]).collect();
    rows.extend((0..n).map(|i| if i == state { deviation } else { 0.0 }));
    root.of_rows(&mut rows, &mut vec![]);
}

#[cfg(test)]
mod tests;
