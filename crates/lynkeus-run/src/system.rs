//! Systems compiled for evaluation, and at work.

use std::fmt::Write;
use std::ops::Range;
use std::sync::Arc;

use lynkeus_expr::{Evaluator, Graph, MissingInput, Node, Tape};
use lynkeus_model::Whens;

use crate::divergence::explained;
use crate::equations::{Both, Equations};
use crate::error::state_text;
use crate::events::{
    Cause, Clauses, Guards, JumpSlopes, Memory, Seen, TimeEvents, WhenExpressions, saltation,
};
use crate::routine::{Routine, Runner};
use crate::snapshot::{Damaged, Digest, Persist, Walk};
use crate::{BetweenSamples, Dynamics, Error, Events, Margin, Result, Slopes};

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

/// What a [`System`] is made of: symbols and expressions of a graph.
#[derive(Clone, Copy, Debug)]
pub struct Parts<'a> {
    /// which holds them
    pub graph: &'a Graph,
    /// a symbol
    pub time: Node,
    /// name, symbol and start value of each
    pub states: &'a [(String, Node, f64)],
    /// name and symbol of each
    pub signals: &'a [(String, Node)],
    /// in the order of the states
    pub derivatives: &'a [Node],
    /// name and expression of each
    pub outputs: &'a [(String, Node)],
    /// by which the state jumps, where it does; their symbols are those above
    pub whens: Option<&'a Whens>,
}

/// The equations of a [`System`] as expressions.
#[derive(Debug)]
pub struct Expressions<'s> {
    /// a copy of the system's own
    pub graph: Graph,
    /// symbols: time, states x, signals w, [modes](System::modes)
    pub inputs: &'s [Node],
    /// x'
    pub derivatives: &'s [Node],
    /// y
    pub outputs: &'s [Node],
}

