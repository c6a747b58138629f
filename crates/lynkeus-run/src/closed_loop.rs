//! Inputs, plant, sensors and observer as one system.

use std::sync::{Arc, Mutex};

use lynkeus_expr::{Expr, Graph, Node};

use crate::equations::{Equations, Roots};
use crate::events::Guards;
use crate::noise::{Level, Limits, Sensors};
use crate::{Dynamics, Error, Evaluation, Events, Role, Simulation, Slopes, System, Trajectory};

/// The place of a name among those that a system can read.
fn place(
    reader: &'static str,
    name: &str,
    among: &[String],
    available: &[String],
) -> Result<usize, Error> {
    let mut found = (0..among.len()).filter(|&i| among[i] == name);
    match (found.next(), found.next()) {
        (Some(place), None) => Ok(place),
        (None, _) => Err(Error::Unconnected {
            reader,
            name: name.to_owned(),
            available: available.join(", "),
        }),
        (Some(_), Some(_)) => Err(Error::Ambiguous {
            reader,
            name: name.to_owned(),
        }),
    }
}

/// A table with the columns that a run records.
pub(crate) fn table(plant: &System, observer: Option<&System>, record_outputs: bool) -> Trajectory {
    let mut table = Trajectory::default()
        .with(Role::State, plant.states())
        .with(Role::Input, plant.signals());
    if record_outputs {
        table = table
            .with(Role::Output, plant.outputs())
            .with(Role::Measured, plant.outputs());
    }
    match observer {
        Some(observer) => table.with(Role::Estimate, observer.estimates()),
        None => table,
    }
}

/// What runs, and where the signals of each system come from.
struct Wiring {
    inputs: System,
    plant: System,
    observer: Option<System>,
    /// which input each signal of the plant is
    plant_wires: Vec<usize>,
    /// which sensor each signal of the observer is, or, counted on from them, which input
    observer_wires: Vec<usize>,
    record_outputs: bool,
}

impl Wiring {
    fn new(simulation: &Simulation) -> Result<Self, Error> {
        let Simulation {
            plant,
            inputs,
            observer,
            ..
        } = simulation;
        if let Some(name) = inputs.signals().first() {
            return Err(Error::Unconnected {
                reader: "inputs",
                name: name.clone(),
                available: "time alone".to_owned(),
            });
        }
        let all = [plant.outputs(), inputs.outputs()].concat();
        let plant_wires = plant.signals().iter();
        let plant_wires = plant_wires.map(|name| place("plant", name, inputs.outputs(), &all));
        let observer_wires = observer.iter().flat_map(System::signals);
        let observer_wires = observer_wires.map(|name| place("observer", name, &all, &all));
        Ok(Self {
            plant_wires: plant_wires.collect::<Result<_, _>>()?,
            observer_wires: observer_wires.collect::<Result<_, _>>()?,
            inputs: inputs.clone(),
            plant: plant.clone(),
            observer: observer.clone(),
            record_outputs: simulation.record_outputs,
        })
    }

    fn parts(&self) -> impl Iterator<Item = &System> {
        [&self.inputs, &self.plant]
            .into_iter()
            .chain(&self.observer)
    }

    /// The signals of the observer, given the inputs and what the sensors show.
    fn observed<T: Copy>(&self, u: &[T], shown: &[T]) -> Vec<T> {
        let all = [shown, u].concat();
        self.observer_wires.iter().map(|&wire| all[wire]).collect()
    }

    /// One system: its states are the plant's, then the observer's, its signals what disturbs each
    /// sensor and each moved state, its outputs the values of a row.
    fn joined(&self, sensors: &Sensors) -> Result<System, Error> {
        let g = Graph::new();
        let symbols = Symbols::new(&g, self, sensors);
        let roots = self.roots(sensors, &symbols);
        let held = self.parts().flat_map(|part| part.equations().held.clone());
        let switches = self
            .parts()
            .flat_map(|part| part.equations().switches.clone());
        let modes = self.parts().flat_map(|part| part.equations().modes.clone());
        let of_observer = self.observer.iter().flat_map(System::states);
        let of_observer = of_observer.map(|name| format!("observer's {name}"));
        let equations = Equations {
            states: self
                .plant
                .states()
                .iter()
                .cloned()
                .chain(of_observer)
                .collect(),
            signals: vec![String::new(); symbols.noise.len() + symbols.drives.len()],
            outputs: vec![String::new(); roots.outputs.len()],
            inputs: symbols.all(),
            roots,
            switches: switches.collect(),
            modes: modes.collect(),
            held: held.collect(),
            graph: Mutex::new(g),
        };
        let start = self.plant.start().iter();
        let start = start.chain(self.observer.iter().flat_map(System::start));
        System::compiled(equations, start.copied().collect())
    }

