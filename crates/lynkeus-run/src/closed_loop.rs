//! Inputs, plant, sensors and observer as one system.

use std::sync::Arc;

use lynkeus_expr::Tape;

use crate::events::Guards;
use crate::joint::Parts;
use crate::noise::Sensors;
use crate::routine::Runner;
use crate::{Dynamics, Error, Evaluation, Events, Role, Simulation, Slopes, System, Trajectory};

/// Where a signal of the observer comes from.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Source {
    /// output of the plant, as measured
    Sensor(usize),
    /// an input
    Input(usize),
}

/// What the signals of a system can come from.
struct Sources<'a> {
    sensors: &'a [String],
    inputs: &'a [String],
}

impl Sources<'_> {
    /// The input of a name.
    fn input(&self, name: &str) -> Result<usize, Error> {
        let found = places(self.inputs, name).collect::<Vec<_>>();
        self.only("plant", name, &found)
    }

    /// The sensor or the input of a name.
    fn any(&self, name: &str) -> Result<Source, Error> {
        let sensors = places(self.sensors, name).map(Source::Sensor);
        let inputs = places(self.inputs, name).map(Source::Input);
        let found: Vec<Source> = sensors.chain(inputs).collect();
        self.only("observer", name, &found)
    }

    fn only<T: Copy>(&self, reader: &'static str, name: &str, found: &[T]) -> Result<T, Error> {
        match found {
            [one] => Ok(*one),
            [] => Err(Error::Unconnected {
                reader,
                name: name.to_owned(),
                available: [self.sensors, self.inputs].concat().join(", "),
            }),
            _ => Err(Error::Ambiguous {
                reader,
                name: name.to_owned(),
            }),
        }
    }
}