#[derive(Debug)]
struct Code {
    equations: Arc<Equations>,
    free: Both<Arc<Routine>>,
    /// the same with what jumps with the state held; none where nothing does
    held: Option<Both<Arc<Routine>>>,
    /// the event indicators: what vanishes on the surfaces
    indicators: Tape,
    /// where it jumps and bends with the state, over all inputs
    guards: Option<Arc<Guards>>,
    /// by which its state jumps
    clauses: Option<Arc<Clauses>>,
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
    ) -> Result<Self> {
        Self::of(&Parts {
            graph,
            time,
            states,
            signals,
            derivatives,
            outputs,
            whens: None,
        })
    }

    /// The same, of what may jump.
    ///
    /// # Errors
    /// As [`System::new`].
    pub fn of(parts: &Parts<'_>) -> Result<Self> {
        let Parts {
            graph,
            time,
            states,
            signals,
            derivatives,
            outputs,
            whens,
        } = *parts;
        let none = Whens::default();
        let whens = whens.unwrap_or(&none);
        if states.len() != derivatives.len() {
            let (expected, found) = (per_state(states.len()), derivatives.len());
            return Err(Error::setting("number of derivatives", expected, found));
        }
        let mut symbols = vec![time];
        symbols.extend(states.iter().map(|(_, node, _)| *node));
        symbols.extend(signals.iter().map(|(_, node)| *node));
        let roots: Vec<Node> = outputs.iter().map(|(_, node)| *node).collect();
        let equations = Equations {
            states: states.iter().map(|(name, ..)| name.clone()).collect(),
            signals: signals.iter().map(|(name, _)| name.clone()).collect(),
            outputs: outputs.iter().map(|(name, _)| name.clone()).collect(),
            ..Equations::new(graph, &symbols, derivatives, &roots, whens)?
        };
        let start = states.iter().map(|(.., value)| *value).collect();
        Self::compiled(equations, start)
    }

    /// Code for equations.
    ///
    /// # Errors
    /// As [`System::new`].
    pub(crate) fn compiled(equations: Equations, start: Vec<f64>) -> Result<Self> {
        let equations = Arc::new(equations);
        let Equations { roots, inputs, .. } = &*equations;
        let both = |roots: &Both<Vec<Node>>, inputs: usize| -> Result<_, MissingInput> {
            let routine = |of: &Vec<Node>| Routine::new(&equations, inputs, of.clone(), vec![]);
            Ok(Both {
                derivatives: routine(&roots.derivatives)?,
                outputs: routine(&roots.outputs)?,
            })
        };
        let held = (!equations.jumps.is_empty()).then(|| both(&roots.held, inputs.len()));
        let held = held.transpose()?;
        let free = both(&roots.free, equations.smooth_inputs())?;
        let graph = equations.graph();
        let surfaces: Vec<Node> = roots.surfaces.iter().map(|surface| surface.node).collect();
        let states = equations.states.len();
        let smooth = &inputs[..equations.smooth_inputs()];
        let clauses = roots.whens.as_ref();
        let clauses = clauses.map(|whens| Clauses::new(&graph, smooth, states, whens));
        let code = Code {
            clauses: clauses.transpose()?.map(Arc::new),
            free,
            held,
            indicators: Tape::new(&graph, inputs, &surfaces)?,
            guards: Guards::new(&graph, inputs, states, &roots.surfaces, &roots.bends)?,
            equations: equations.clone(),
        };
        drop(graph);
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
    pub fn with_start(mut self, start: Vec<f64>) -> Result<Self> {
        if start.len() != self.states().len() {
            let (expected, found) = (per_state(self.states().len()), start.len());
            return Err(Error::setting("number of start values", expected, found));
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
            jumps,
            roots,
            ..
        } = &*code.equations;
        let told = (states, signals, outputs, switches, jumps, &roots.surfaces);
        // a digest takes any text
        let _ = write!(digest, "{told:?}");
        for both in [&code.free].into_iter().chain(&code.held) {
            let tapes = (both.derivatives.tape(), both.outputs.tape());
            let _ = write!(digest, "{tapes:?}");
        }
        let _ = write!(digest, "{:?}", code.indicators);
        if let Some(clauses) = &code.clauses {
            let _ = write!(digest, "{clauses:?}");
        }
        digest.numbers(&self.start);
    }

    /// Whether another one has the same code, and differs in numbers alone.
    pub(crate) fn has_code_of(&self, other: &Self) -> bool {
        Arc::ptr_eq(&self.code, &other.code)
    }

    /// The equations that it is compiled from.
    pub(crate) fn equations(&self) -> &Equations {
        &self.code.equations
    }

    /// The code of x'.
    pub(crate) fn derivatives_at(&self) -> &Routine {
        &self.code.free.derivatives
    }

    /// Its equations, without what jumps.
    pub fn expressions(&self) -> Expressions<'_> {
        let equations = &*self.code.equations;
        let roots = &equations.roots.free;
        Expressions {
            graph: equations.graph().clone(),
            inputs: &equations.inputs[..equations.smooth_inputs()],
            derivatives: &roots.derivatives,
            outputs: &roots.outputs,
        }
    }

    /// The clauses by which its state jumps, over its [inputs](Expressions::inputs); none where it never does.
    pub fn whens(&self) -> Option<WhenExpressions<'_>> {
        let equations = &*self.code.equations;
        let inputs = &equations.inputs[..equations.smooth_inputs()];
        let whens = equations.roots.whens.as_ref()?;
        Some(whens.expressions(&equations.graph(), inputs, self.states().len()))
    }

    /// How many values the switches in time have: what jumps with time alone is an input of the
    /// equations.
    pub fn modes(&self) -> usize {
        self.code.equations.modes()
    }

    /// Whether it jumps or bends (as max does) with time alone, at instants that are found and at
    /// which an integration stops.
    pub fn bends_with_time(&self) -> bool {
        let mut switches = self.code.equations.switches.iter();
        switches.any(|switches| !switches.is_empty())
    }

    /// Whether an integration stops at instants within a step: where it [bends with
    /// time](Self::bends_with_time), or its state jumps by clauses.
    pub fn has_instants(&self) -> bool {
        self.has_clauses() || self.bends_with_time()
    }

    /// Whether its state jumps by clauses.
    pub fn has_clauses(&self) -> bool {
        self.code.clauses.is_some()
    }

    /// An evaluator with its own working memory, signals at zero.
    pub fn evaluation(&self) -> Evaluation {
        let code = &self.code;
        let runners = |both: &Both<Arc<Routine>>| Both {
            derivatives: both.derivatives.runner(),
            outputs: both.outputs.runner(),
        };
        Evaluation {
            free: runners(&code.free),
            held: code.held.as_ref().map(runners),
            is_held: false,
            indicators: code.indicators.evaluator(),
            switches: code.equations.switches.clone(),
            inputs: vec![0.0; code.equations.smooth_inputs()],
            follows: false,
            line: None,
            last: vec![],
            next: vec![],
            system: self.clone(),
        }
    }

    /// An evaluator whose signals are known at samples.
    pub(crate) fn driven(&self, between: BetweenSamples) -> Evaluation {
        let signals = vec![0.0; self.signals().len()];
        Evaluation {
            follows: between == BetweenSamples::Linear,
            last: signals.clone(),
            next: signals,
            ..self.evaluation()
        }
    }
}

