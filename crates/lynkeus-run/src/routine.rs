//! Tapes that are interpreted at first, and run as machine code once that pays.

use std::sync::atomic::{AtomicU8, Ordering};
use std::sync::{Arc, OnceLock};

use lynkeus_expr::{Expr, Graph, Node, Nodes, Tape, jacobian};
use lynkeus_native::Function;

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

/// A tape with the code that was made of it, shared by all that run it.
#[derive(Debug)]
pub(crate) struct Routine {
    tape: Tape,
    native: OnceLock<Option<Function<1>>>,
    step: OnceLock<Option<Function<1>>>,
    slopes: OnceLock<Option<Differentiated>>,
}

impl Routine {
    pub fn new(tape: Tape) -> Arc<Self> {
        Arc::new(Self {
            tape,
            native: OnceLock::new(),
            step: OnceLock::new(),
            slopes: OnceLock::new(),
        })
    }

    pub fn tape(&self) -> &Tape {
        &self.tape
    }

    fn native(&self) -> Option<&Function<1>> {
        let compile = || Function::compile(&self.tape);
        self.native.get_or_init(compile).as_ref()
    }

    fn step(&self) -> Option<&Function<1>> {
        let compile = || {
            let is_small = self.tape.len() <= LARGEST_STEP;
            Function::compile(&is_small.then(|| classical_step(&self.tape))??)
        };
        self.step.get_or_init(compile).as_ref()
    }

    /// The derivatives by the states, which follow time among the inputs. They are found when
    /// they are first asked for.
    fn slopes(&self, states: usize) -> Option<&Differentiated> {
        let find = || Differentiated::new(&self.tape, states);
        self.slopes.get_or_init(find).as_ref()
    }

    pub fn runner(self: &Arc<Self>) -> Runner {
        Runner {
            interpreter: self.tape.evaluator(),
            routine: self.clone(),
            native: Engine::default(),
            step: Engine::default(),
            slopes: None,
        }
    }
}

/// One step of the classical Runge–Kutta method for a tape (t, x, w) → dx: the tape
/// (t, x, w, h) → x at t + h, operation by operation what [`Rk4`](crate::Rk4) does. What the
/// stages have in common is computed once.
pub(crate) fn classical_step(tape: &Tape) -> Option<Tape> {
    let g = Graph::new();
    let symbols: Vec<Expr<'_>> = (0..tape.inputs()).map(|_| g.fresh("w")).collect();
    let h = g.fresh("h");
    let (t, x) = (symbols[0], &symbols[1..=tape.outputs()]);
    let slope = |t: Expr<'_>, at: &[Node]| -> Vec<Node> {
        let rest = symbols[1 + at.len()..].iter().map(|e| e.node());
        let inputs: Vec<Node> = [t.node()]
            .into_iter()
            .chain(at.iter().copied())
            .chain(rest)
            .collect();
        tape.eval_in(&Nodes(&g), &inputs)
    };
    let moved = |factor: Expr<'_>, k: &[Node]| -> Vec<Node> {
        let ends = x.iter().zip(k);
        ends.map(|(&x, &k)| (x + g.expr(factor.node()) * g.expr(k)).node())
            .collect()
    };
    let half = h * 0.5;
    let start: Vec<Node> = x.iter().map(|x| x.node()).collect();
    let k1 = slope(t, &start);
    let k2 = slope(t + half, &moved(half, &k1));
    let k3 = slope(t + half, &moved(half, &k2));
    let k4 = slope(t + h, &moved(h, &k3));
    let next: Vec<Node> = (0..x.len())
        .map(|i| {
            let [k1, k2, k3, k4] = [&k1, &k2, &k3, &k4].map(|k| g.expr(k[i]));
            (x[i] + h / 6.0 * (k1 + 2.0 * (k2 + k3) + k4)).node()
        })
        .collect();
    let inputs: Vec<Node> = symbols.iter().chain([&h]).map(|e| e.node()).collect();
    Tape::new(&g, &inputs, &next).ok()
}

/// Machine code in use, or how often it would have been.
#[derive(Clone, Debug)]
enum Engine {
    Waiting(u32),
    Running(lynkeus_native::Evaluator<1>),
}

impl Default for Engine {
    fn default() -> Self {
        Self::Waiting(0)
    }
}

impl Engine {
    /// The machine code, made when its time has come.
    fn ready<'f>(
        &mut self,
        make: impl FnOnce() -> Option<&'f Function<1>>,
    ) -> Option<&mut lynkeus_native::Evaluator<1>> {
        if let Self::Waiting(count) = self {
            if Backend::patience(PATIENCE).is_none_or(|patience| *count < patience) {
                *count = count.saturating_add(1);
                return None;
            }
            // what cannot be compiled is not tried again: the routine remembers
            *self = Self::Running(make()?.evaluator());
        }
        match self {
            Self::Running(evaluator) => Some(evaluator),
            Self::Waiting(_) => None,
        }
    }
}

