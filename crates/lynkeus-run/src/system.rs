//! Systems compiled for evaluation, and at work.

use std::fmt::Write;
use std::sync::Arc;

use lynkeus_expr::{Evaluator, Graph, Node, Tape};

use crate::divergence::explained;
use crate::equations::Equations;
use crate::error::state_text;
use crate::events::{Guards, TimeEvents};
use crate::routine::{Routine, Runner};
use crate::snapshot::{Damaged, Digest, Persist, Walk};
use crate::{BetweenSamples, Dynamics, Error, Events, Margin, Slopes};

/// A compiled system x' = f(t, x, w), y = h(t, x, w): a plant, an observer, or
/// (without states) inputs as functions of time.
///
/// The signals w are everything the right-hand side reads beside time and
/// states. A system owns its equations and their code: it is cheap to clone, `Send` and `Sync`, and
/// independent of the graph it was made from. An [`Evaluation`] evaluates it.
#[derive(Clone, Debug)]
pub struct System {
    code: Arc<Code>,
    start: Vec<f64>,
    margins: Arc<[Margin]>,
}

#[derive(Debug)]
struct Code {
    equations: Arc<Equations>,
    derivatives_at: Arc<Routine>,
    outputs_at: Arc<Routine>,
    /// the same with what jumps with the state held; none where nothing does
    held: Option<HeldCode>,
    /// where it jumps and bends with the state, over all inputs
    guards: Option<Arc<Guards>>,
}

/// Code whose last inputs are the values of the operations that jump with the state.
#[derive(Debug)]
struct HeldCode {
    derivatives_at: Arc<Routine>,
    outputs_at: Arc<Routine>,
    /// the event indicators: what vanishes on the surfaces
    indicators: Tape,
}

impl System {
    /// Compiles expressions of a graph.
    ///
    /// `time` and the nodes of `states` (name, symbol, start value) and `signals`
    /// (name, symbol) are symbols; `derivatives` are in the order of `states`;
    /// `outputs` are (name, expression).
    ///
    /// # Errors
    /// [`Error::MissingInput`] if an expression reads another symbol;
    /// [`Error::Setting`] if the numbers of states and derivatives differ or a
    /// start value is not finite.
    pub fn new(
        graph: &Graph,
        time: Node,
        states: &[(String, Node, f64)],
        signals: &[(String, Node)],
        derivatives: &[Node],
        outputs: &[(String, Node)],
    ) -> Result<Self, Error> {
        if states.len() != derivatives.len() {
            let expected = format!("{}, one per state", states.len());
            return Err(Error::setting(
                "number of derivatives",
                expected,
                derivatives.len(),
            ));
        }
        let mut symbols = vec![time];
        symbols.extend(states.iter().map(|(_, node, _)| *node));
        symbols.extend(signals.iter().map(|(_, node)| *node));
        let roots: Vec<Node> = outputs.iter().map(|(_, node)| *node).collect();
        let equations = Equations {
            states: states.iter().map(|(name, ..)| name.clone()).collect(),
            signals: signals.iter().map(|(name, _)| name.clone()).collect(),
            outputs: outputs.iter().map(|(name, _)| name.clone()).collect(),
            ..Equations::new(graph, &symbols, derivatives, &roots)?
        };
        let start = states.iter().map(|(.., value)| *value).collect();
        Self::compiled(equations, start)
    }

    /// Code for equations.
    ///
    /// # Errors
    /// As [`System::new`].
    pub(crate) fn compiled(equations: Equations, start: Vec<f64>) -> Result<Self, Error> {
        let equations = Arc::new(equations);
        let Equations { roots, inputs, .. } = &*equations;
        let guards = {
            let graph = equations.graph();
            let states = equations.states.len();
            Guards::new(&graph, inputs, states, equations.surfaces(), &roots.bends)?
        };
        let held = match equations.held.is_empty() {
            true => None,
            false => Some(HeldCode {
                derivatives_at: Routine::new(
                    &equations,
                    inputs.len(),
                    roots.held_derivatives.clone(),
                )?,
                outputs_at: Routine::new(&equations, inputs.len(), roots.held_outputs.clone())?,
                indicators: Tape::new(&equations.graph(), inputs, &roots.surfaces)?,
            }),
        };
        let smooth = equations.smooth_inputs();
        let code = Code {
            derivatives_at: Routine::new(&equations, smooth, roots.derivatives.clone())?,
            outputs_at: Routine::new(&equations, smooth, roots.outputs.clone())?,
            held,
            guards,
            equations: equations.clone(),
        };
        Self {
            code: Arc::new(code),
            start: vec![],
            margins: Arc::default(),
        }
        .with_start(start)
    }