    fn roots(&self, sensors: &Sensors, symbols: &Symbols<'_>) -> Roots {
        let inputs = symbols.over(&self.inputs, [&[], &[], &symbols.modes[0], &[]]);
        let u = inputs.outputs;
        let w: Vec<Node> = self.plant_wires.iter().map(|&wire| u[wire]).collect();
        let mut all = symbols.over(
            &self.plant,
            [&symbols.plant_x, &w, &symbols.modes[1], &symbols.plant_held],
        );
        for derivatives in [&mut all.derivatives, &mut all.held_derivatives] {
            for (state, &drive) in sensors.moved().zip(&symbols.drives) {
                let g = symbols.graph;
                derivatives[state] = (g.expr(derivatives[state]) + g.expr(drive)).node();
            }
        }
        // the values of a row, and what its estimates are
        let row = |y: &[Node]| {
            let shown = symbols.shown(sensors, y);
            let mut row = [&symbols.plant_x[..], &w].concat();
            if self.record_outputs {
                row.extend(y.iter().chain(&shown));
            }
            let Some(observer) = &self.observer else {
                return (row, Roots::default());
            };
            let signals = self.observed(&u, &shown);
            let held = &symbols.observer_held;
            let made = symbols.over(
                observer,
                [&symbols.observer_x, &signals, &symbols.modes[2], held],
            );
            (row, made)
        };
        let estimates = |outputs: &[Node]| match outputs.is_empty() {
            true => match &self.observer {
                Some(_) => symbols.observer_x.clone(),
                None => vec![],
            },
            false => outputs.to_vec(),
        };
        let (mut outputs, observer) = row(&all.outputs);
        let (mut held_outputs, held) = match all.held_outputs == all.outputs {
            true => (outputs.clone(), observer.clone()),
            false => row(&all.held_outputs),
        };
        outputs.extend(estimates(&observer.outputs));
        held_outputs.extend(estimates(&held.held_outputs));
        let joined = |plant: &[Node], observer: &[Node]| [plant, observer].concat();
        Roots {
            derivatives: joined(&all.derivatives, &observer.derivatives),
            held_derivatives: joined(&all.held_derivatives, &held.held_derivatives),
            surfaces: joined(&all.surfaces, &held.surfaces),
            bends: joined(&all.bends, &held.bends),
            outputs,
            held_outputs,
        }
    }
}

/// The inputs of the joined system.
struct Symbols<'g> {
    graph: &'g Graph,
    time: Node,
    plant_x: Vec<Node>,
    observer_x: Vec<Node>,
    noise: Vec<Node>,
    drives: Vec<Node>,
    /// of inputs, plant and observer
    modes: [Vec<Node>; 3],
    plant_held: Vec<Node>,
    observer_held: Vec<Node>,
}

impl<'g> Symbols<'g> {
    fn new(graph: &'g Graph, wiring: &Wiring, sensors: &Sensors) -> Self {
        let Wiring {
            inputs,
            plant,
            observer,
            ..
        } = wiring;
        let fresh = |count: usize| (0..count).map(|_| graph.fresh("x").node()).collect();
        let of_observer = |count: fn(&System) -> usize| fresh(observer.as_ref().map_or(0, count));
        Self {
            graph,
            time: graph.fresh("time").node(),
            plant_x: fresh(plant.states().len()),
            observer_x: of_observer(|o| o.states().len()),
            noise: fresh(plant.outputs().len()),
            drives: fresh(sensors.moved().count()),
            modes: [
                fresh(inputs.modes()),
                fresh(plant.modes()),
                of_observer(System::modes),
            ],
            plant_held: fresh(plant.equations().held_modes()),
            observer_held: of_observer(|o| o.equations().held_modes()),
        }
    }

