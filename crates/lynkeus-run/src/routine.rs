//! Code of equations: tapes that are interpreted at first, and run as machine code once that pays.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};

use lynkeus_expr::{Expr, Graph, MissingInput, Node, Tape, jacobian};
use lynkeus_native::Function;

use crate::classical::{Term, classical_step};
use crate::equations::Equations;
use crate::steps::{Steps, is_fused};
use crate::{Place, Slopes};

/// What evaluates systems. All give the same values to the bit, so that it is a matter of speed.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Backend {
    /// the interpreter at first, machine code for what is evaluated often
    #[default]
    Auto,
    /// the interpreter alone
    Interpreter,
    /// machine code from the first evaluation, wherever it can be made
    Native,
}

static BACKEND: AtomicU8 = AtomicU8::new(Backend::Auto as u8);

impl Backend {
    /// Takes this one for whatever is evaluated in this process from now on.
    pub fn choose(self) {
        BACKEND.store(self as u8, Ordering::Relaxed);
    }

    /// Whether what is evaluated very often is compiled before it is.
    pub(crate) fn compiles_at_once() -> bool {
        Self::patience(0).is_some()
    }

    /// Evaluations after which machine code is made; none for never.
    fn patience(most: u32) -> Option<u32> {
        match BACKEND.load(Ordering::Relaxed) {
            b if b == Self::Interpreter as u8 => None,
            b if b == Self::Native as u8 => Some(0),
            _ => Some(most),
        }
    }
}

/// Evaluations that take as long as compiling does (`BENCHMARKS.md`).
const PATIENCE: u32 = 200;

/// Largest tape whose step is made one function: it has four times the instructions.
pub(crate) const LARGEST_STEP: usize = 50_000;

/// Largest tape whose steps run as one loop of machine code: four times the instructions of a larger one leave the
/// first caches, and its stages run faster one by one (`BENCHMARKS.md`, growth).
const LARGEST_LOOP: usize = 1_500;

/// Some expressions of a system as functions of its first inputs, with the code that was made of
/// them, shared by all that run it.
#[derive(Debug)]
pub(crate) struct Routine {
    equations: Arc<Equations>,
    outputs: Vec<Node>,
    tape: Tape,
    native: OnceLock<Option<Function<1>>>,
    of_step: OnceLock<Option<Tape>>,
    steps: OnceLock<Option<Steps>>,
    slopes: OnceLock<Option<Arc<Routine>>>,
    /// where its values stand in a Jacobian, if they do
    places: Arc<[Place]>,
}

/// Derivatives that are written down without asking whether they pay.
const FEW: usize = 50_000;

/// More than these are written down where differences would take so many times as many operations.
const SAVED: usize = 20;

impl Routine {
    /// `outputs` as functions of so many inputs; their places where they are entries of a Jacobian.
    ///
    /// # Errors
    /// [`MissingInput`] where an output depends on another symbol.
    pub fn new(
        equations: &Arc<Equations>,
        inputs: usize,
        outputs: Vec<Node>,
        places: Vec<Place>,
    ) -> Result<Arc<Self>, MissingInput> {
        let tape = Tape::new(&equations.graph(), &equations.inputs[..inputs], &outputs)?;
        Ok(Arc::new(Self {
            equations: equations.clone(),
            outputs,
            tape,
            native: OnceLock::new(),
            of_step: OnceLock::new(),
            steps: OnceLock::new(),
            slopes: OnceLock::new(),
            places: places.into(),
        }))
    }

    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    /// The symbols of its inputs.
    fn inputs(&self) -> &[Node] {
        &self.equations.inputs[..self.tape.inputs()]
    }

    /// Names the first operation that makes a NaN or an infinity at these inputs.
    pub fn first_nonfinite(&self, inputs: &[f64]) -> Option<String> {
        self.tape.first_nonfinite(&self.equations.graph(), inputs)
    }

    /// For expressions x' of time, states and what is constant: one step of the classical
    /// Runge–Kutta method in the graph of the equations, the symbols that it reads (the step's
    /// length last) and the states at its end. None where the step is too large for one function.
    pub fn step_in(&self, graph: &Graph) -> Option<(Vec<Node>, Vec<Node>)> {
        let is_small = self.tape.len() <= LARGEST_STEP;
        is_small.then(|| step_of(graph, self.inputs(), &self.outputs))
    }

    fn native(&self) -> Option<&Function<1>> {
        let compile = || Function::compile(&self.tape);
        self.native.get_or_init(compile).as_ref()
    }

    fn of_step(&self) -> Option<&Tape> {
        let make = || {
            // fused operations belong to the step
            if self.tape.len() > LARGEST_LOOP && !is_fused() {
                return None;
            }
            let graph = self.equations.graph();
            let (inputs, next) = self.step_in(&graph)?;
            Steps::tape(&graph, &inputs, &next, is_fused()).ok()
        };
        self.of_step.get_or_init(make).as_ref()
    }

