//! Steps of the classical Runge–Kutta method one after the other, as one loop of machine code.

use std::sync::atomic::{AtomicBool, Ordering};

use lynkeus_expr::{Evaluator, Graph, MissingInput, Node, Tape};
use lynkeus_native::{Buffer, Function};

static IS_FUSED: AtomicBool = AtomicBool::new(false);

/// Whether steps of given lengths that are functions of their own round a product and a sum once, in what is made in
/// this process from now on: with the interpreter, in machine code and in lanes alike. Filters never do.
pub fn fuse_steps(is_fused: bool) {
    IS_FUSED.store(is_fused, Ordering::Relaxed);
}

/// As [`fuse_steps`] was called last.
pub(crate) fn is_fused() -> bool {
    IS_FUSED.load(Ordering::Relaxed)
}

/// A tape of a step, or of a part of one.
///
/// # Errors
/// As [`Tape::new`].
pub(crate) fn tape(
    graph: &Graph,
    inputs: &[Node],
    outputs: &[Node],
    is_fused: bool,
) -> Result<Tape, MissingInput> {
    match is_fused {
        true => Tape::fused(graph, inputs, outputs),
        false => Tape::new(graph, inputs, outputs),
    }
}

/// Most steps of one call.
const TOGETHER: usize = 64;

/// Bytes that they may take: they should stay in the first cache.
const CACHE: usize = 16 * 1024;

/// Steps of x' = f(t, x, w) under way, w constant.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    code: Code,
    states: usize,
    /// of each step its time, its length and the states, and of one more step
    blocks: Buffer<1>,
}

#[derive(Clone, Debug)]
enum Code {
    Native(Function<1>),
    Interpreted { step: Box<Evaluator>, all: Vec<f64> },
}

impl Steps {
    /// The tape of a step: it reads w, t, h and x. The `inputs` are t, x, w and h.
    ///
    /// # Errors
    /// None with a step that reads its inputs alone.
    pub fn tape(
        graph: &Graph,
        inputs: &[Node],
        next: &[Node],
        is_fused: bool,
    ) -> Result<Tape, MissingInput> {
        let (x, w) = inputs[1..inputs.len() - 1].split_at(next.len());
        let ends = [inputs[0], inputs[inputs.len() - 1]];
        tape(graph, &[w, &ends, x].concat(), next, is_fused)
    }

    /// As machine code, where it can be made.
    pub fn compiled(tape: &Tape) -> Option<Self> {
        let shared = tape.inputs() - tape.outputs() - 2;
        let step = Function::stepping(tape, shared)?;
        Some(Self::new(Code::Native(step), tape.outputs()))
    }

    pub fn interpreted(tape: &Tape) -> Self {
        let code = Code::Interpreted {
            step: Box::new(tape.evaluator()),
            all: vec![],
        };
        Self::new(code, tape.outputs())
    }

    fn new(code: Code, states: usize) -> Self {
        let size = 2 + states;
        let together = (CACHE / (8 * size)).clamp(1, TOGETHER);
        Self {
            code,
            states,
            blocks: Buffer::new((together + 1) * size),
        }
    }

    /// Takes `x` over steps, the time and the length of each, to `next`.
    pub fn advance(&mut self, w: &[f64], steps: &[[f64; 2]], x: &[f64], next: &mut [f64]) {
        let size = 2 + self.states;
        let together = self.blocks.values().len() / size - 1;
        for (k, steps) in steps.chunks(together).enumerate() {
            let blocks = self.blocks.values_mut().as_flattened_mut();
            blocks[2..size].copy_from_slice(if k == 0 { x } else { &*next });
            for (block, step) in blocks.chunks_exact_mut(size).zip(steps) {
                block[..2].copy_from_slice(step);
            }
            self.run(w, steps.len());
            let blocks = self.blocks.values().as_flattened();
            next.copy_from_slice(&blocks[steps.len() * size + 2..][..self.states]);
        }
    }

    fn run(&mut self, w: &[f64], count: usize) {
        let blocks = self.blocks.values_mut();
        match &mut self.code {
            Code::Native(step) => step.steps(count, w.as_chunks().0, blocks),
            Code::Interpreted { step, all } => {
                let size = 2 + self.states;
                let blocks = blocks.as_flattened_mut();
                for first in (0..count).map(|step| step * size) {
                    all.clear();
                    all.extend(w.iter().chain(&blocks[first..first + size]));
                    step.eval(all, &mut blocks[first + size + 2..][..self.states]);
                }
            }
        }
    }
}
