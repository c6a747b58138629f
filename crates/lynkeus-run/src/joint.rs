//! Inputs, plant, sensors and observer as one tape.

use std::sync::Arc;

use lynkeus_expr::{Expr, Graph, Node, Nodes, Tape};

use crate::closed_loop::Source;
use crate::noise::{Disturbed, Sensors};
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
        let fresh = |count: usize| -> Vec<Expr<'_>> { (0..count).map(|_| g.fresh("x")).collect() };
        let observer_states = self.observer.map_or(0, |o| o.states().len());
        let time = g.fresh("time");
        let plant_x = fresh(self.plant.states().len());
        let observer_x = fresh(observer_states);
        let noise = fresh(self.plant.outputs().len());
        let drives = fresh(self.sensors.moved().count());
        let input_modes = fresh(self.inputs.modes());
        let plant_modes = fresh(self.plant.modes());
        let observer_modes = fresh(self.observer.map_or(0, System::modes));
        let eval = |tape: &Tape, arguments: [&[Expr<'_>]; 3]| -> Vec<Expr<'_>> {
            let all = std::iter::once(&time).chain(arguments.into_iter().flatten());
            let nodes: Vec<Node> = all.map(|e| e.node()).collect();
            let values = tape.eval_in(&Nodes(&g), &nodes);
            values.into_iter().map(|value| g.expr(value)).collect()
        };
        let u = eval(self.inputs.output_tape(), [&[], &[], &input_modes]);
        let w: Vec<Expr<'_>> = self.plant_wires.iter().map(|&wire| u[wire]).collect();
        let mut derivatives = eval(self.plant.derivative_tape(), [&plant_x, &w, &plant_modes]);
        for (state, &drive) in self.sensors.moved().zip(&drives) {
            derivatives[state] = derivatives[state] + drive;
        }
        if let Some(observer) = self.observer {
            let y = eval(self.plant.output_tape(), [&plant_x, &w, &plant_modes]);
            let signal = |wire: &Source| match *wire {
                Source::Input(i) => u[i],
                Source::Sensor(i) => match self.sensors.disturbed(i) {
                    Disturbed::Not => y[i],
                    Disturbed::Added => y[i] + noise[i],
                    Disturbed::Multiplied => y[i] * noise[i],
                },
            };
            let w: Vec<Expr<'_>> = self.observer_wires.iter().map(signal).collect();
            let tape = observer.derivative_tape();
            derivatives.extend(eval(tape, [&observer_x, &w, &observer_modes]));
        }
        let modes = [input_modes, plant_modes, observer_modes].concat();
        let symbols = [vec![time], plant_x, observer_x, noise, drives, modes].concat();
        let [symbols, derivatives] =
            [symbols, derivatives].map(|of| of.iter().map(|e| e.node()).collect::<Vec<_>>());
        Ok(Routine::new(Tape::new(&g, &symbols, &derivatives)?))
    }
}