    fn steps(&self) -> Option<&Steps> {
        let compile = || Steps::compiled(self.of_step()?);
        self.steps.get_or_init(compile).as_ref()
    }

    /// The derivatives by so many states, which follow time among the inputs, found when they are first
    /// asked for. None where those written down would be too many for what they save.
    fn slopes(&self, states: usize) -> Option<&Arc<Self>> {
        let find = || {
            let x = &self.inputs()[1..=states];
            let most = FEW.max(self.tape.len().saturating_mul(states) / SAVED);
            let graph = self.equations.graph();
            jacobian::size(&graph, &self.outputs, x, most)?;
            let entries = jacobian::forward(&graph, &self.outputs, x).entries;
            drop(graph);
            let entries = entries.into_iter();
            let placed = entries.map(|(row, column, node)| (node, Place { row, column }));
            let (nodes, places) = placed.unzip();
            Self::new(&self.equations, self.tape.inputs(), nodes, places).ok()
        };
        self.slopes.get_or_init(find).as_ref()
    }

    pub fn runner(self: &Arc<Self>) -> Runner {
        Runner {
            interpreter: self.tape.evaluator(),
            routine: self.clone(),
            native: Engine::default(),
            steps: Engine::default(),
            fused: None,
            slopes: None,
        }
    }
}

/// One step of the classical Runge–Kutta method for x' = `slopes`, functions of `inputs`: time, the
/// states and what is constant. What the stages have in common is computed once.
fn step_of(g: &Graph, inputs: &[Node], slopes: &[Node]) -> (Vec<Node>, Vec<Node>) {
    let h = g.fresh("h");
    let states = &inputs[1..=slopes.len()];
    let x: Vec<Term<'_>> = states.iter().map(|&x| Some(g.expr(x))).collect();
    let slope = |t: Expr<'_>, x: &[Term<'_>]| {
        let at = [Some(t)].into_iter().chain(x.iter().copied()).flatten();
        let places = inputs.iter().copied().zip(at.map(Expr::node));
        let found = g.substitute(slopes, &places.collect());
        found.into_iter().map(|k| Some(g.expr(k))).collect()
    };
    let next = classical_step(g.expr(inputs[0]), h, &x, slope);
    // a state is never nothing
    let next = next.into_iter().flatten().map(Expr::node).collect();
    ([inputs, &[h.node()]].concat(), next)
}

/// Machine code in use, and how often it would have been before.
#[derive(Clone, Debug)]
pub(crate) struct Engine<F = Function<1>> {
    waited: usize,
    running: Option<F>,
}

impl<F> Default for Engine<F> {
    fn default() -> Self {
        Self {
            waited: 0,
            running: None,
        }
    }
}

impl<F: Clone> Engine<F> {
    /// The machine code, made when its time has come: where it would have been of use so often.
    pub fn ready<'f>(
        &mut self,
        patience: u32,
        make: impl FnOnce() -> Option<&'f F>,
    ) -> Option<&mut F>
    where
        F: 'f,
    {
        self.ready_for(1, patience, make)
    }

    /// As [`Engine::ready`], for so many evaluations.
    pub fn ready_for<'f>(
        &mut self,
        uses: usize,
        patience: u32,
        make: impl FnOnce() -> Option<&'f F>,
    ) -> Option<&mut F>
    where
        F: 'f,
    {
        if self.running.is_none() {
            let patience = Backend::patience(patience);
            if patience.is_none_or(|patience| self.waited < patience as usize) {
                self.waited = self.waited.saturating_add(uses);
                return None;
            }
            // what cannot be compiled is not tried again: the routine remembers
            self.running = make().cloned();
        }
        self.running.as_mut()
    }
}

/// Runs one [`Routine`] again and again, without allocating.
#[derive(Clone, Debug)]
pub(crate) struct Runner {
    routine: Arc<Routine>,
    interpreter: lynkeus_expr::Evaluator,
    native: Engine,
    steps: Engine<Steps>,
    /// what has no other form, before there is machine code
    fused: Option<Box<Steps>>,
    /// of the derivatives, once they were asked for
    slopes: Option<Box<Runner>>,
}

impl Runner {
    /// Writes the outputs at `inputs`.
    #[inline]
    pub fn eval(&mut self, inputs: &[f64], outputs: &mut [f64]) {
        match self.native.ready(PATIENCE, || self.routine.native()) {
            Some(native) => native.eval(inputs.as_chunks().0, outputs.as_chunks_mut().0),
            None => self.interpreter.eval(inputs, outputs),
        }
    }