fn per_state(states: usize) -> String {
    format!("{states}, one per state")
}

/// Evaluates one [`System`] without allocating; holds the values of its signals.
#[derive(Clone, Debug)]
pub struct Evaluation {
    system: System,
    free: Both<Runner>,
    held: Option<Both<Runner>>,
    /// it is on known sides of the surfaces on which it jumps
    is_held: bool,
    indicators: Evaluator,
    /// of each part of the system
    switches: Vec<TimeEvents>,
    /// t, x, w, modes; while they are held, the values of what jumps with the state as well
    inputs: Vec<f64>,
    /// signals are straight lines between two samples
    follows: bool,
    /// the interval under way, where they do
    line: Option<(f64, f64)>,
    /// signals at the samples around, where it is driven by samples
    last: Vec<f64>,
    next: Vec<f64>,
}

impl Evaluation {
    /// The system.
    pub fn system(&self) -> &System {
        &self.system
    }

    /// The place of the first mode among the inputs.
    fn first_mode(&self) -> usize {
        1 + self.system.states().len() + self.system.signals().len()
    }

    /// The signals' values, in the order of [`System::signals`], to write to.
    pub fn signals_mut(&mut self) -> &mut [f64] {
        let places = self.signal_places();
        &mut self.inputs[places]
    }

    /// The signals' values.
    pub fn signals(&self) -> &[f64] {
        &self.inputs[self.signal_places()]
    }

    fn signal_places(&self) -> Range<usize> {
        1 + self.system.states().len()..self.first_mode()
    }

    /// The first sample.
    pub(crate) fn start(&mut self, signals: &[f64]) {
        self.next.copy_from_slice(signals);
        self.arrive();
    }

    /// The sample at the end of the interval to come, of the first signals; others stay.
    pub(crate) fn aim(&mut self, from: f64, to: f64, signals: &[f64]) {
        self.line = self.follows.then_some((from, to));
        self.next.copy_from_slice(&self.last);
        self.next[..signals.len()].copy_from_slice(signals);
    }

    /// The interval is over: its last sample is the present one.
    pub(crate) fn arrive(&mut self) {
        self.line = None;
        self.last.copy_from_slice(&self.next);
        let places = self.signal_places();
        self.inputs[places].copy_from_slice(&self.last);
    }

    /// Writes the outputs at (t, x) to `y`, in the order of [`System::outputs`].
    ///
    /// Modes are those of the last [`Events::enter`].
    pub fn outputs(&mut self, t: f64, x: &[f64], y: &mut [f64]) {
        let (both, inputs) = self.at(t, x);
        both.outputs.eval(inputs, y);
    }