    /// The same system with other start values, in the order of the states.
    ///
    /// # Errors
    /// [`Error::Setting`] for a wrong number of values or one that is not finite.
    pub fn with_start(mut self, start: Vec<f64>) -> Result<Self, Error> {
        if start.len() != self.states().len() {
            let expected = format!("{}, one per state", self.states().len());
            return Err(Error::setting(
                "number of start values",
                expected,
                start.len(),
            ));
        }
        if let Some(i) = start.iter().position(|value| !value.is_finite()) {
            let what = format!("start value of '{}'", self.states()[i]);
            return Err(Error::setting(what, "a finite number", start[i]));
        }
        self.start = start;
        Ok(self)
    }

    /// The same system with outputs that say how far its matrices are from singular: a run that
    /// cannot go on near such a place ends in [`Error::Singular`].
    #[must_use]
    pub fn with_margins(mut self, margins: Vec<Margin>) -> Self {
        self.margins = margins.into();
        self
    }

    /// Names of the states.
    pub fn states(&self) -> &[String] {
        &self.code.equations.states
    }

    /// Start values, in the order of the states.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Names of the signals w.
    pub fn signals(&self) -> &[String] {
        &self.code.equations.signals
    }

    /// Names of the outputs.
    pub fn outputs(&self) -> &[String] {
        &self.code.equations.outputs
    }

    /// Names of what an observer reports: its outputs, or its states where it has
    /// no outputs.
    pub fn estimates(&self) -> &[String] {
        match self.outputs().is_empty() {
            true => self.states(),
            false => self.outputs(),
        }
    }

    /// What the system's numbers follow from: the tapes, not the machine code made of them.
    pub(crate) fn tell(&self, digest: &mut Digest) {
        let code = &*self.code;
        let Equations {
            states,
            signals,
            outputs,
            switches,
            held,
            ..
        } = &*code.equations;
        // a digest takes any text
        let _ = write!(digest, "{:?}", (states, signals, outputs, switches, held));
        let held = code.held.iter();
        let held = held.flat_map(|held| [&held.derivatives_at, &held.outputs_at]);
        for routine in [&code.derivatives_at, &code.outputs_at]
            .into_iter()
            .chain(held)
        {
            let _ = write!(digest, "{:?}", routine.tape());
        }
        let indicators = code.held.as_ref().map(|held| &held.indicators);
        let _ = write!(digest, "{indicators:?}");
        digest.numbers(&self.start);
    }

    /// The equations that it is compiled from.
    pub(crate) fn equations(&self) -> &Equations {
        &self.code.equations
    }

    /// The code of x'.
    pub(crate) fn derivatives_at(&self) -> &Routine {
        &self.code.derivatives_at
    }

    /// (t, x, w, [modes](System::modes)) → x'.
    pub fn derivative_tape(&self) -> &Tape {
        self.code.derivatives_at.tape()
    }

    /// (t, x, w, [modes](System::modes)) → y.
    pub fn output_tape(&self) -> &Tape {
        self.code.outputs_at.tape()
    }

    /// How many values the switches in time have: what jumps with time alone is an input of the
    /// tapes.
    pub fn modes(&self) -> usize {
        self.code.equations.modes.iter().sum()
    }

    /// Whether it jumps or bends (as max does) with time alone, at instants that are found and at
    /// which an integration stops.
    pub fn has_instants(&self) -> bool {
        let mut switches = self.code.equations.switches.iter();
        switches.any(|switches| !switches.is_empty())
    }

    /// An evaluator with its own working memory, signals at zero.
    pub fn evaluation(&self) -> Evaluation {
        Evaluation::new(self)
    }
}

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
    /// of each part of the system
    switches: Vec<TimeEvents>,
    /// t, x, w, modes
    inputs: Vec<f64>,
    held: Option<HeldEvaluation>,
}

