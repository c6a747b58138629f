//! A plant with its sensors and noises, compiled for what follows a covariance.

use std::cmp::Ordering;
use std::fmt::Write;

use lynkeus_expr::{Graph, Node};
use lynkeus_model::Whens;

use super::belief::Belief;
use crate::manifold::Manifold;
use crate::noise::{Level, Limits, check_size};
use crate::snapshot::Digest;
use crate::{Error, Linearised, Result};

/// x' = f(t, x, u) + w, y_i = h_i(t, x, u) + v_i with white noises w, v.
#[derive(Clone, Debug)]
pub struct NoisyPlant<'g> {
    /// the graph of all expressions
    pub graph: &'g Graph,
    /// the symbol of time
    pub time: Node,
    /// name, symbol and first estimate of each state
    pub states: Vec<(String, Node, f64)>,
    /// f, one per state
    pub derivatives: Vec<Node>,
    /// known inputs u: name and symbol
    pub inputs: Vec<(String, Node)>,
    /// what is measured
    pub sensors: Vec<Sensor>,
    /// spectral density of the white noise w on each derivative, (unit of the state)² per unit
    /// of time
    pub process_noise: Vec<f64>,
    /// variance of the first estimate
    pub initial_variance: Vec<f64>,
    /// where the states can be, one pair per state; empty where nothing is declared
    pub ranges: Vec<Limits>,
    /// f of the states limited to their ranges, for where f has no value outside
    pub confined: Option<Vec<Node>>,
    /// by which the states jump; none where they never do
    pub whens: Whens,
}

/// A measured output.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// name of the output
    pub name: String,
    /// h(t, x, u)
    pub output: Node,
    /// how strong the noise v is; a share is one of the value that the model predicts
    pub noise: Level,
    /// a reading at one of them only says "at most" or "at least"
    pub limits: Option<Limits>,
}

/// A [`NoisyPlant`], compiled: independent of its graph.
#[derive(Clone, Debug)]
pub struct NoisyModel {
    /// x' = f with F = ∂f/∂x
    pub flow: Linearised,
    /// h with C = ∂h/∂x: no states, signals x, u
    pub output_map: Linearised,
    /// what is measured
    pub sensors: Vec<Sensor>,
    /// spectral density of the noise on each derivative
    pub process_noise: Vec<f64>,
    /// variance of the first estimate
    pub initial_variance: Vec<f64>,
    /// where the states can be
    pub ranges: Vec<Limits>,
    /// the flow inside the ranges
    pub confined: Option<Linearised>,
    /// where the states and the readings live
    pub manifold: Manifold,
    /// of an observer: the place of the state that stands for what held measurements lag behind
    pub(crate) lag: Option<usize>,
    /// so many of the states, the last but for the measurements of an observer, are drawn anew in every row
    pub(crate) drawn: usize,
    /// how many functions of the states are estimated; the flow has their slopes where they are not the
    /// states
    pub(crate) estimates: usize,
}

impl NoisyModel {
    /// Compiles a plant with its Jacobians.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol; [`Error::Setting`]
    /// for a plant without states, a noise or a variance that is negative or not finite, and for wrong numbers of them.
    pub fn new(plant: &NoisyPlant<'_>) -> Result<Self> {
        check(plant)?;
        let flow = |f: &Vec<Node>| {
            let (graph, time, states) = (plant.graph, plant.time, &plant.states);
            Linearised::flow(graph, time, states, &plant.inputs, f, &plant.whens)
        };
        let confined = plant.confined.as_ref().map(flow);
        Self::of(plant, flow(&plant.derivatives)?, confined.transpose()?)
    }

    /// With flows that are compiled already.
    pub(crate) fn of(
        plant: &NoisyPlant<'_>,
        flow: Linearised,
        confined: Option<Linearised>,
    ) -> Result<Self> {
        let outputs = plant.sensors.iter().map(|s| (s.name.clone(), s.output));
        let outputs: Vec<(String, Node)> = outputs.collect();
        let (graph, time, signals) = (plant.graph, plant.time, &plant.inputs);
        Ok(Self {
            flow,
            output_map: Linearised::output_map(graph, time, &plant.states, signals, &outputs)?,
            sensors: plant.sensors.clone(),
            process_noise: plant.process_noise.clone(),
            initial_variance: plant.initial_variance.clone(),
            ranges: plant.ranges.clone(),
            confined,
            manifold: Manifold::default(),
            lag: None,
            drawn: 0,
            estimates: plant.states.len(),
        })
    }

    /// The same with so many last states that are drawn anew in every row: those of
    /// [`Drawn`](super::Drawn), which nobody estimates.
    #[must_use]
    pub fn drawing(mut self, count: usize) -> Self {
        self.drawn = count;
        self
    }

