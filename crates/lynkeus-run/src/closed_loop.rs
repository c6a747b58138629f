//! Inputs, plant, sensors and observer as one system.

use std::sync::{Arc, Mutex};

use lynkeus_expr::{Graph, Node, Nodes, Reals};

use crate::equations::{Both, Equations, Roots};
use crate::events::{Clauses, Memory, Seen};
use crate::method::are_finite;
use crate::noise::Sensors;
use crate::{Dynamics, Error, Evaluation, Events, Result, Simulation, Slopes, System};

/// The place of a name among those that a system can read.
fn place(
    reader: &'static str,
    name: &str,
    among: &[String],
    available: &[String],
) -> Result<usize> {
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

/// What runs, and where the signals of each system come from.
struct Wiring {
    simulation: Simulation,
    /// which input each signal of the plant is
    plant_wires: Vec<usize>,
    /// which sensor each signal of the observer is, or, counted on from them, which input
    observer_wires: Vec<usize>,
}

/// The inputs of the joined system.
struct Symbols {
    time: Node,
    noise: Vec<Node>,
    drives: Vec<Node>,
    errors: Vec<Node>,
    /// of inputs, plant and observer: states, modes and held modes
    own: [[Vec<Node>; 3]; 3],
}

impl Wiring {
    fn new(simulation: &Simulation) -> Result<Self> {
        let Simulation { plant, inputs, .. } = simulation;
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
        let observer_wires = simulation.observer.iter().flat_map(System::signals);
        let observer_wires = observer_wires.map(|name| place("observer", name, &all, &all));
        Ok(Self {
            plant_wires: plant_wires.collect::<Result<_, _>>()?,
            observer_wires: observer_wires.collect::<Result<_, _>>()?,
            simulation: simulation.clone(),
        })
    }

    fn parts(&self) -> impl Iterator<Item = &System> {
        let Simulation { plant, inputs, .. } = &self.simulation;
        [inputs, plant].into_iter().chain(&self.simulation.observer)
    }

    /// The signals of the plant, given the inputs.
    fn applied<T: Copy>(&self, u: &[T]) -> Vec<T> {
        self.plant_wires.iter().map(|&wire| u[wire]).collect()
    }

    /// The signals of the observer, given the inputs and what the sensors show.
    fn observed<T: Copy>(&self, u: &[T], shown: &[T]) -> Vec<T> {
        let all = [shown, u].concat();
        self.observer_wires.iter().map(|&wire| all[wire]).collect()
    }

    /// One system: its states are the plant's, then the observer's, its signals what disturbs each
    /// sensor, each moved state and each input that is misread, its outputs the values of a row.
    fn joined(&self, sensors: &Sensors) -> Result<System> {
        let Simulation { plant, inputs, .. } = &self.simulation;
        let observer = self.simulation.observer.as_ref();
        let g = Graph::new();
        let fresh = |count: usize| (0..count).map(|_| g.fresh("x").node()).collect::<Vec<_>>();
        let own = |part: Option<&System>| {
            let counts = part.map(|p| [p.states().len(), p.modes(), p.equations().jumps.len()]);
            counts.unwrap_or_default().map(fresh)
        };
        let symbols = Symbols {
            time: g.fresh("time").node(),
            noise: fresh(plant.outputs().len()),
            drives: fresh(sensors.moved().count()),
            errors: fresh(sensors.misread()),
            own: [Some(inputs), Some(plant), observer].map(own),
        };
        let free = self.roots(&g, sensors, &symbols, false).held;
        let roots = Roots {
            free,
            ..self.roots(&g, sensors, &symbols, true)
        };
        let (mut switches, mut jumps, mut surfaces) = (vec![], vec![], 0);
        for part in self.parts().map(System::equations) {
            switches.extend_from_slice(&part.switches);
            jumps.extend(part.jumps.iter().map(|jump| jump.after(surfaces)));
            surfaces += part.roots.surfaces.len();
        }
        let of_observer = observer.into_iter().flat_map(System::states);
        let of_observer = of_observer.map(|name| format!("observer's {name}"));
        let equations = Equations {
            states: plant.states().iter().cloned().chain(of_observer).collect(),
            signals: vec![String::new(); symbols.disturbances().len()],
            outputs: vec![String::new(); roots.free.outputs.len()],
            inputs: symbols.all(),
            roots,
            switches,
            jumps,
            graph: Mutex::new(g),
        };
        let start = self.parts().flat_map(System::start).copied();
        System::compiled(equations, start.collect())
    }

    /// What the joined system computes, of `held` alone: with what jumps with the state held, or as
    /// the state says.
    fn roots(&self, g: &Graph, sensors: &Sensors, symbols: &Symbols, is_held: bool) -> Roots {
        let over = |part: &System, [states, modes, held]: &[Vec<Node>; 3], signals: &[Node]| {
            let arguments = [&[symbols.time], &states[..], signals, modes, held].concat();
            let mut roots = part.equations().over(g, &arguments);
            if !is_held {
                roots.held = std::mem::take(&mut roots.free);
            }
            roots
        };
        let simulation = &self.simulation;
        let [own_inputs, own_plant, own_observer] = &symbols.own;
        let u = over(&simulation.inputs, own_inputs, &[]).held.outputs;
        let w = self.applied(&u);
        let mut roots = over(&simulation.plant, own_plant, &w);
        let Both {
            derivatives,
            outputs: y,
        } = &mut roots.held;
        for (state, &drive) in sensors.moved().zip(&symbols.drives) {
            derivatives[state] = (g.expr(derivatives[state]) + g.expr(drive)).node();
        }
        let shown = sensors.shown(&Nodes(g), y, &symbols.noise);
        let read = sensors.read(&Nodes(g), &u, &symbols.errors);
        let mut row = [&own_plant[0][..], &w].concat();
        if simulation.record_outputs {
            row.extend(y.iter().chain(&shown));
            if !simulation.noise.inputs.is_empty() {
                row.extend(self.applied(&read));
            }
        }
        if let Some(observer) = &simulation.observer {
            let made = over(observer, own_observer, &self.observed(&read, &shown));
            roots.surfaces.extend(made.surfaces);
            roots.bends.extend(made.bends);
            roots.whens = roots.whens.or(made.whens);
            derivatives.extend(made.held.derivatives);
            row.extend(match observer.outputs().is_empty() {
                true => &own_observer[0],
                false => &made.held.outputs,
            });
        }
        *y = row;
        roots
    }
}

impl Symbols {
    /// In the order of a system's inputs.
    fn all(&self) -> Vec<Node> {
        let [states, modes, held] = [0, 1, 2].map(|kind| {
            let parts = self.own.iter().flat_map(|own| &own[kind]);
            parts.copied().collect::<Vec<_>>()
        });
        [vec![self.time], states, self.disturbances(), modes, held].concat()
    }

    /// In the order of [`Sensors::disturbances`].
    fn disturbances(&self) -> Vec<Node> {
        [&self.noise[..], &self.drives, &self.errors].concat()
    }
}

/// A closed loop under way.
pub(crate) struct Loop {
    /// plant and observer as one system, whose outputs are the values of a row
    pub joined: Evaluation,
    sensors: Sensors,
    wiring: Wiring,
}

impl Loop {
    /// Of a simulation whose process noise is held for `hold`.
    pub(crate) fn new(simulation: &Simulation, hold: f64) -> Result<Self> {
        let Simulation {
            plant,
            noise,
            inputs,
            ..
        } = simulation;
        let names = [plant.outputs(), plant.states(), inputs.outputs()];
        let sensors = Sensors::new(noise, names, hold)?;
        let wiring = Wiring::new(simulation)?;
        Ok(Self {
            joined: wiring.joined(&sensors)?.evaluation(),
            sensors,
            wiring,
        })
    }

    /// Columns that are not estimates.
    pub(crate) fn known_columns(&self) -> usize {
        let observer = self.wiring.simulation.observer.as_ref();
        let estimates = observer.map_or(0, |observer| observer.estimates().len());
        self.joined.system().outputs().len() - estimates
    }

    /// Names and values of the observer's states.
    pub(crate) fn estimate<'a>(&'a self, x: &'a [f64]) -> (&'a [String], &'a [f64]) {
        let observer = self.wiring.simulation.observer.as_ref();
        let names = observer.map_or(&[][..], System::states);
        (names, &x[self.wiring.simulation.plant.states().len()..])
    }

    /// Draws what moves the states, and the next noise sample, if it is time.
    pub(crate) fn draw(&mut self, is_sample: bool) {
        self.sensors.draw(is_sample);
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
        let (plant_x, observer_x) = x.split_at(self.wiring.simulation.plant.states().len());
        let scale = plant_x.iter().fold(scale, |most, x| most.max(x.abs()));
        match &mut self.parts(time, x).0[..] {
            [_, _, observer] => observer.explained(error, observer_x, scale),
            _ => error,
        }
    }

    /// Writes the recorded values at (t, x), in the order of [`Simulation::table`].
    pub(crate) fn row(&mut self, t: f64, x: &[f64], row: &mut Vec<f64>) -> Result<()> {
        row.resize(self.joined.system().outputs().len(), 0.0);
        self.joined.outputs(t, x, row);
        match are_finite(row) {
            true => Ok(()),
            false => Err(self.not_finite(t, x)),
        }
    }

    /// Inputs, plant and observer by themselves where the loop is, since a message names one of them:
    /// the first whose values are not finite, or else the last.
    fn parts(&self, t: f64, x: &[f64]) -> (Vec<Evaluation>, usize) {
        let Simulation { inputs, plant, .. } = &self.wiring.simulation;
        let plant_x = &x[..plant.states().len()];
        let (mut modes, mut held) = self.joined.modes().split_at(self.joined.system().modes());
        let mut part = |system: &System, signals: &[f64], x: &[f64]| {
            let mut part = system.evaluation();
            let own = modes.split_off(..system.modes()).unwrap_or_default();
            let own_held = held.split_off(..system.equations().jumps.len());
            part.enter_modes(own, own_held.unwrap_or_default());
            part.signals_mut().copy_from_slice(signals);
            let mut values = vec![0.0; system.outputs().len() + x.len()];
            let (y, dx) = values.split_at_mut(system.outputs().len());
            part.outputs(t, x, y);
            part.derivatives(t, x, dx);
            (part, values)
        };
        let (inputs, u) = part(inputs, &[], &[]);
        let (plant, y) = part(plant, &self.wiring.applied(&u), plant_x);
        let guilty = if are_finite(&u) { 1 } else { 0 };
        let mut parts = vec![inputs, plant];
        if let Some(observer) = &self.wiring.simulation.observer {
            let disturbances: Vec<f64> = self.sensors.disturbances().collect();
            let shown = self.sensors.shown(&Reals, &y, &disturbances);
            let errors = &disturbances[disturbances.len() - self.sensors.misread()..];
            let signals = self
                .wiring
                .observed(&self.sensors.read(&Reals, &u, errors), &shown);
            parts.push(part(observer, &signals, &x[plant_x.len()..]).0);
        }
        let guilty = match are_finite(&y) && guilty == 1 {
            true => parts.len() - 1,
            false => guilty,
        };
        (parts, guilty)
    }
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
        !self.joined.is_held() && self.joined.slopes(t, x, slopes)
    }

    fn steps(&mut self, steps: &[[f64; 2]], x: &[f64], next: &mut [f64]) -> bool {
        self.joined.steps(steps, x, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        self.joined.events()
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.joined.clauses()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        self.joined.watch(t, x, seen);
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        self.joined.rates(t, x, dx)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>> {
        self.joined.truths(t, x)
    }

    fn happen(&mut self, t: f64, x: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        self.joined.happen(t, x, memory)
    }

    fn names(&self) -> Vec<String> {
        self.joined.names()
    }

    /// Blames the first part whose values are not finite.
    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        let (mut parts, guilty) = self.parts(t, x);
        let plant = self.wiring.simulation.plant.states().len();
        let own = [0..0, 0..plant, plant..x.len()];
        parts[guilty].not_finite(t, &x[own[guilty].clone()])
    }
}