impl Evaluation {
    fn new(system: &System) -> Self {
        let code = &system.code;
        Self {
            derivatives: code.derivatives_at.runner(),
            outputs: code.outputs_at.runner(),
            switches: code.equations.switches.clone(),
            inputs: vec![0.0; code.equations.smooth_inputs()],
            held: code.held.as_ref().map(|held| HeldEvaluation {
                derivatives: held.derivatives_at.runner(),
                outputs: held.outputs_at.runner(),
                indicators: held.indicators.evaluator(),
                modes: vec![0.0; code.equations.held_modes()],
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
        explained(error, system.states(), x, scale, &margins)
    }

    /// Values of the switches at the last [`Events::enter`].
    pub(crate) fn modes(&self) -> &[f64] {
        &self.inputs[self.inputs.len() - self.system.modes()..]
    }

    /// Values of the operations that jump with the state, on the sides that are held.
    pub(crate) fn held_modes(&self) -> &[f64] {
        self.held.as_ref().map_or(&[], |held| &held.modes)
    }

    /// Goes to these values of the switches, and to these of what is held.
    pub(crate) fn enter_modes(&mut self, modes: &[f64], held_modes: Option<&[f64]>) {
        let first = self.inputs.len() - modes.len();
        self.inputs[first..].copy_from_slice(modes);
        if let Some(held) = &mut self.held {
            held.is_held = held_modes.is_some();
            if let Some(modes) = held_modes {
                held.modes.copy_from_slice(modes);
            }
        }
    }

    fn place(&mut self, t: f64, x: &[f64]) {
        self.inputs[0] = t;
        self.inputs[1..=x.len()].copy_from_slice(x);
    }
}

impl Persist for Evaluation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.numbers(self.signals_mut())?;
        self.switches.iter_mut().try_for_each(|s| s.walk(walk))
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
        let named = code
            .derivatives_at
            .first_nonfinite(&self.inputs)
            .or_else(|| code.outputs_at.first_nonfinite(&self.inputs));
        Error::NotFinite {
            time: t,
            operation: named.unwrap_or_else(|| "a value overflows".to_owned()),
            state: state_text(self.system.states(), x),
        }
    }
}

impl Events for Evaluation {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        let mut switches = self.switches.iter_mut();
        switches.try_for_each(|switches| switches.instants(from, to, times))
    }

    fn enter(&mut self, t: f64) {
        let first = self.inputs.len() - self.system.modes();
        let mut modes = &mut self.inputs[first..];
        for (switches, &count) in self
            .switches
            .iter_mut()
            .zip(&self.system.code.equations.modes)
        {
            let (own, rest) = modes.split_at_mut(count);
            switches.modes_at(t, own);
            modes = rest;
        }
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
        let Some(evaluation) = &mut self.held else {
            return;
        };
        evaluation.is_held = sides.is_some();
        let Some(mut sides) = sides else {
            return;
        };
        let mut modes = &mut evaluation.modes[..];
        for jumps in &self.system.code.equations.held {
            let (own, rest) = sides.split_at(jumps.names.len());
            modes = jumps.modes(own, modes);
            sides = rest;
        }
    }

    fn beside(&mut self, _t: f64, values: &mut Vec<[f64; 2]>) {
        let first = 1 + self.system.states().len();
        let held = self.held_modes();
        values.clear();
        values.extend(self.inputs[first..].iter().chain(held).map(|&v| [v, 0.0]));
    }
}

/// A system with its signals between two samples.
#[derive(Clone, Debug)]
pub(crate) struct Driven {
    pub(crate) evaluation: Evaluation,
    between: BetweenSamples,
    from: f64,
    to: f64,
    last: Vec<f64>,
    next: Vec<f64>,
}

impl Driven {
    pub(crate) fn new(system: &System, between: BetweenSamples) -> Self {
        let count = system.signals().len();
        Self {
            evaluation: system.evaluation(),
            between,
            from: 0.0,
            to: 1.0,
            last: vec![0.0; count],
            next: vec![0.0; count],
        }
    }

    /// The first sample.
    pub(crate) fn start(&mut self, signals: &[f64]) {
        self.next.copy_from_slice(signals);
        self.arrive();
    }