    /// A system over its states, signals, modes and held modes.
    fn over(&self, system: &System, arguments: [&[Node]; 4]) -> Roots {
        let arguments = [&[self.time][..], &arguments.concat()].concat();
        system.equations().over(self.graph, &arguments)
    }

    /// What the sensors show.
    fn shown(&self, sensors: &Sensors, y: &[Node]) -> Vec<Node> {
        let shown = |(i, &y): (usize, &Node)| {
            let (y, noise) = (self.graph.expr(y), self.graph.expr(self.noise[i]));
            let disturbed = match sensors.level(i) {
                None => y,
                Some(Level::Relative(_)) => y * noise,
                Some(Level::Absolute(_) | Level::Uniform(_)) => y + noise,
            };
            let limited = |Limits { low, high }| -> Expr<'_> {
                let capped = disturbed.min(self.graph.constant(high));
                capped.max(self.graph.constant(low))
            };
            sensors.limits(i).map_or(disturbed, limited).node()
        };
        y.iter().enumerate().map(shown).collect()
    }

    /// In the order of a system's inputs.
    fn all(&self) -> Vec<Node> {
        [
            &[self.time],
            &self.plant_x[..],
            &self.observer_x,
            &self.noise,
            &self.drives,
            &self.modes.concat(),
            &self.plant_held,
            &self.observer_held,
        ]
        .concat()
    }
}

/// A closed loop under way.
pub(crate) struct Loop {
    joined: Evaluation,
    sensors: Sensors,
    wiring: Wiring,
    /// plant and observer are on known sides of the surfaces on which they jump
    is_held: bool,
}

/// Inputs, plant and observer by themselves, where the loop is: a message names one of them.
struct Parts {
    inputs: Evaluation,
    plant: Evaluation,
    observer: Option<Evaluation>,
    /// inputs and outputs of the plant are finite numbers
    inputs_are_finite: bool,
    outputs_are_finite: bool,
}

impl Loop {
    pub(crate) fn new(simulation: &Simulation, sensors: Sensors) -> Result<Self, Error> {
        let wiring = Wiring::new(simulation)?;
        Ok(Self {
            joined: wiring.joined(&sensors)?.evaluation(),
            sensors,
            wiring,
            is_held: false,
        })
    }

    /// Plant and observer as one system, whose outputs are the values of a row.
    pub(crate) fn system(&self) -> &System {
        self.joined.system()
    }

    /// A table with the recorded columns.
    pub(crate) fn table(&self) -> Trajectory {
        let Wiring {
            plant, observer, ..
        } = &self.wiring;
        table(plant, observer.as_ref(), self.wiring.record_outputs)
    }

    /// Columns that are not estimates.
    pub(crate) fn known_columns(&self) -> usize {
        let plant = &self.wiring.plant;
        let outputs = match self.wiring.record_outputs {
            true => 2 * plant.outputs().len(),
            false => 0,
        };
        plant.states().len() + plant.signals().len() + outputs
    }