    /// Writes the derivatives of the outputs by the states at `inputs`, where they are known.
    pub fn slopes(&mut self, inputs: &[f64], states: usize, slopes: &mut Slopes) -> bool {
        let Some(known) = self.routine.slopes(states) else {
            return false;
        };
        let runner = self.slopes.get_or_insert_with(|| Box::new(known.runner()));
        runner.eval(inputs, slopes.at(&known.places));
        true
    }

    /// For a routine (t, x, w) → dx: steps of the classical Runge–Kutta method, the time and the length of each,
    /// from `x` to `next`; of the inputs t and x do not count. False where that is not done at once.
    pub fn steps(
        &mut self,
        inputs: &[f64],
        steps: &[[f64; 2]],
        x: &[f64],
        next: &mut [f64],
    ) -> bool {
        let Self { routine, fused, .. } = self;
        let count = match steps.len() {
            // those that are not done at once come again one by one
            2.. if !is_fused() => 0,
            count => count,
        };
        let mut compiled = self.steps.ready_for(count, PATIENCE, || routine.steps());
        if compiled.is_none() && is_fused() {
            if fused.is_none() {
                let interpreted = |tape| Box::new(Steps::interpreted(tape));
                *fused = routine.of_step().map(interpreted);
            }
            compiled = fused.as_deref_mut();
        }
        let Some(code) = compiled else {
            return false;
        };
        code.advance(&inputs[1 + x.len()..], steps, x, next);
        true
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Twice as many as are taken at once, and some: as machine code and interpreted, each product and sum rounded by
    /// itself or fused, are the same to the bit; not fused they are those of the method written in Rust, too.
    #[test]
    fn steps_at_once_are_steps_one_by_one() {
        let g = Graph::new();
        let [t, x, v, w, mode] = ["t", "x", "v", "w", "mode"].map(|name| g.symbol(name));
        let inputs = [t, x, v, w, mode].map(|e| e.node());
        let wave = (t * 3.0).sin() * mode;
        let slopes = [
            v * wave - w * x * v + 0.1 * x,
            (1.0 - x * x) * v - x + (wave - t).exp() * 0.3 - w * 2.0,
        ]
        .map(|e| e.node());
        let tape = Tape::new(&g, &inputs, &slopes).unwrap();
        let (of_step, next) = step_of(&g, &inputs, &slopes);
        let steps: Vec<[f64; 2]> = (0..150)
            .map(|k| [0.01 * f64::from(k), 0.01 + 1e-4 * f64::from(k % 5 - 2)])
            .collect();
        let start = [0.8, -0.4];
        let mut evaluator = tape.evaluator();
        let mut f = crate::Function::new(2, |t, x: &[f64], dx: &mut [f64]| {
            evaluator.eval(&[t, x[0], x[1], 0.7, 1.3], dx);
        });
        let (mut x, mut rk4) = (start, crate::Rk4::new(2));
        for [t, h] in &steps {
            rk4.step(&mut f, *t, *h, &mut x).unwrap();
        }
        let ends = [false, true].map(|is_fused| {
            let tape = Steps::tape(&g, &of_step, &next, is_fused).unwrap();
            let end = |mut code: Steps| {
                let mut end = [0.0; 2];
                code.advance(&[0.7, 1.3], &steps, &start, &mut end);
                end
            };
            let interpreted = end(Steps::interpreted(&tape));
            if let Some(code) = Steps::compiled(&tape) {
                assert_eq!(end(code), interpreted);
            }
            interpreted
        });
        assert_eq!(ends[0], x);
        assert!(ends[1] != x && (ends[1][0] - x[0]).abs() < 1e-12);
    }

    /// A state that all others read is one column; a dense right-hand side of many operations is
    /// left to differences.
    #[test]
    fn derivatives_are_not_written_down_at_any_price() {
        let known = |n: usize, dense: bool| {
            let g = Graph::new();
            let t = g.symbol("t").node();
            let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
            let sum = x.iter().copied().reduce(|a, b| a + b.sin()).unwrap();
            let read = if dense { sum } else { x[0] };
            let dx: Vec<Node> = (0..n)
                .map(|i| (x[i] * read + i as f64).exp().node())
                .collect();
            let symbols: Vec<Node> = [t].into_iter().chain(x.iter().map(|x| x.node())).collect();
            let equations =
                Arc::new(Equations::new(&g, &symbols, &dx, &[], &Default::default()).unwrap());
            let dx = equations.roots.free.derivatives.clone();
            let routine = Routine::new(&equations, symbols.len(), dx, vec![]).unwrap();
            routine.slopes(n).map(|known| known.places.len())
        };
        assert_eq!(known(400, false), Some(799));
        assert!(known(400, true).is_none());
        assert!(known(40, true).is_some());
    }
}