    /// Writes the derivatives of the outputs by the states at (t, x), where they are known.
    pub(crate) fn output_slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        let (both, inputs) = self.at(t, x);
        both.outputs.slopes(inputs, x.len(), slopes)
    }

    /// Writes what an observer reports at (t, x), in the order of
    /// [`System::estimates`].
    pub fn estimates(&mut self, t: f64, x: &[f64], estimates: &mut [f64]) {
        match self.system.outputs().is_empty() {
            true => estimates.copy_from_slice(x),
            false => self.outputs(t, x, estimates),
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
        let margins = (&*system.margins, &values[..]);
        explained(error, system.states(), x, scale, margins)
    }

    /// Values of the switches at the last [`Events::enter`]; then, while it is held, those of the
    /// operations that jump with the state.
    pub(crate) fn modes(&self) -> &[f64] {
        &self.inputs[self.first_mode()..]
    }

    /// Whether it is on known sides of the surfaces on which it jumps.
    pub(crate) fn is_held(&self) -> bool {
        self.is_held
    }

    /// Goes to these values of the switches, and to these of what is held.
    pub(crate) fn enter_modes(&mut self, modes: &[f64], held_modes: &[f64]) {
        self.inputs.truncate(self.first_mode());
        self.inputs.extend_from_slice(modes);
        self.inputs.extend_from_slice(held_modes);
        self.is_held = !held_modes.is_empty();
    }

    /// Goes to (t, x): what its equations read there; none where not all of it stays over a step.
    pub(crate) fn free_inputs(&mut self, t: f64, x: &[f64]) -> Option<&mut Vec<f64>> {
        let stays = !self.is_held && self.line.is_none();
        stays.then(|| self.at(t, x).1)
    }

    /// What clauses read at (t, x); states that a wrapper adds do not count.
    fn smooth_at(&mut self, t: f64, x: &[f64]) -> &[f64] {
        let states = self.system.states().len();
        let smooth = self.system.code.equations.smooth_inputs();
        &self.at(t, &x[..states]).1[..smooth]
    }

    /// Lets clauses take effect, as [`Dynamics::happen`], with the slopes of the jump.
    ///
    /// # Errors
    /// As there.
    pub fn jump(
        &mut self,
        t: f64,
        x: &mut [f64],
        memory: &mut Memory,
        slopes: Option<&mut JumpSlopes>,
    ) -> Result<Option<usize>> {
        let Some(clauses) = self.system.code.clauses.clone() else {
            return Ok(None);
        };
        let inputs = self.smooth_at(t, x).to_vec();
        let states = self.system.states().len();
        clauses.happen(&inputs, &mut x[..states], memory, slopes)
    }

    /// What a jump at (t, x) makes of deviations, as [`Dynamics::settle`] has it of states without what a wrapper adds:
    /// the saltation matrix row by row, and how far the state moves where the event was late.
    ///
    /// # Errors
    /// As there.
    pub fn saltation(
        &mut self,
        (t, x): (f64, &[f64]),
        jump: &JumpSlopes,
        rates: [&[f64]; 2],
        cause: Option<Cause>,
        line: usize,
    ) -> Result<(Vec<f64>, Vec<f64>)> {
        let gradient = cause.map(|cause| self.gradient(t, x, cause.relation));
        let gradient = gradient.unwrap_or_default();
        saltation(jump, &gradient, rates, cause, (t, line))
    }

    /// The slopes of the quantity of a relation by the states at (t, x).
    fn gradient(&mut self, t: f64, x: &[f64], relation: usize) -> Vec<f64> {
        match self.system.code.clauses.clone() {
            Some(clauses) => clauses.gradient(self.smooth_at(t, x), relation),
            None => vec![],
        }
    }

    /// Goes to (t, x): the code that is in force there, and what it reads.
    fn at(&mut self, t: f64, x: &[f64]) -> (&mut Both<Runner>, &mut Vec<f64>) {
        self.inputs[0] = t;
        self.inputs[1..=x.len()].copy_from_slice(x);
        if let Some((from, to)) = self.line {
            let s = (t - from) / (to - from);
            let ends = self.last.iter().zip(&self.next);
            for (signal, (last, next)) in self.inputs[1 + x.len()..].iter_mut().zip(ends) {
                *signal = last + s * (next - last);
            }
        }
        match &mut self.held {
            Some(held) if self.is_held => (held, &mut self.inputs),
            _ => (&mut self.free, &mut self.inputs),
        }
    }
}

impl Persist for Evaluation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        // between two calls no interval is under way
        self.line = None;
        walk.numbers(self.signals_mut())?;
        self.switches.iter_mut().try_for_each(|s| s.walk(walk))?;
        walk.numbers(&mut self.last)?;
        walk.numbers(&mut self.next)
    }
}

impl Dynamics for Evaluation {
    fn dimension(&self) -> usize {
        self.system.states().len()
    }

    fn derivatives(&mut self, t: f64, x: &[f64], dx: &mut [f64]) {
        let (both, inputs) = self.at(t, x);
        both.derivatives.eval(inputs, dx);
    }

    fn slopes(&mut self, t: f64, x: &[f64], slopes: &mut Slopes) -> bool {
        let (both, inputs) = self.at(t, x);
        both.derivatives.slopes(inputs, x.len(), slopes)
    }

