//! A system at work.

use std::sync::Arc;

use lynkeus_expr::Evaluator;

use super::System;
use crate::error::state_text;
use crate::events::{Guards, TimeEvents};
use crate::routine::Runner;
use crate::singular::Place;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Events, Margin, Slopes};

/// Evaluates a system on known sides of the surfaces on which it jumps.
#[derive(Clone, Debug)]
struct HeldEvaluation {
    derivatives: Runner,
    outputs: Runner,
    indicators: Evaluator,
    modes: Vec<f64>,
    /// those of the system, then the modes
    inputs: Vec<f64>,
    is_held: bool,
}

impl HeldEvaluation {
    fn place(&mut self, inputs: &[f64]) {
        self.inputs.clear();
        self.inputs.extend_from_slice(inputs);
        self.inputs.extend_from_slice(&self.modes);
    }
}

/// Evaluates one [`System`] without allocating; holds the values of its signals.
#[derive(Clone, Debug)]
pub struct Evaluation {
    system: System,
    derivatives: Runner,
    outputs: Runner,
    switches: TimeEvents,
    /// t, x, w, modes
    inputs: Vec<f64>,
    held: Option<HeldEvaluation>,
}

impl Evaluation {
    pub(super) fn new(system: &System) -> Self {
        let code = &system.code;
        let fixed = 1 + code.states.len() + code.signals.len();
        Self {
            derivatives: code.derivatives_at.runner(),
            outputs: code.outputs_at.runner(),
            switches: code.switches.clone(),
            inputs: vec![0.0; fixed + code.modes],
            held: code.held.as_ref().map(|held| HeldEvaluation {
                derivatives: held.derivatives_at.runner(),
                outputs: held.outputs_at.runner(),
                indicators: held.jumps.indicators.evaluator(),
                modes: vec![0.0; held.modes],
                inputs: vec![],
                is_held: false,
            }),
            system: system.clone(),
        }
    }

    /// The system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The signals' values, in the order of [`System::signals`], to write to.
    pub fn signals_mut(&mut self) -> &mut [f64] {
        let from = 1 + self.system.states().len();
        let to = from + self.system.signals().len();
        &mut self.inputs[from..to]
    }

    /// The signals' values.
    pub fn signals(&self) -> &[f64] {
        let from = 1 + self.system.states().len();
        &self.inputs[from..from + self.system.signals().len()]
    }

    /// Writes the outputs at (t, x) to `y`, in the order of [`System::outputs`].
    ///
    /// Modes are those of the last [`Events::enter`].
    pub fn outputs(&mut self, t: f64, x: &[f64], y: &mut [f64]) {
        self.place(t, x);
        match &mut self.held {
            Some(held) if held.is_held => {
                held.place(&self.inputs);
                held.outputs.eval(&held.inputs, y);
            }
            _ => self.outputs.eval(&self.inputs, y),
        }
    }

    /// Writes the derivatives of the outputs by the states at (t, x), where they are known.
    pub(crate) fn output_slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.place(t, x);
        match &mut self.held {
            Some(held) if held.is_held => {
                held.place(&self.inputs);
                held.outputs.slopes(&held.inputs, x.len(), slopes)
            }
            _ => self.outputs.slopes(&self.inputs, x.len(), slopes),
        }
    }

    /// Writes what an observer reports at (t, x), in the order of
    /// [`System::estimates`].
    pub fn estimates(&mut self, t: f64, x: &[f64], estimates: &mut [f64]) {
        if self.system.outputs().is_empty() {
            estimates.copy_from_slice(x);
        } else {
            self.outputs(t, x, estimates);
        }
    }

    /// An error that ended a run at `x`, by its cause where a matrix of the system is singular
    /// there or the state is far beyond `scale`, the largest number among starts and signals.
    pub(crate) fn explained(&mut self, error: Error, x: &[f64], scale: f64) -> Error {
        let Some(time) = error.time() else {
            return error;
        };
        let system = self.system.clone();
        let mut values = vec![0.0; system.outputs().len()];
        if !system.margins.is_empty() {
            self.outputs(time, x, &mut values);
        }
        let value = |margin: &Margin| values.get(margin.output).copied();
        let margins = system.margins.iter();
        let margins: Vec<(&Margin, f64)> = margins.filter_map(|m| Some((m, value(m)?))).collect();
        Place {
            names: system.states(),
            x,
            scale,
            margins: &margins,
        }
        .explained(error)
    }

    /// Values of the switches at the last [`Events::enter`].
    pub(crate) fn modes(&self) -> &[f64] {
        &self.inputs[self.inputs.len() - self.system.code.modes..]
    }

    /// Values of the operations that jump with the state, on the sides that are held.
    pub(crate) fn held_modes(&self) -> &[f64] {
        self.held.as_ref().map_or(&[], |held| &held.modes)
    }

    fn place(&mut self, t: f64, x: &[f64]) {
        self.inputs[0] = t;
        self.inputs[1..=x.len()].copy_from_slice(x);
    }
}

impl Persist for Evaluation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(self.signals_mut())?;
        self.switches.walk(walk)
    }
}

impl Dynamics for Evaluation {
    fn dimension(&self) -> usize {
        self.system.states().len()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.place(t, x);
        match &mut self.held {
            Some(held) if held.is_held => {
                held.place(&self.inputs);
                held.derivatives.eval(&held.inputs, dx);
            }
            _ => self.derivatives.eval(&self.inputs, dx),
        }
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.place(t, x);
        match &mut self.held {
            Some(held) if held.is_held => {
                held.place(&self.inputs);
                held.derivatives.slopes(&held.inputs, x.len(), slopes)
            }
            _ => self.derivatives.slopes(&self.inputs, x.len(), slopes),
        }
    }

    fn step(&mut self, t: f64, h: f64, x: &[f64], next: &mut [f64]) -> bool {
        if self.held.as_ref().is_some_and(|held| held.is_held) {
            return false;
        }
        self.place(t, x);
        self.derivatives.step(&mut self.inputs, h, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn names(&self) -> Vec<String> {
        self.system.states().to_vec()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.place(t, x);
        let code = &self.system.code;
        let graph = code.graph.lock().unwrap_or_else(|e| e.into_inner());
        let named = code
            .derivatives_at
            .tape()
            .first_nonfinite(&graph, &self.inputs)
            .or_else(|| code.outputs_at.tape().first_nonfinite(&graph, &self.inputs));
        Error::NotFinite {
            time: t,
            operation: named.unwrap_or_else(|| "a value overflows".to_owned()),
            state: state_text(self.system.states(), x),
        }
    }
}

impl Events for Evaluation {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.switches.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        let first = self.inputs.len() - self.system.code.modes;
        self.switches.modes_at(t, &mut self.inputs[first..]);
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.system.code.guards.clone()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.place(t, &x[..self.dimension()]);
        if let Some(held) = &mut self.held {
            held.place(&self.inputs);
            held.indicators.eval(&held.inputs, values);
        }
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        let (Some(evaluation), Some(code)) = (&mut self.held, &self.system.code.held) else {
            return;
        };
        evaluation.is_held = sides.is_some();
        if let Some(sides) = sides {
            code.jumps.modes(sides, &mut evaluation.modes);
        }
    }

    fn beside(&mut self, _t: f64, values: &mut Vec<[f64; 2]>) {
        let first = 1 + self.system.states().len();
        let held = self.held_modes();
        values.clear();
        values.extend(self.inputs[first..].iter().chain(held).map(|&v| [v, 0.0]));
    }
}