fn places<'a>(names: &'a [String], name: &'a str) -> impl Iterator<Item = usize> + 'a {
    let named = names.iter().enumerate().filter(move |(_, n)| *n == name);
    named.map(|(place, _)| place)
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

/// The joint system; its state is the plant's, then the observer's.
pub(crate) struct Loop {
    inputs: Evaluation,
    plant: Evaluation,
    observer: Option<Evaluation>,
    sensors: Sensors,
    /// which input each signal of the plant is
    plant_wires: Vec<usize>,
    observer_wires: Vec<Source>,
    record_outputs: bool,
    /// plant and observer are on known sides of the surfaces on which they jump
    is_held: bool,
    /// the derivatives of all states, as one
    joint: Runner,
    /// where they jump and bend
    guards: Option<Arc<Guards>>,
    /// time, states, what disturbs sensors and states, modes
    arguments: Vec<f64>,
    u: Vec<f64>,
    y: Vec<f64>,
}

impl Loop {
    pub(crate) fn new(simulation: &Simulation, sensors: Sensors) -> Result<Self, Error> {
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
        let sources = Sources {
            sensors: plant.outputs(),
            inputs: inputs.outputs(),
        };
        let plant_wires = plant.signals().iter().map(|name| sources.input(name));
        let read = observer.as_ref().map_or(&[][..], |o| o.signals());
        let observer_wires = read.iter().map(|name| sources.any(name));
        let plant_wires = plant_wires.collect::<Result<Vec<_>, _>>()?;
        let observer_wires = observer_wires.collect::<Result<Vec<_>, _>>()?;
        let parts = Parts {
            inputs,
            plant,
            observer: observer.as_ref(),
            sensors: &sensors,
            plant_wires: &plant_wires,
            observer_wires: &observer_wires,
        };
        let (joint, guards) = (parts.joined()?, parts.guards()?);
        Ok(Self {
            guards,
            arguments: vec![0.0; joint.tape().inputs()],
            joint: joint.runner(),
            u: vec![0.0; inputs.outputs().len()],
            y: vec![0.0; plant.outputs().len()],
            inputs: inputs.evaluation(),
            plant: plant.evaluation(),
            observer: observer.as_ref().map(|o| o.evaluation()),
            plant_wires,
            observer_wires,
            sensors,
            record_outputs: simulation.record_outputs,
            is_held: false,
        })
    }

    /// Start values of the joint state.
    pub(crate) fn start(&self) -> Vec<f64> {
        let mut x = self.plant.system().start().to_vec();
        if let Some(observer) = &self.observer {
            x.extend(observer.system().start());
        }
        x
    }

    /// A table with the recorded columns.
    pub(crate) fn table(&self) -> Trajectory {
        let observer = self.observer.as_ref().map(Evaluation::system);
        table(self.plant.system(), observer, self.record_outputs)
    }

    /// Columns that are not estimates.
    pub(crate) fn known_columns(&self) -> usize {
        let plant = self.plant.system();
        let outputs = if self.record_outputs {
            2 * self.y.len()
        } else {
            0
        };
        plant.states().len() + plant.signals().len() + outputs
    }

    /// Names and values of the observer's states.
    pub(crate) fn estimate<'a>(&'a self, x: &'a [f64]) -> (&'a [String], &'a [f64]) {
        let names = self
            .observer
            .as_ref()
            .map_or(&[][..], |o| o.system().states());
        (names, &x[self.plant.dimension()..])
    }

    /// The joint derivatives, as functions of time, states, what disturbs them, and modes.
    pub(crate) fn tape(&self) -> &Tape {
        self.joint.tape()
    }

    /// The values of a row, as functions of the same.
    pub(crate) fn row_tape(&self) -> Result<Tape, Error> {
        let parts = Parts {
            inputs: self.inputs.system(),
            plant: self.plant.system(),
            observer: self.observer.as_ref().map(Evaluation::system),
            sensors: &self.sensors,
            plant_wires: &self.plant_wires,
            observer_wires: &self.observer_wires,
        };
        parts.row(self.record_outputs)
    }

    /// How many values disturb sensors and states.
    pub(crate) fn disturbances(&self) -> usize {
        self.sensors.disturbances().count()
    }

    /// The values of what jumps with time, since the last [`Events::enter`].
    pub(crate) fn modes(&self) -> &[f64] {
        &self.arguments[1 + self.dimension() + self.disturbances()..]
    }

    /// Draws the next noise sample.
    pub(crate) fn draw(&mut self) {
        self.sensors.draw();
        self.settle();
    }

    /// An error that ended the run at `x`, by its cause where that is the observer.
    pub(crate) fn explained(&mut self, error: Error, x: &[f64], scale: f64) -> Error {
        let (plant_x, observer_x) = x.split_at(self.plant.dimension());
        if let Some(time) = error.time() {
            self.connect(time, plant_x);
        }
        let scale = plant_x.iter().fold(scale, |most, x| most.max(x.abs()));
        match &mut self.observer {
            Some(observer) => observer.explained(error, observer_x, scale),
            None => error,
        }
    }

    /// Draws what moves the states, between two samples.
    pub(crate) fn stir(&mut self) {
        self.sensors.stir();
        self.settle();
    }

    /// True without noise.
    pub(crate) fn is_exact(&self) -> bool {
        self.sensors.are_exact()
    }

    /// Appends the recorded values at (t, x), in the order of [`Loop::table`].
    pub(crate) fn row(&mut self, t: f64, x: &[f64], row: &mut Vec<f64>) -> Result<(), Error> {
        let (plant_x, observer_x) = x.split_at(self.plant.dimension());
        self.connect(t, plant_x);
        row.extend_from_slice(plant_x);
        row.extend_from_slice(self.plant.signals());
        if self.record_outputs {
            row.extend_from_slice(&self.y);
            let measured = |(i, &y): (usize, &f64)| self.sensors.measured(i, y);
            row.extend(self.y.iter().enumerate().map(measured));
        }
        if let Some(observer) = &mut self.observer {
            let from = row.len();
            row.resize(from + observer.system().estimates().len(), 0.0);
            observer.estimates(t, observer_x, &mut row[from..]);
        }
        if row.iter().all(|v| v.is_finite()) {
            return Ok(());
        }
        Err(self.not_finite(t, x))
    }

    /// The arguments of the joint derivatives that stay from one draw of noise, or one switch, to
    /// the next.
    fn settle(&mut self) {
        let first = 1 + self.dimension();
        let observer = self.observer.as_ref().map_or(&[][..], Evaluation::modes);
        let modes = [self.inputs.modes(), self.plant.modes(), observer];
        let modes = modes.into_iter().flatten().copied();
        let values = self.sensors.disturbances().chain(modes);
        for (argument, value) in self.arguments[first..].iter_mut().zip(values) {
            *argument = value;
        }
    }

    fn place(&mut self, t: f64, x: &[f64]) {
        self.arguments[0] = t;
        self.arguments[1..=x.len()].copy_from_slice(x);
    }

    /// Carries inputs to the plant and measurements to the observer.
    fn connect(&mut self, t: f64, plant_x: &[f64]) {
        self.inputs.outputs(t, &[], &mut self.u);
        for (signal, &wire) in self.plant.signals_mut().iter_mut().zip(&self.plant_wires) {
            *signal = self.u[wire];
        }
        self.plant.outputs(t, plant_x, &mut self.y);
        let Some(observer) = &mut self.observer else {
            return;
        };
        for (signal, wire) in observer.signals_mut().iter_mut().zip(&self.observer_wires) {
            *signal = match *wire {
                Source::Sensor(i) => self.sensors.measured(i, self.y[i]),
                Source::Input(i) => self.u[i],
            };
        }
    }
}