/// Runs one [`Routine`] again and again, without allocating.
#[derive(Clone, Debug)]
pub(crate) struct Runner {
    routine: Arc<Routine>,
    interpreter: lynkeus_expr::Evaluator,
    native: Engine,
    step: Engine,
    /// of the derivatives, once they were asked for
    slopes: Option<Box<Runner>>,
}

impl Runner {
    /// What is run.
    pub fn tape(&self) -> &Tape {
        self.routine.tape()
    }

    /// Writes the outputs at `inputs`.
    #[inline]
    pub fn eval(&mut self, inputs: &[f64], outputs: &mut [f64]) {
        match self.native.ready(|| self.routine.native()) {
            Some(native) => native.eval(inputs.as_chunks().0, outputs.as_chunks_mut().0),
            None => self.interpreter.eval(inputs, outputs),
        }
    }

    /// Writes the derivatives of the outputs by the states at `inputs`, where they are known.
    pub fn slopes(&mut self, inputs: &[f64], states: usize, slopes: &mut Slopes) -> bool {
        let Some(known) = self.routine.slopes(states) else {
            return false;
        };
        let runner = self
            .slopes
            .get_or_insert_with(|| Box::new(known.routine.runner()));
        runner.eval(inputs, slopes.at(&known.places));
        true
    }

    /// For a routine (t, x, w) → dx: one step of length `h` of the classical Runge–Kutta method
    /// from `inputs` to `next`. False where that is not done at once. The inputs are as before.
    pub fn step(&mut self, inputs: &mut Vec<f64>, h: f64, next: &mut [f64]) -> bool {
        let Some(step) = self.step.ready(|| self.routine.step()) else {
            return false;
        };
        // in its place: a copy read at once waits for what was just written, 20 ns
        inputs.push(h);
        step.eval(inputs.as_chunks().0, next.as_chunks_mut().0);
        inputs.pop();
        true
    }
}

/// Derivatives that are written down without asking whether they pay.
const FEW: usize = 50_000;

/// More than these are written down where differences would take so many times as many operations.
const SAVED: usize = 20;

/// The derivatives of a routine by its states.
#[derive(Debug)]
pub(crate) struct Differentiated {
    pub places: Arc<[Place]>,
    /// of the same inputs, the values at the places
    pub routine: Arc<Routine>,
}

impl Differentiated {
    /// Of a tape whose inputs are time, so many states, and what is constant. None where the
    /// derivatives written down would be too many for what they save.
    pub fn new(tape: &Tape, states: usize) -> Option<Self> {
        let g = Graph::new();
        let inputs: Vec<Node> = (0..tape.inputs()).map(|_| g.fresh("w").node()).collect();
        let outputs = tape.eval_in(&Nodes(&g), &inputs);
        let x = &inputs[1..=states];
        let most = FEW.max(tape.len().saturating_mul(states) / SAVED);
        jacobian::size(&g, &outputs, x, most)?;
        let entries = jacobian::forward(&g, &outputs, x).entries;
        let nodes: Vec<Node> = entries.iter().map(|&(.., node)| node).collect();
        let places = entries
            .iter()
            .map(|&(row, column, _)| Place { row, column });
        Some(Self {
            places: places.collect(),
            routine: Routine::new(Tape::new(&g, &inputs, &nodes).ok()?),
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A state that all others read is one column; a dense right-hand side of many operations is
    /// left to differences.
    #[test]
    fn derivatives_are_not_written_down_at_any_price() {
        let tape = |n: usize, dense: bool| {
            let g = Graph::new();
            let t = g.symbol("t").node();
            let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
            let sum = x.iter().copied().reduce(|a, b| a + b.sin()).unwrap();
            let read = if dense { sum } else { x[0] };
            let dx: Vec<Node> = (0..n)
                .map(|i| (x[i] * read + i as f64).exp().node())
                .collect();
            let inputs: Vec<Node> = [t].into_iter().chain(x.iter().map(|x| x.node())).collect();
            Tape::new(&g, &inputs, &dx).unwrap()
        };
        let sparse = Differentiated::new(&tape(400, false), 400).unwrap();
        assert_eq!(sparse.places.len(), 799);
        assert!(Differentiated::new(&tape(400, true), 400).is_none());
        assert!(Differentiated::new(&tape(40, true), 40).is_some());
    }
}
