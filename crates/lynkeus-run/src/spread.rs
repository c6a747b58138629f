//! How an observer's error spreads, for standard deviations.

use lynkeus_expr::{Graph, Node, jacobian};

use crate::filter::Belief;
use crate::filter::extended::Extended;
use crate::filter::root::Root;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{BetweenSamples, Dynamics, Error, EstimatorSettings, Level, Method, System};

/// The linearised error of an observer z' = F(t, z, u), x̂ = g(z): e' = (∂F/∂z) e + white
/// noise, driven by the declared noises of plant and sensors.
#[derive(Clone, Debug)]
pub struct ErrorModel {
    /// the observer; its outputs are the entries of ∂F/∂z, then those of ∂g/∂z
    flow: System,
    flow_entries: Vec<(usize, usize)>,
    estimate_entries: Vec<(usize, usize)>,
    estimates: usize,
    process_noise: Vec<f64>,
    initial_variance: Vec<f64>,
    noise: Vec<Level>,
}

/// What acts on an observer's error.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorNoise {
    /// spectral density on each state
    pub process: Vec<f64>,
    /// variance of each state at the start
    pub initial: Vec<f64>,
    /// of each sensor
    pub sensors: Vec<Level>,
}

impl ErrorModel {
    /// Compiles the linearisation of an observer: its states (the last ones are the held
    /// measurements), signals and derivatives, and its estimates.
    ///
    /// # Errors
    /// [`Error::MissingInput`], and [`Error::Setting`] for wrong numbers of noises.
    pub fn new(
        graph: &Graph,
        time: Node,
        states: &[(String, Node, f64)],
        signals: &[(String, Node)],
        derivatives: &[Node],
        estimates: &[Node],
        noise: ErrorNoise,
    ) -> Result<Self, Error> {
        for (what, count) in [
            ("process noise", noise.process.len()),
            ("initial variance", noise.initial.len()),
        ] {
            if count != states.len() {
                let expected = format!("{} numbers, one per state", states.len());
                return Err(Error::setting(what, expected, count));
            }
        }
        let symbols: Vec<Node> = states.iter().map(|s| s.1).collect();
        let F = jacobian::forward(graph, derivatives, &symbols);
        let G = jacobian::forward(graph, estimates, &symbols);
        let entries = F.entries.iter().chain(&G.entries);
        let outputs: Vec<(String, Node)> = entries
            .map(|&(i, j, node)| (format!("{i},{j}"), node))
            .collect();
        let places =
            |entries: &[(usize, usize, Node)]| entries.iter().map(|e| (e.0, e.1)).collect();
        Ok(Self {
            flow: System::new(graph, time, states, signals, derivatives, &outputs)?,
            flow_entries: places(&F.entries),
            estimate_entries: places(&G.entries),
            estimates: estimates.len(),
            process_noise: noise.process,
            initial_variance: noise.initial,
            noise: noise.sensors,
        })
    }
}

impl ErrorModel {
    /// The observer; its outputs are the entries of ∂F/∂z, then those of ∂g/∂z.
    pub fn flow(&self) -> &System {
        &self.flow
    }

    /// Places (row, column) of the entries of ∂F/∂z.
    pub fn flow_entries(&self) -> &[(usize, usize)] {
        &self.flow_entries
    }

    /// Places of the entries of ∂g/∂z.
    pub fn estimate_entries(&self) -> &[(usize, usize)] {
        &self.estimate_entries
    }

    /// Number of estimates, the rows of ∂g/∂z.
    pub fn estimates(&self) -> usize {
        self.estimates
    }

    /// What acts on the error.
    pub fn noise(&self) -> ErrorNoise {
        ErrorNoise {
            process: self.process_noise.clone(),
            initial: self.initial_variance.clone(),
            sensors: self.noise.clone(),
        }
    }

    /// What acts on the error, as text.
    pub(crate) fn noises(&self) -> String {
        format!(
            "{:?} {:?} {:?}",
            self.process_noise, self.initial_variance, self.noise
        )
    }
}

/// The covariance of an observer's states along its run.
#[derive(Clone, Debug)]
pub(crate) struct Spread {
    engine: Extended,
    belief: Belief,
    entries: Vec<(usize, usize)>,
    skipped: usize,
    values: Vec<f64>,
    noise: Vec<Level>,
    pub deviations: Vec<f64>,
}

impl Persist for Spread {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.engine.walk(walk)?;
        self.belief.walk(walk)?;
        walk.numbers(&mut self.deviations)
    }
}

impl Spread {
    pub fn new(model: &ErrorModel, method: Method) -> Result<Self, Error> {
        let run = EstimatorSettings {
            between: BetweenSamples::Hold,
            method,
        };
        Ok(Self {
            engine: Extended::new(&model.flow, &model.flow_entries, &model.process_noise, run)?,
            belief: Belief {
                x: model.flow.start().to_vec(),
                root: Root::diagonal(&model.initial_variance),
            },
            entries: model.estimate_entries.clone(),
            skipped: model.flow_entries.len(),
            values: vec![0.0; model.flow.outputs().len()],
            noise: model.noise.clone(),
            deviations: vec![0.0; model.estimates],
        })
    }

    /// The signals from here on.
    pub fn start(&mut self, signals: &[f64]) {
        self.engine.driven.start(signals);
    }

    /// State and covariance to a time.
    pub fn advance(&mut self, from: f64, to: f64, x: &mut [f64]) -> Result<(), Error> {
        self.belief.x.copy_from_slice(x);
        self.engine.predict(&mut self.belief, from, to, false)?;
        x.copy_from_slice(&self.belief.x);
        Ok(())
    }

    /// The held measurement of a sensor (its place among them) is a new reading, with an error
    /// of its own.
    pub fn reset(&mut self, sensor: usize, reading: f64) {
        let root = &mut self.belief.root;
        let n = root.n;
        let state = n - self.noise.len() + sensor;
        let variance = self.noise[sensor].variance(reading);
        root.entries[state * n..(state + 1) * n].fill(0.0);
        // one column more for the new error, then back to n
        let mut rows: Vec<f64> = (0..n)
            .flat_map(|k| (0..n).map(move |i| (i, k)))
            .map(|(i, k)| root.entries[i * n + k])
            .collect();
        rows.extend((0..n).map(|i| if i == state { variance.sqrt() } else { 0.0 }));
        root.of_rows(&mut rows);
    }

    /// The standard deviations of the estimates at (t, z).
    pub fn measure(&mut self, t: f64, z: &[f64]) {
        let evaluation = &mut self.engine.driven.evaluation;
        evaluation.enter(t);
        evaluation.outputs(t, z, &mut self.values);
        let n = self.belief.root.n;
        let mut projected = vec![0.0; n];
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            let mut row = vec![0.0; n];
            let values = self.entries.iter().zip(&self.values[self.skipped..]);
            for (&(_, j), value) in values.filter(|((estimate, _), _)| *estimate == i) {
                row[j] = *value;
            }
            self.belief.root.transposed_times(&row, &mut projected);
            *deviation = projected.iter().map(|p| p * p).sum::<f64>().sqrt();
        }
    }
}