impl Dynamics for Loop {
    fn dimension(&self) -> usize {
        self.plant.dimension() + self.observer.as_ref().map_or(0, Dynamics::dimension)
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        if !self.is_held {
            self.place(t, x);
            return self.joint.eval(&self.arguments, dx);
        }
        let (plant_x, observer_x) = x.split_at(self.plant.dimension());
        let (plant_dx, observer_dx) = dx.split_at_mut(self.plant.dimension());
        self.connect(t, plant_x);
        self.plant.derivatives(t, plant_x, plant_dx);
        for state in self.sensors.moved() {
            plant_dx[state] += self.sensors.drive(state);
        }
        if let Some(observer) = &mut self.observer {
            observer.derivatives(t, observer_x, observer_dx);
        }
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        if self.is_held {
            return false;
        }
        self.place(t, x);
        self.joint.slopes(&self.arguments, x.len(), slopes)
    }

    fn step(&mut self, t: f64, h: f64, x: &[f64], next: &mut [f64]) -> bool {
        if self.is_held {
            return false;
        }
        self.place(t, x);
        self.joint.step(&mut self.arguments, h, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn names(&self) -> Vec<String> {
        let mut names = self.plant.names();
        if let Some(observer) = &self.observer {
            names.extend(
                observer
                    .names()
                    .iter()
                    .map(|name| format!("observer's {name}")),
            );
        }
        names
    }

    /// Blames the first part whose values are not finite.
    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        let (plant_x, observer_x) = x.split_at(self.plant.dimension());
        self.connect(t, plant_x);
        let finite = |values: &[f64]| values.iter().all(|v| v.is_finite());
        if !finite(&self.u) {
            return self.inputs.not_finite(t, &[]);
        }
        let mut dx = vec![0.0; plant_x.len()];
        self.plant.derivatives(t, plant_x, &mut dx);
        match &mut self.observer {
            Some(observer) if finite(&dx) && finite(&self.y) => observer.not_finite(t, observer_x),
            _ => self.plant.not_finite(t, plant_x),
        }
    }
}

impl Events for Loop {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.inputs.instants(from, to, times)?;
        self.plant.instants(from, to, times)?;
        match &mut self.observer {
            Some(observer) => observer.instants(from, to, times),
            None => Ok(()),
        }
    }

    fn enter(&mut self, t: f64) {
        self.inputs.enter(t);
        self.plant.enter(t);
        if let Some(observer) = &mut self.observer {
            observer.enter(t);
        }
        self.settle();
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.guards.clone()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        let (plant_x, observer_x) = x.split_at(self.plant.dimension());
        let (of_plant, of_observer) = values.split_at_mut(surfaces(&self.plant));
        self.connect(t, plant_x);
        self.plant.indicators(t, plant_x, of_plant);
        if let Some(observer) = &mut self.observer {
            observer.indicators(t, observer_x, of_observer);
        }
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        self.is_held = sides.is_some();
        let parts = sides.map(|sides| sides.split_at(surfaces(&self.plant)));
        self.plant.hold(parts.map(|(plant, _)| plant));
        if let Some(observer) = &mut self.observer {
            observer.hold(parts.map(|(_, observer)| observer));
        }
    }

    fn beside(&mut self, _t: f64, values: &mut Vec<[f64; 2]>) {
        let first = 1 + self.dimension();
        let observer = self
            .observer
            .as_ref()
            .map_or(&[][..], Evaluation::held_modes);
        let held = self.plant.held_modes().iter().chain(observer);
        values.clear();
        values.extend(
            self.arguments[first..]
                .iter()
                .chain(held)
                .map(|&v| [v, 0.0]),
        );
    }
}

/// How many surfaces a part jumps on.
fn surfaces(part: &Evaluation) -> usize {
    part.guards().map_or(0, |guards| guards.surfaces())
}
