//! Inputs, plant, sensors and observer as one tape.

use std::sync::Arc;

use lynkeus_expr::{Expr, Graph, Node, Nodes, Tape};

use crate::closed_loop::Source;
use crate::events::{Guards, Surfaces};
use crate::noise::{Level, Limits, Sensors};
use crate::routine::Routine;
use crate::{Error, System};

/// What the joint tape is made of.
pub(crate) struct Parts<'a> {
    pub inputs: &'a System,
    pub plant: &'a System,
    pub observer: Option<&'a System>,
    pub sensors: &'a Sensors,
    /// which input each signal of the plant is
    pub plant_wires: &'a [usize],
    pub observer_wires: &'a [Source],
}

impl Parts<'_> {
    /// The derivatives of the plant's states, then of the observer's, as functions of time, these
    /// states, what disturbs each sensor and each moved state, and the modes of inputs, plant and observer.
    pub fn joined(&self) -> Result<Arc<Routine>, Error> {
        let g = Graph::new();
        let symbols = Symbols::new(&g, self);
        let (u, w) = symbols.inputs(self);
        let mut derivatives = symbols.plant(self.plant.derivative_tape(), &w);
        for (state, &drive) in self.sensors.moved().zip(&symbols.drives) {
            derivatives[state] = derivatives[state] + drive;
        }
        if let Some(observer) = self.observer {
            let y = symbols.plant(self.plant.output_tape(), &w);
            let w = symbols.signals(self, &u, &y);
            derivatives.extend(symbols.observer(observer.derivative_tape(), &w));
        }
        Ok(Routine::new(symbols.tape(&derivatives)?))
    }

    /// Where plant and observer jump and bend, as functions of the same and of the values of what is
    /// held, those of the plant first.
    pub fn guards(&self) -> Result<Option<Arc<Guards>>, Error> {
        let parts = [Some(self.plant), self.observer];
        let is_smooth = |s: &System| s.surfaces().is_none() && s.bends().is_none();
        if parts.into_iter().flatten().all(is_smooth) {
            return Ok(None);
        }
        let g = Graph::new();
        let symbols = Symbols::new(&g, self);
        let (u, w) = symbols.inputs(self);
        let (mut surfaces, mut bends) = (Surfaces::default(), vec![]);
        let mut take = |system: &System, eval: &dyn Fn(&Tape) -> Vec<Node>| {
            if let Some((tape, guards)) = system.surfaces() {
                surfaces.extend(eval(tape), guards);
            }
            bends.extend(system.bends().map(eval).unwrap_or_default());
        };
        take(self.plant, &|tape| nodes(&symbols.held_plant(tape, &w)));
        if let Some(observer) = self.observer {
            let y = symbols.held_plant(self.plant.held_outputs_tape(), &w);
            let w = symbols.signals(self, &u, &y);
            take(observer, &|tape| nodes(&symbols.held_observer(tape, &w)));
        }
        let inputs = [
            symbols.all(),
            nodes(&symbols.plant_held),
            nodes(&symbols.observer_held),
        ]
        .concat();
        let states = symbols.plant_x.len() + symbols.observer_x.len();
        Ok(Guards::new(&g, &inputs, states, surfaces, &bends)?)
    }

    /// The values of a row, in the order of the columns of a run, as functions of the same.
    pub fn row(&self, with_outputs: bool) -> Result<Tape, Error> {
        let g = Graph::new();
        let symbols = Symbols::new(&g, self);
        let (u, w) = symbols.inputs(self);
        let y = symbols.plant(self.plant.output_tape(), &w);
        let mut row = [&symbols.plant_x[..], &w].concat();
        if with_outputs {
            row.extend(&y);
            row.extend((0..y.len()).map(|i| symbols.measured(self, &y, i)));
        }
        if let Some(observer) = self.observer {
            let w = symbols.signals(self, &u, &y);
            match observer.outputs().is_empty() {
                true => row.extend(&symbols.observer_x),
                false => row.extend(symbols.observer(observer.output_tape(), &w)),
            }
        }
        symbols.tape(&row)
    }
}

fn nodes(expressions: &[Expr<'_>]) -> Vec<Node> {
    expressions.iter().map(|e| e.node()).collect()
}

/// The arguments of what is made of the parts.
struct Symbols<'g> {
    graph: &'g Graph,
    time: Expr<'g>,
    plant_x: Vec<Expr<'g>>,
    observer_x: Vec<Expr<'g>>,
    noise: Vec<Expr<'g>>,
    drives: Vec<Expr<'g>>,
    input_modes: Vec<Expr<'g>>,
    plant_modes: Vec<Expr<'g>>,
    observer_modes: Vec<Expr<'g>>,
    plant_held: Vec<Expr<'g>>,
    observer_held: Vec<Expr<'g>>,
}