    /// How many of the states are drawn anew in every row.
    #[must_use]
    pub fn drawn(&self) -> usize {
        self.drawn
    }

    /// The same with states and readings that live elsewhere than among the real numbers: quaternions start with
    /// length 1, the density of the noise on each of their numbers is a quarter of that on the vector of the rotation,
    /// and so is the variance.
    #[must_use]
    pub fn on(mut self, manifold: Manifold) -> Self {
        self.manifold = manifold;
        self
    }

    /// Where a filter starts: its estimate, and the lower root of its covariance row by row.
    #[must_use]
    pub fn start(&self) -> (Vec<f64>, Vec<f64>) {
        let start = self.flow.system().start();
        let Belief { x, root } = Belief::on(&self.manifold, start, &self.initial_variance);
        (x, root.entries)
    }

    /// The same with the numbers of a plant whose expressions are those of this one: where it starts, variances,
    /// noises, limits and ranges. The code is shared.
    ///
    /// # Errors
    /// [`Error::Setting`] for numbers that are impossible, and for other numbers of them.
    pub fn with_numbers(&self, plant: &NoisyPlant<'_>) -> Result<Self> {
        check(plant)?;
        let mut changed = self.clone();
        for flow in [&mut changed.flow].into_iter().chain(&mut changed.confined) {
            flow.start_at(plant.states.iter().map(|state| state.2).collect())?;
        }
        changed.sensors.clone_from(&plant.sensors);
        changed.process_noise.clone_from(&plant.process_noise);
        changed.initial_variance.clone_from(&plant.initial_variance);
        changed.ranges.clone_from(&plant.ranges);
        Ok(changed)
    }

    /// Starts here from now on, with such variances and densities.
    ///
    /// # Errors
    /// [`Error::Setting`] for numbers that are impossible.
    pub(crate) fn start_with(
        &mut self,
        start: Vec<f64>,
        variances: Vec<f64>,
        densities: Vec<f64>,
    ) -> Result<()> {
        for (what, values) in [
            ("process noise", &densities),
            ("initial variance", &variances),
        ] {
            for (name, value) in self.flow.system().states().iter().zip(values) {
                check_size(what, name, *value)?;
            }
        }
        for flow in [&mut self.flow].into_iter().chain(&mut self.confined) {
            flow.start_at(start.clone())?;
        }
        (self.process_noise, self.initial_variance) = (densities, variances);
        Ok(())
    }

    /// Equations, noises, limits and ranges.
    pub(crate) fn tell(&self, digest: &mut Digest) {
        let all = [&self.flow, &self.output_map].into_iter();
        for part in all.chain(&self.confined) {
            part.system().tell(digest);
        }
        let sensors: Vec<_> = self.sensors.iter().map(|s| (s.noise, s.limits)).collect();
        let (q, p) = (&self.process_noise, &self.initial_variance);
        // a digest takes any text
        let _ = write!(digest, "{sensors:?} {q:?} {p:?} {:?}", self.ranges);
        if !self.manifold.is_flat() {
            let _ = write!(digest, "{:?}", self.manifold);
        }
        if self.drawn > 0 {
            let _ = write!(digest, "drawn {}", self.drawn);
        }
    }
}

/// That there is a density and a variance for each state.
pub(crate) fn check_counts(plant: &NoisyPlant<'_>) -> Result<()> {
    let n = plant.states.len();
    for (what, values) in lists(plant) {
        if values.len() != n {
            let expected = format!("{n} numbers, one per state");
            return Err(Error::setting(what, expected, values.len()));
        }
    }
    Ok(())
}

fn lists<'p>(plant: &'p NoisyPlant<'_>) -> [(&'static str, &'p [f64]); 2] {
    [
        ("process noise", &plant.process_noise),
        ("initial variance", &plant.initial_variance),
    ]
}

fn check(plant: &NoisyPlant<'_>) -> Result<()> {
    if plant.states.is_empty() {
        return Err(Error::setting("number of states", "1 at least", 0));
    }
    check_counts(plant)?;
    for (what, values) in lists(plant) {
        for ((name, ..), value) in plant.states.iter().zip(values) {
            check_size(what, name, *value)?;
        }
    }
    for sensor in &plant.sensors {
        check_size("noise", &sensor.name, sensor.noise.size())?;
        if let Some(Limits { low, high }) = sensor.limits
            && low.partial_cmp(&high) != Some(Ordering::Less)
        {
            let what = format!("limits of '{}'", sensor.name);
            let found = format!("[{low}, {high}]");
            return Err(Error::setting(what, "a lower and a higher number", found));
        }
    }
    Ok(())
}
