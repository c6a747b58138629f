//! Systems compiled for evaluation.

mod evaluation;

use std::fmt::Write;
use std::sync::{Arc, Mutex};

use lynkeus_expr::{Graph, Node, Tape};

use crate::events::{Extracted, Guards, Jumps, Taken, TimeEvents, extract};
use crate::routine::Routine;
use crate::snapshot::Digest;
use crate::{Error, Margin};
pub use evaluation::Evaluation;

/// A compiled system x' = f(t, x, w), y = h(t, x, w): a plant, an observer, or
/// (without states) inputs as functions of time.
///
/// The signals w are everything the right-hand side reads beside time and
/// states. A system owns its code: it is cheap to clone, `Send` and `Sync`, and
/// independent of the graph it was made from. An [`Evaluation`] evaluates it.
#[derive(Clone, Debug)]
pub struct System {
    code: Arc<Code>,
    start: Vec<f64>,
    margins: Arc<[Margin]>,
}

#[derive(Debug)]
struct Code {
    states: Vec<String>,
    signals: Vec<String>,
    outputs: Vec<String>,
    derivatives_at: Arc<Routine>,
    outputs_at: Arc<Routine>,
    switches: TimeEvents,
    modes: usize,
    /// the same with what jumps with the state held; none where nothing does
    held: Option<HeldCode>,
    /// where it jumps and bends with the state, over the same inputs and the modes of what is held
    guards: Option<Arc<Guards>>,
    /// the functions of the guards' bends, of these inputs; none where there are none
    bends_at: Option<Tape>,
    /// only to name an operation in an error
    graph: Mutex<Graph>,
}

/// Code whose last inputs are the values of the operations that jump with the state.
#[derive(Debug)]
struct HeldCode {
    derivatives_at: Arc<Routine>,
    outputs_at: Arc<Routine>,
    jumps: Jumps,
    /// number of these operations
    modes: usize,
}

impl HeldCode {
    fn new(
        graph: &Graph,
        inputs: &[Node],
        taken: Taken<Jumps>,
        states: usize,
    ) -> Result<Self, Error> {
        let (dx, y) = taken.roots.split_at(states);
        let inputs = [inputs, &taken.modes].concat();
        Ok(Self {
            derivatives_at: Routine::new(Tape::new(graph, &inputs, dx)?),
            outputs_at: Routine::new(Tape::new(graph, &inputs, y)?),
            jumps: taken.events,
            modes: taken.modes.len(),
        })
    }
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
        let own = Graph::new();
        let mut symbols = vec![time];
        symbols.extend(states.iter().map(|(_, node, _)| *node));
        symbols.extend(signals.iter().map(|(_, node)| *node));
        let roots: Vec<Node> = derivatives
            .iter()
            .copied()
            .chain(outputs.iter().map(|(_, node)| *node))
            .collect();
        let all: Vec<Node> = symbols.iter().chain(&roots).copied().collect();
        let image = own.copied(graph, &all);
        let mut inputs: Vec<Node> = symbols.iter().map(|s| image[s]).collect();
        let roots: Vec<Node> = roots.iter().map(|r| image[r]).collect();
        let Extracted {
            time,
            state,
            guards,
            bends,
        } = extract(&own, &inputs, &roots, derivatives.len())?;
        inputs.extend(&time.modes);
        let held = state.map(|taken| HeldCode::new(&own, &inputs, taken, derivatives.len()));
        let (dx, y) = time.roots.split_at(derivatives.len());
        let code = Code {
            states: states.iter().map(|(name, ..)| name.clone()).collect(),
            signals: signals.iter().map(|(name, _)| name.clone()).collect(),
            outputs: outputs.iter().map(|(name, _)| name.clone()).collect(),
            derivatives_at: Routine::new(Tape::new(&own, &inputs, dx)?),
            outputs_at: Routine::new(Tape::new(&own, &inputs, y)?),
            modes: time.modes.len(),
            switches: time.events,
            held: held.transpose()?,
            guards,
            bends_at: bends,
            graph: Mutex::new(own),
        };
        let start = states.iter().map(|(.., value)| *value).collect();
        let code = Arc::new(code);
        Self {
            code,
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
        &self.code.states
    }

    /// Start values, in the order of the states.
    pub fn start(&self) -> &[f64] {
        &self.start
    }

    /// Names of the signals w.
    pub fn signals(&self) -> &[String] {
        &self.code.signals
    }

    /// Names of the outputs.
    pub fn outputs(&self) -> &[String] {
        &self.code.outputs
    }

    /// Names of what an observer reports: its outputs, or its states where it has
    /// no outputs.
    pub fn estimates(&self) -> &[String] {
        if self.code.outputs.is_empty() {
            &self.code.states
        } else {
            &self.code.outputs
        }
    }

    /// What the system's numbers follow from: the tapes, not the machine code made of them.
    pub(crate) fn tell(&self, digest: &mut Digest) {
        let code = &*self.code;
        let names = (&code.states, &code.signals, &code.outputs, &code.switches);
        // a digest takes any text
        let _ = write!(digest, "{names:?}");
        for routine in [&code.derivatives_at, &code.outputs_at] {
            let _ = write!(digest, "{:?}", routine.tape());
        }
        if let Some(code) = &code.held {
            for routine in [&code.derivatives_at, &code.outputs_at] {
                let _ = write!(digest, "{:?}", routine.tape());
            }
            let _ = write!(digest, "{:?}", code.jumps);
        }
        digest.numbers(&self.start);
    }

    /// (t, x, w, [modes](System::modes)) → x'.
    pub fn derivative_tape(&self) -> &Tape {
        self.code.derivatives_at.tape()
    }

    /// (t, x, w, [modes](System::modes)) → y.
    pub fn output_tape(&self) -> &Tape {
        self.code.outputs_at.tape()
    }

    /// (t, x, w, modes, held modes) → y on the sides of the surfaces that are held: the plain ones where nothing jumps with the state.
    pub(crate) fn held_outputs_tape(&self) -> &Tape {
        let held = self.code.held.as_ref();
        held.map_or(self.output_tape(), |held| held.outputs_at.tape())
    }

    /// What vanishes on the surfaces, of the same inputs, and what else is known of them.
    pub(crate) fn surfaces(&self) -> Option<(&Tape, &Guards)> {
        let held = self.code.held.as_ref()?;
        Some((&held.jumps.indicators, self.code.guards.as_ref()?))
    }

    /// What vanishes where x' bends with the state, of the same inputs.
    pub(crate) fn bends(&self) -> Option<&Tape> {
        self.code.bends_at.as_ref()
    }

    /// How many operations jump with the state.
    pub(crate) fn held_modes(&self) -> usize {
        self.code.held.as_ref().map_or(0, |held| held.modes)
    }

    /// How many values the switches in time have: what jumps with time alone is an input of the
    /// tapes.
    pub fn modes(&self) -> usize {
        self.code.modes
    }

    /// Whether it jumps or bends (as max does) with time alone, at instants that are found and at
    /// which an integration stops.
    pub fn has_instants(&self) -> bool {
        !self.code.switches.is_empty()
    }

    /// An evaluator with its own working memory, signals at zero.
    pub fn evaluation(&self) -> Evaluation {
        Evaluation::new(self)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Dynamics;

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