    /// The sample at the end of the interval to come, of the first signals; others stay.
    pub(crate) fn aim(&mut self, from: f64, to: f64, signals: &[f64]) {
        (self.from, self.to) = (from, to);
        self.next.copy_from_slice(&self.last);
        self.next[..signals.len()].copy_from_slice(signals);
    }

    /// The signals at t.
    fn read_signals(&mut self, t: f64) {
        if self.between == BetweenSamples::Linear {
            let s = (t - self.from) / (self.to - self.from);
            let ends = self.last.iter().zip(&self.next);
            for (signal, (last, next)) in self.evaluation.signals_mut().iter_mut().zip(ends) {
                *signal = last + s * (next - last);
            }
        }
    }

    /// Writes the derivatives of the outputs by the states at (t, x), where they are known.
    pub(crate) fn output_slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.read_signals(t);
        self.evaluation.output_slopes(t, x, slopes)
    }

    /// The interval is over: its last sample is the present one.
    pub(crate) fn arrive(&mut self) {
        self.last.copy_from_slice(&self.next);
        self.evaluation.signals_mut().copy_from_slice(&self.last);
    }
}

impl Persist for Driven {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.evaluation.walk(walk)?;
        walk.numbers(&mut self.last)?;
        walk.numbers(&mut self.next)
    }
}

impl Dynamics for Driven {
    fn dimension(&self) -> usize {
        self.evaluation.dimension()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        self.read_signals(t);
        self.evaluation.derivatives(t, x, dx);
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        self.read_signals(t);
        self.evaluation.slopes(t, x, slopes)
    }

    fn step(&mut self, t: f64, h: f64, x: &[f64], next: &mut [f64]) -> bool {
        self.between == BetweenSamples::Hold && self.evaluation.step(t, h, x, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn names(&self) -> Vec<String> {
        self.evaluation.names()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.evaluation.not_finite(t, x)
    }
}

impl Events for Driven {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<(), Error> {
        self.evaluation.instants(from, to, times)
    }

    fn enter(&mut self, t: f64) {
        self.evaluation.enter(t);
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.evaluation.guards()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.read_signals(t);
        self.evaluation.indicators(t, x, values);
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        self.evaluation.hold(sides);
    }

    fn beside(&mut self, t: f64, values: &mut Vec<[f64; 2]>) {
        self.read_signals(t);
        self.evaluation.beside(t, values);
        if self.between == BetweenSamples::Linear {
            let ends = self.last.iter().zip(&self.next);
            for ([_, speed], (last, next)) in values.iter_mut().zip(ends) {
                *speed = (next - last) / (self.to - self.from);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn build(graph: &Graph, derivatives: &[Node]) -> Result<System, Error> {
        let [time, x] = ["time", "x"].map(|name| graph.symbol(name).node());
        let output = ("half".to_string(), (graph.expr(x) * 0.5).node());
        let states = [("x".to_string(), x, 4.0)];
        System::new(graph, time, &states, &[], derivatives, &[output])
    }

    #[test]
    fn a_system_is_shared_between_threads_and_outlives_its_graph() {
        let system = {
            let g = Graph::new();
            build(&g, &[(-g.symbol("x").sqrt()).node()]).unwrap()
        };
        let evaluate = || {
            let (mut dx, mut y) = ([0.0], [0.0]);
            let mut evaluation = system.evaluation();
            evaluation.derivatives(0.0, system.start(), &mut dx);
            evaluation.outputs(0.0, system.start(), &mut y);
            (dx[0], y[0])
        };
        let found = std::thread::scope(|scope| scope.spawn(evaluate).join().unwrap());
        assert_eq!(found, (-2.0, 2.0));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let g = Graph::new();
        let pump = g.symbol("pump").node();
        let missing = build(&g, &[pump]).unwrap_err();
        assert!(missing.to_string().contains("'pump'"), "{missing}");
        let none = build(&g, &[]).unwrap_err();
        assert!(none.to_string().contains("expected 1"), "{none}");
        let system = build(&g, &[g.symbol("x").node()]).unwrap();
        for start in [vec![], vec![f64::NAN]] {
            let error = system.clone().with_start(start).unwrap_err();
            assert!(matches!(error, Error::Setting { .. }), "{error}");
        }
        assert_eq!(system.with_start(vec![1.0]).unwrap().start(), [1.0]);
    }
}
