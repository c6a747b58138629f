//! A plant with its sensors and noises, compiled for filters.

use lynkeus_expr::{Graph, Node};

use super::belief::Bounds;
use crate::noise::{Level, Limits};
use crate::{Error, Linearised, System};

/// What a filter has to know: x' = f(t, x, u) + w, y_i = h_i(t, x, u) + v_i.
#[derive(Clone, Debug)]
pub struct FilterPlant<'g> {
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
    /// f and where the states can be, for where f has no value outside; none without ranges
    pub confined: Option<Confined<Vec<Node>>>,
}

/// A flow x' = f and the ranges to which f limits the states: its equations, compiled, or in a filter.
#[derive(Clone, Debug)]
pub struct Confined<F> {
    /// f of the states limited to their ranges
    pub flow: F,
    /// one pair per state
    pub bounds: Vec<Bounds>,
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

/// A [`FilterPlant`], compiled: cheap to clone, independent of its graph.
#[derive(Clone, Debug)]
pub struct FilterModel {
    /// x' = f with F = ∂f/∂x
    pub(super) flow: Linearised,
    /// h with C = ∂h/∂x
    pub(super) output_map: Linearised,
    pub(super) sensors: Vec<Sensor>,
    pub(super) process_noise: Vec<f64>,
    pub(super) initial_variance: Vec<f64>,
    pub(super) confined: Option<Confined<Linearised>>,
}

impl FilterModel {
    /// Compiles a plant with its Jacobians.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol; [`Error::Setting`]
    /// for a plant without states, a noise or a variance that is negative or not finite, and for wrong numbers of them.
    pub fn new(plant: &FilterPlant<'_>) -> Result<Self, Error> {
        check(plant)?;
        let FilterPlant {
            graph,
            time,
            states,
            inputs,
            ..
        } = plant;
        let flow = |f: &[Node]| Linearised::flow(graph, *time, states, inputs, f);
        let confined = match &plant.confined {
            None => None,
            Some(confined) => Some(Confined {
                flow: flow(&confined.flow)?,
                bounds: confined.bounds.clone(),
            }),
        };
        let outputs = plant.sensors.iter().map(|s| (s.name.clone(), s.output));
        let outputs: Vec<(String, Node)> = outputs.collect();
        Ok(Self {
            flow: flow(&plant.derivatives)?,
            output_map: Linearised::output_map(graph, *time, states, inputs, &outputs)?,
            confined,
            sensors: plant.sensors.clone(),
            process_noise: plant.process_noise.clone(),
            initial_variance: plant.initial_variance.clone(),
        })
    }

    /// Number of states.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.flow.system().states().len()
    }

    /// Names of the states.
    #[must_use]
    pub fn states(&self) -> &[String] {
        self.flow.system().states()
    }

    /// What is measured.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Names of the known inputs.
    #[must_use]
    pub fn inputs(&self) -> &[String] {
        self.flow.system().signals()
    }

    /// x' = f with F = ∂f/∂x.
    #[must_use]
    pub fn flow(&self) -> &Linearised {
        &self.flow
    }

    /// h with C = ∂h/∂x: no states, signals x, u.
    #[must_use]
    pub fn output_map(&self) -> &Linearised {
        &self.output_map
    }

    /// Spectral density of the noise on each derivative.
    #[must_use]
    pub fn process_noise(&self) -> &[f64] {
        &self.process_noise
    }

    /// Variance of the first estimate.
    #[must_use]
    pub fn initial_variance(&self) -> &[f64] {
        &self.initial_variance
    }

    /// The plant inside its declared ranges, for where it has no value outside.
    #[must_use]
    pub fn confined(&self) -> Option<&Confined<Linearised>> {
        self.confined.as_ref()
    }

    /// What is compiled.
    pub(crate) fn systems(&self) -> impl Iterator<Item = &System> {
        let confined = self.confined.iter().map(|c| &c.flow);
        let all = [&self.flow, &self.output_map].into_iter().chain(confined);
        all.map(Linearised::system)
    }

    /// Noises, limits and bounds, as text.
    pub(crate) fn numbers(&self) -> String {
        let sensors: Vec<_> = self.sensors.iter().map(|s| (s.noise, s.limits)).collect();
        let bounds = self.confined.as_ref().map(|c| &c.bounds);
        let (q, p) = (&self.process_noise, &self.initial_variance);
        format!("{sensors:?} {q:?} {p:?} {bounds:?}")
    }

    /// The same plant from other first estimates.
    ///
    /// # Errors
    /// As [`System::with_start`].
    pub fn with_start(mut self, start: Vec<f64>) -> Result<Self, Error> {
        self.flow = self.flow.with_start(start)?;
        Ok(self)
    }
}

fn check(plant: &FilterPlant<'_>) -> Result<(), Error> {
    let n = plant.states.len();
    if n == 0 {
        return Err(Error::setting("number of states", "1 at least", n));
    }
    let lists = [
        ("process noise", &plant.process_noise),
        ("initial variance", &plant.initial_variance),
    ];
    for (what, values) in lists {
        if values.len() != n {
            return Err(Error::setting(
                what,
                format!("{n} numbers, one per state"),
                values.len(),
            ));
        }
        for ((name, ..), value) in plant.states.iter().zip(values) {
            if !(*value >= 0.0 && value.is_finite()) {
                let what = format!("{what} of '{name}'");
                return Err(Error::setting(what, "a finite number, 0 or above", value));
            }
        }
    }
    for sensor in &plant.sensors {
        let size = sensor.noise.size();
        if !(size >= 0.0 && size.is_finite()) {
            let what = format!("noise of '{}'", sensor.name);
            return Err(Error::setting(what, "a finite number, 0 or above", size));
        }
        if let Some(Limits { low, high }) = sensor.limits
            && (low.is_nan() || high.is_nan() || low >= high)
        {
            let what = format!("limits of '{}'", sensor.name);
            return Err(Error::setting(
                what,
                "a lower and a higher number",
                format!("[{low}, {high}]"),
            ));
        }
    }
    Ok(())
}