    /// Names and values of the observer's states.
    pub(crate) fn estimate<'a>(&'a self, x: &'a [f64]) -> (&'a [String], &'a [f64]) {
        let observer = self.wiring.observer.as_ref();
        let names = observer.map_or(&[][..], System::states);
        (names, &x[self.wiring.plant.states().len()..])
    }

    /// The values of what jumps with time, since the last [`Events::enter`].
    pub(crate) fn modes(&self) -> &[f64] {
        self.joined.modes()
    }

    /// Draws the next noise sample.
    pub(crate) fn draw(&mut self) {
        self.sensors.draw();
        self.disturb();
    }

    /// Draws what moves the states, between two samples.
    pub(crate) fn stir(&mut self) {
        self.sensors.stir();
        self.disturb();
    }

    fn disturb(&mut self) {
        let signals = self.joined.signals_mut().iter_mut();
        for (signal, value) in signals.zip(self.sensors.disturbances()) {
            *signal = value;
        }
    }

    /// True without noise.
    pub(crate) fn is_exact(&self) -> bool {
        self.sensors.are_exact()
    }

    /// An error that ended the run at `x`, by its cause where that is the observer.
    pub(crate) fn explained(&mut self, error: Error, x: &[f64], scale: f64) -> Error {
        let Some(time) = error.time() else {
            return error;
        };
        let (plant_x, observer_x) = x.split_at(self.wiring.plant.states().len());
        let scale = plant_x.iter().fold(scale, |most, x| most.max(x.abs()));
        match self.parts(time, plant_x).observer {
            Some(mut observer) => observer.explained(error, observer_x, scale),
            None => error,
        }
    }

    /// Appends the recorded values at (t, x), in the order of [`Loop::table`].
    pub(crate) fn row(&mut self, t: f64, x: &[f64], row: &mut Vec<f64>) -> Result<(), Error> {
        row.resize(self.system().outputs().len(), 0.0);
        self.joined.outputs(t, x, row);
        match row.iter().all(|v| v.is_finite()) {
            true => Ok(()),
            false => Err(self.not_finite(t, x)),
        }
    }

    /// The parts at a time and a state of the plant.
    fn parts(&self, t: f64, plant_x: &[f64]) -> Parts {
        let (mut modes, mut held) = (self.joined.modes(), self.joined.held_modes());
        let mut part = |system: &System| {
            let mut evaluation = system.evaluation();
            let (own, rest) = modes.split_at(system.modes());
            let (own_held, rest_held) = held.split_at(system.equations().held_modes());
            evaluation.enter_modes(own, self.is_held.then_some(own_held));
            (modes, held) = (rest, rest_held);
            evaluation
        };
        let mut inputs = part(&self.wiring.inputs);
        let mut plant = part(&self.wiring.plant);
        let mut observer = self.wiring.observer.as_ref().map(part);
        let mut u = vec![0.0; inputs.system().outputs().len()];
        inputs.outputs(t, &[], &mut u);
        let signals = plant.signals_mut().iter_mut();
        for (signal, &wire) in signals.zip(&self.wiring.plant_wires) {
            *signal = u[wire];
        }
        let mut y = vec![0.0; plant.system().outputs().len()];
        plant.outputs(t, plant_x, &mut y);
        let measured = |(i, &y): (usize, &f64)| self.sensors.measured(i, y);
        let shown: Vec<f64> = y.iter().enumerate().map(measured).collect();
        if let Some(observer) = &mut observer {
            let signals = self.wiring.observed(&u, &shown);
            observer.signals_mut().copy_from_slice(&signals);
        }
        Parts {
            inputs,
            plant,
            observer,
            inputs_are_finite: are_finite(&u),
            outputs_are_finite: are_finite(&y),
        }
    }
}

fn are_finite(values: &[f64]) -> bool {
    values.iter().all(|v| v.is_finite())
}

impl Dynamics for Loop {
    fn dimension(&self) -> usize {
        self.joined.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.joined.derivatives(t, x, dx);
    }

    /// What is held is looked at by differences.
    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        !self.is_held && self.joined.slopes(t, x, slopes)
    }

    fn step(&mut self, t: f64, h: f64, x: &[f64], next: &mut [f64]) -> bool {
        self.joined.step(t, h, x, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn names(&self) -> Vec<String> {
        self.joined.names()
    }

    /// Blames the first part whose values are not finite.
    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        let (plant_x, observer_x) = x.split_at(self.wiring.plant.states().len());
        let mut parts = self.parts(t, plant_x);
        if !parts.inputs_are_finite {
            return parts.inputs.not_finite(t, &[]);
        }
        let mut dx = vec![0.0; plant_x.len()];
        parts.plant.derivatives(t, plant_x, &mut dx);
        match &mut parts.observer {
            Some(observer) if parts.outputs_are_finite && are_finite(&dx) => {
                observer.not_finite(t, observer_x)
            }
            _ => parts.plant.not_finite(t, plant_x),
        }
    }
}

impl Events for Loop {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.joined.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.joined.enter(t);
        self.disturb();
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.joined.guards()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.joined.indicators(t, x, values);
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        self.is_held = sides.is_some();
        self.joined.hold(sides);
    }

    fn beside(&mut self, t: f64, values: &mut Vec<[f64; 2]>) {
        self.joined.beside(t, values);
    }
}