impl<'g> Symbols<'g> {
    fn new(graph: &'g Graph, parts: &Parts<'_>) -> Self {
        let fresh = |count: usize| (0..count).map(|_| graph.fresh("x")).collect();
        Self {
            graph,
            time: graph.fresh("time"),
            plant_x: fresh(parts.plant.states().len()),
            observer_x: fresh(parts.observer.map_or(0, |o| o.states().len())),
            noise: fresh(parts.plant.outputs().len()),
            drives: fresh(parts.sensors.moved().count()),
            input_modes: fresh(parts.inputs.modes()),
            plant_modes: fresh(parts.plant.modes()),
            observer_modes: fresh(parts.observer.map_or(0, System::modes)),
            plant_held: fresh(parts.plant.held_modes()),
            observer_held: fresh(parts.observer.map_or(0, System::held_modes)),
        }
    }

    fn eval(&self, tape: &Tape, arguments: &[&[Expr<'g>]]) -> Vec<Expr<'g>> {
        let all = std::iter::once(&self.time).chain(arguments.iter().copied().flatten());
        let nodes: Vec<Node> = all.map(|e| e.node()).collect();
        let values = tape.eval_in(&Nodes(self.graph), &nodes);
        values.into_iter().map(|v| self.graph.expr(v)).collect()
    }

    fn plant(&self, tape: &Tape, w: &[Expr<'g>]) -> Vec<Expr<'g>> {
        self.eval(tape, &[&self.plant_x, w, &self.plant_modes])
    }

    fn observer(&self, tape: &Tape, w: &[Expr<'g>]) -> Vec<Expr<'g>> {
        self.eval(tape, &[&self.observer_x, w, &self.observer_modes])
    }

    /// On the sides that are held.
    fn held_plant(&self, tape: &Tape, w: &[Expr<'g>]) -> Vec<Expr<'g>> {
        self.eval(
            tape,
            &[&self.plant_x, w, &self.plant_modes, &self.plant_held],
        )
    }

    fn held_observer(&self, tape: &Tape, w: &[Expr<'g>]) -> Vec<Expr<'g>> {
        self.eval(
            tape,
            &[
                &self.observer_x,
                w,
                &self.observer_modes,
                &self.observer_held,
            ],
        )
    }

    /// All inputs, then those that the plant reads.
    fn inputs(&self, parts: &Parts<'_>) -> (Vec<Expr<'g>>, Vec<Expr<'g>>) {
        let u = self.eval(parts.inputs.output_tape(), &[&self.input_modes]);
        let w = parts.plant_wires.iter().map(|&wire| u[wire]).collect();
        (u, w)
    }

    /// What a sensor shows.
    fn measured(&self, parts: &Parts<'_>, y: &[Expr<'g>], i: usize) -> Expr<'g> {
        let disturbed = match parts.sensors.level(i) {
            None => y[i],
            Some(Level::Relative(_)) => y[i] * self.noise[i],
            Some(Level::Absolute(_) | Level::Uniform(_)) => y[i] + self.noise[i],
        };
        match parts.sensors.limits(i) {
            None => disturbed,
            Some(Limits { low, high }) => {
                let capped = disturbed.min(self.graph.constant(high));
                capped.max(self.graph.constant(low))
            }
        }
    }

    /// The signals of the observer.
    fn signals(&self, parts: &Parts<'_>, u: &[Expr<'g>], y: &[Expr<'g>]) -> Vec<Expr<'g>> {
        let signal = |wire: &Source| match *wire {
            Source::Input(i) => u[i],
            Source::Sensor(i) => self.measured(parts, y, i),
        };
        parts.observer_wires.iter().map(signal).collect()
    }

    /// Everything but what is held.
    fn all(&self) -> Vec<Node> {
        let of = [
            &self.plant_x,
            &self.observer_x,
            &self.noise,
            &self.drives,
            &self.input_modes,
            &self.plant_modes,
            &self.observer_modes,
        ];
        let symbols = std::iter::once(&self.time).chain(of.into_iter().flatten());
        symbols.map(|e| e.node()).collect()
    }

    fn tape(&self, values: &[Expr<'g>]) -> Result<Tape, Error> {
        Ok(Tape::new(self.graph, &self.all(), &nodes(values))?)
    }
}
