//! A plant with its sensors and noises, compiled for filters.

use lynkeus_expr::{Graph, Node, jacobian};

use super::Bounds;
use crate::noise::Limits;
use crate::{Error, Level, System};

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
    pub confined: Option<Confined>,
}

/// The plant inside its declared ranges.
#[derive(Clone, Debug)]
pub struct Confined {
    /// f of the states limited to their ranges
    pub derivatives: Vec<Node>,
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
    /// x' = f; its outputs are the entries of F = ∂f/∂x
    pub(super) flow: System,
    /// no states; signals x, u; outputs h, then the entries of C = ∂h/∂x
    pub(super) output_map: System,
    /// places (row, column) of the entries of F
    pub(super) flow_entries: Vec<(usize, usize)>,
    /// places of the entries of C
    pub(super) output_entries: Vec<(usize, usize)>,
    pub(super) sensors: Vec<Sensor>,
    pub(super) process_noise: Vec<f64>,
    pub(super) initial_variance: Vec<f64>,
    pub(super) confined: Option<ConfinedFlow>,
}

/// [`Confined`], compiled.
#[derive(Clone, Debug)]
pub struct ConfinedFlow {
    /// x' = f of the states limited to their ranges; its outputs are the entries of its Jacobian
    pub flow: System,
    /// places (row, column) of these entries
    pub entries: Vec<(usize, usize)>,
    /// one pair per state
    pub bounds: Vec<Bounds>,
}

type Entries = Vec<(usize, usize)>;

impl FilterModel {
    /// Compiles a plant with its Jacobians.
    ///
    /// # Errors
    /// [`Error::MissingInput`] for an expression that reads another symbol; [`Error::Setting`]
    /// for a plant without states, a noise or a variance that is negative or not finite, and for wrong numbers of them.
    pub fn new(plant: &FilterPlant<'_>) -> Result<Self, Error> {
        check(plant)?;
        let graph = plant.graph;
        let symbols: Vec<Node> = plant.states.iter().map(|s| s.1).collect();
        let h: Vec<Node> = plant.sensors.iter().map(|s| s.output).collect();
        let C = jacobian::forward(graph, &h, &symbols);
        let entry = |(i, j, node): &(usize, usize, Node)| (format!("{i},{j}"), *node);
        let (flow, flow_entries) = linear(plant, &plant.derivatives)?;
        let confined = match &plant.confined {
            None => None,
            Some(Confined {
                derivatives,
                bounds,
            }) => {
                let (flow, entries) = linear(plant, derivatives)?;
                let bounds = bounds.clone();
                Some(ConfinedFlow {
                    flow,
                    entries,
                    bounds,
                })
            }
        };
        let states = plant
            .states
            .iter()
            .map(|(name, node, _)| (name.clone(), *node));
        let signals: Vec<(String, Node)> = states.chain(plant.inputs.iter().cloned()).collect();
        let outputs = plant.sensors.iter().map(|s| (s.name.clone(), s.output));
        let outputs: Vec<(String, Node)> = outputs.chain(C.entries.iter().map(entry)).collect();
        let output_map = System::new(graph, plant.time, &[], &signals, &[], &outputs)?;
        let places =
            |entries: &[(usize, usize, Node)]| entries.iter().map(|e| (e.0, e.1)).collect();
        Ok(Self {
            flow,
            output_map,
            flow_entries,
            confined,
            output_entries: places(&C.entries),
            sensors: plant.sensors.clone(),
            process_noise: plant.process_noise.clone(),
            initial_variance: plant.initial_variance.clone(),
        })
    }

    /// Number of states.
    #[must_use]
    pub fn dimension(&self) -> usize {
        self.flow.states().len()
    }

    /// Names of the states.
    #[must_use]
    pub fn states(&self) -> &[String] {
        self.flow.states()
    }

    /// What is measured.
    #[must_use]
    pub fn sensors(&self) -> &[Sensor] {
        &self.sensors
    }

    /// Names of the known inputs.
    #[must_use]
    pub fn inputs(&self) -> &[String] {
        self.flow.signals()
    }

    /// x' = f; its outputs are the entries of F = ∂f/∂x.
    #[must_use]
    pub fn flow(&self) -> &System {
        &self.flow
    }

    /// Places (row, column) of the entries of F.
    #[must_use]
    pub fn flow_entries(&self) -> &[(usize, usize)] {
        &self.flow_entries
    }

    /// No states; signals x, u; outputs h, then the entries of C = ∂h/∂x.
    #[must_use]
    pub fn output_map(&self) -> &System {
        &self.output_map
    }

    /// Places of the entries of C.
    #[must_use]
    pub fn output_entries(&self) -> &[(usize, usize)] {
        &self.output_entries
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
    pub fn confined(&self) -> Option<&ConfinedFlow> {
        self.confined.as_ref()
    }

    /// What is compiled.
    pub(crate) fn systems(&self) -> impl Iterator<Item = &System> {
        let confined = self.confined.iter().map(|c| &c.flow);
        [&self.flow, &self.output_map].into_iter().chain(confined)
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

/// A flow whose outputs are the entries of its Jacobian, and their places.
fn linear(plant: &FilterPlant<'_>, derivatives: &[Node]) -> Result<(System, Entries), Error> {
    let symbols: Vec<Node> = plant.states.iter().map(|s| s.1).collect();
    let F = jacobian::forward(plant.graph, derivatives, &symbols);
    let entry = |(i, j, node): &(usize, usize, Node)| (format!("{i},{j}"), *node);
    let outputs: Vec<(String, Node)> = F.entries.iter().map(entry).collect();
    let (states, inputs) = (&plant.states, &plant.inputs);
    let flow = System::new(
        plant.graph,
        plant.time,
        states,
        inputs,
        derivatives,
        &outputs,
    )?;
    Ok((flow, F.entries.iter().map(|e| (e.0, e.1)).collect()))
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