    fn steps(&mut self, steps: &[[f64; 2]], x: &[f64], next: &mut [f64]) -> bool {
        let stays = !self.is_held && self.line.is_none();
        stays && self.free.derivatives.steps(&self.inputs, steps, x, next)
    }

    fn events(&mut self) -> Option<&mut dyn Events> {
        Some(self)
    }

    fn clauses(&self) -> Option<Arc<Clauses>> {
        self.system.code.clauses.clone()
    }

    fn watch(&mut self, t: f64, x: &[f64], seen: &mut Vec<Seen>) {
        if let Some(clauses) = self.system.code.clauses.clone() {
            clauses.see(self.smooth_at(t, x), seen);
        }
    }

    fn rates(&mut self, t: f64, x: &[f64], dx: &[f64]) -> Vec<f64> {
        let Some(clauses) = self.system.code.clauses.clone() else {
            return vec![];
        };
        let mut beside = vec![];
        self.beside(t, &mut beside);
        let states = self.system.states().len();
        let time = std::iter::once(1.0);
        let speeds = time.chain(dx[..states].iter().copied());
        let speeds: Vec<f64> = speeds.chain(beside.iter().map(|pair| pair[1])).collect();
        clauses.rates(self.smooth_at(t, x), &speeds)
    }

    fn truths(&mut self, t: f64, x: &[f64]) -> Result<Vec<bool>> {
        match self.system.code.clauses.clone() {
            Some(clauses) => clauses.truths(self.smooth_at(t, x)),
            None => Ok(vec![]),
        }
    }

    fn happen(&mut self, t: f64, x: &mut [f64], memory: &mut Memory) -> Result<Option<usize>> {
        self.jump(t, x, memory, None)
    }

    fn names(&self) -> Vec<String> {
        self.system.states().to_vec()
    }

    fn not_finite(&mut self, t: f64, x: &[f64]) -> Error {
        self.at(t, x);
        let Code {
            equations, free, ..
        } = &*self.system.code;
        let inputs = &self.inputs[..equations.smooth_inputs()];
        let mut all = [&free.derivatives, &free.outputs].into_iter();
        let named = all.find_map(|routine| routine.first_nonfinite(inputs));
        Error::NotFinite {
            time: t,
            operation: named.unwrap_or_else(|| "a value overflows".to_owned()),
            state: state_text(self.system.states(), x),
        }
    }
}

impl Events for Evaluation {
    fn instants(&mut self, from: f64, to: f64, times: &mut Vec<f64>) -> Result<()> {
        let mut switches = self.switches.iter_mut();
        switches.try_for_each(|switches| switches.instants(from, to, times))?;
        match &self.system.code.clauses {
            Some(clauses) => clauses.instants(from, to, times),
            None => Ok(()),
        }
    }

    fn enter(&mut self, t: f64) {
        let first = self.first_mode();
        let mut modes = &mut self.inputs[first..];
        for switches in &mut self.switches {
            let (own, rest) = modes.split_at_mut(switches.modes());
            switches.modes_at(t, own);
            modes = rest;
        }
    }

    fn guards(&self) -> Option<Arc<Guards>> {
        self.system.code.guards.clone()
    }

    fn indicators(&mut self, t: f64, x: &[f64], values: &mut [f64]) {
        self.at(t, &x[..self.dimension()]);
        if self.is_held || self.held.is_none() {
            self.indicators.eval(&self.inputs, values);
        }
    }

    fn hold(&mut self, sides: Option<&[f64]>) {
        let equations = &self.system.code.equations;
        self.inputs.truncate(equations.smooth_inputs());
        let jumps = equations.jumps.iter();
        let values = sides.map(|sides| jumps.map(|jump| jump.value(sides)));
        self.inputs.extend(values.into_iter().flatten());
        self.is_held = sides.is_some() && self.held.is_some();
    }

    fn beside(&mut self, t: f64, values: &mut Vec<[f64; 2]>) {
        let first = 1 + self.dimension();
        values.clear();
        values.extend(self.inputs[first..].iter().map(|&v| [v, 0.0]));
        let Some((from, to)) = self.line else {
            return;
        };
        let s = (t - from) / (to - from);
        let ends = self.last.iter().zip(&self.next);
        for (value, (last, next)) in values.iter_mut().zip(ends) {
            *value = [last + s * (next - last), (next - last) / (to - from)];
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
