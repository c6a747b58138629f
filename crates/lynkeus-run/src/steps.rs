//! Steps of the classical Runge–Kutta method one after the other, as code: what follows from time alone is computed first, for some
//! steps at once, then each step from the one before.

use std::ops::Range;
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

/// Functions of some inputs in two parts.
#[derive(Clone, Debug)]
pub(crate) struct Halves {
    /// the inputs that are nobody's own → the values that the rest reads
    pub common: Tape,
    /// inputs before these values, these values, inputs behind them → the outputs
    pub own: Tape,
    /// number of these values
    pub shared: usize,
    /// inputs before, the common ones, these values, inputs behind → these values for the common inputs, then the outputs
    pub both: Tape,
    pub direct: Tape,
}

/// How inputs stand in the two parts.
pub(crate) struct Layout<'a> {
    /// of the first part
    pub common: Vec<Node>,
    /// of the second one before and behind what the first one gives
    pub before: &'a [Node],
    pub behind: &'a [Node],
}

impl Halves {
    /// Takes out of the outputs all that follows from the common inputs. With `is_fused` both parts round products
    /// and sums once.
    ///
    /// # Errors
    /// None with outputs that read the inputs alone.
    pub fn new(
        g: &Graph,
        outputs: &[Node],
        layout: &Layout<'_>,
        is_fused: bool,
    ) -> Result<Self, MissingInput> {
        let divided = g.hoisted(outputs, &layout.common);
        let own = [layout.before, &divided.symbols, layout.behind].concat();
        let tape = match is_fused {
            true => Tape::fused,
            false => Tape::new,
        };
        let both = [layout.before, &layout.common, &divided.symbols, layout.behind].concat();
        let results = [&divided.values[..], &divided.roots].concat();
        let direct = [layout.before, &layout.common, layout.behind].concat();
        Ok(Self {
            both: tape(g, &both, &results)?,
            direct: tape(g, &direct, outputs)?,
            common: tape(g, &layout.common, &divided.values)?,
            own: tape(g, &own, &divided.roots)?,
            shared: divided.values.len(),
        })
    }
}

/// Most steps for which what follows from time is computed ahead.
const AHEAD: usize = 16;

/// Bytes that a block of steps may take: it should stay in the first cache.
const CACHE: usize = 16 * 1024;

/// Steps of x' = f(t, x, w) under way, w constant.
#[derive(Clone, Debug)]
pub(crate) struct Steps {
    code: Code,
    /// number of values that follow from time, and of states
    shared: usize,
    states: usize,
    /// the places of signals and of modes among the inputs of f
    signals: Range<usize>,
    modes: Range<usize>,
    /// of each step what follows from time and the states, and of one more step
    blocks: Buffer<1>,
    /// time and length of each step
    times: Vec<[f64; 1]>,
}

#[derive(Clone, Debug)]
enum Code {
    Native {
        common: Function<1>,
        own: Function<1>,
    },
    Woven {
        common: Function<1>,
        both: Function<1>,
    },
    Direct {
        step: Function<1>,
    },
    Interpreted {
        common: Box<Evaluator>,
        own: Box<Evaluator>,
        inputs: Vec<f64>,
    },
}

/// The places of what f(t, x, w, modes) reads.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sizes {
    pub states: usize,
    pub signals: usize,
    pub inputs: usize,
}

impl Sizes {
    pub fn states(self) -> Range<usize> {
        1..1 + self.states
    }

    pub fn signals(self) -> Range<usize> {
        let first = 1 + self.states;
        first..first + self.signals
    }

    pub fn modes(self) -> Range<usize> {
        1 + self.states + self.signals..self.inputs
    }
}

impl Steps {
    /// The two parts of a step in a graph, a function of the `inputs` of f and of its length, the last input.
    ///
    /// # Errors
    /// None with a step that reads its inputs alone.
    pub fn halves(
        g: &Graph,
        inputs: &[Node],
        next: &[Node],
        sizes: Sizes,
        is_fused: bool,
    ) -> Result<Halves, MissingInput> {
        let ends = [inputs[0], inputs[sizes.inputs]];
        let layout = Layout {
            common: [&inputs[sizes.modes()], &ends].concat(),
            before: &inputs[sizes.signals()],
            behind: &inputs[sizes.states()],
        };
        Halves::new(g, next, &layout, is_fused)
    }

    /// As machine code, where it can be made.
    pub fn compiled(halves: &Halves, sizes: Sizes) -> Option<Self> {
        let how = std::env::var("LYNKEUS_STEPS").unwrap_or_default();
        if how == "3" {
            let spacing = 2 + halves.shared + sizes.states;
            let shared = sizes.modes().len() + sizes.signals;
            let code = Code::Woven {
                common: Function::sweeping(&halves.common, sizes.modes().len(), spacing)?,
                both: Function::stepping(&halves.both, shared)?,
            };
            return Some(Self::new(code, halves, sizes));
        }
        if how == "1" {
            let shared = sizes.modes().len() + sizes.signals;
            let code = Code::Direct {
                step: Function::stepping(&halves.direct, shared)?,
            };
            return Some(Self::new(code, halves, sizes));
        }
        let spacing = halves.shared + sizes.states;
        let code = Code::Native {
            common: Function::sweeping(&halves.common, sizes.modes().len(), spacing)?,
            own: Function::stepping(&halves.own, sizes.signals)?,
        };
        Some(Self::new(code, halves, sizes))
    }

    pub fn interpreted(halves: &Halves, sizes: Sizes) -> Self {
        let code = Code::Interpreted {
            common: Box::new(halves.common.evaluator()),
            own: Box::new(halves.own.evaluator()),
            inputs: vec![],
        };
        Self::new(code, halves, sizes)
    }

    fn new(code: Code, halves: &Halves, sizes: Sizes) -> Self {
        let shared = match code {
            Code::Direct { .. } => 2,
            Code::Woven { .. } => halves.shared + 2,
            _ => halves.shared,
        };
        let block = shared + sizes.states;
        let ahead = (CACHE / (8 * block.max(1))).clamp(1, AHEAD);
        Self {
            code,
            shared,
            states: sizes.states,
            signals: sizes.signals(),
            modes: sizes.modes(),
            blocks: Buffer::new((ahead + 1) * block),
            times: Vec::with_capacity(2 * ahead),
        }
    }

    /// Takes `x` over steps, the time and the length of each, to `next`; of the `inputs` of f its signals and modes
    /// count.
    pub fn advance(&mut self, inputs: &[f64], steps: &[[f64; 2]], x: &[f64], next: &mut [f64]) {
        let size = self.shared + self.states;
        let ahead = self.blocks.values().len() / size.max(1) - 1;
        next.copy_from_slice(x);
        for steps in steps.chunks(ahead.max(1)) {
            let start = &mut self.blocks.values_mut()[self.shared..size];
            start.copy_from_slice(next.as_chunks().0);
            self.times.clear();
            self.times.extend(steps.as_flattened().iter().map(|&time| [time]));
            self.run(inputs, steps.len());
            let end = &self.blocks.values()[steps.len() * size + self.shared..][..self.states];
            next.copy_from_slice(end.as_flattened());
        }
    }

    fn run(&mut self, inputs: &[f64], count: usize) {
        let [signals, modes] = [&self.signals, &self.modes].map(|places| &inputs[places.clone()]);
        let blocks = self.blocks.values_mut();
        match &mut self.code {
            Code::Native { common, own } => {
                if self.shared > 0 {
                    common.sweep(count, modes.as_chunks().0, &self.times, blocks);
                }
                own.steps(count, signals.as_chunks().0, blocks);
            }
            Code::Direct { step } => {
                let size = self.shared + self.states;
                for (block, times) in blocks.chunks_exact_mut(size).zip(self.times.chunks(2)) {
                    block[..2].copy_from_slice(times);
                }
                let first = signals.as_ptr();
                let all = unsafe { std::slice::from_raw_parts(first, signals.len() + modes.len()) };
                step.steps(count, all.as_chunks().0, blocks);
            }
            Code::Woven { common, both } => {
                let size = self.shared + self.states;
                let first = signals.as_ptr();
                let all = unsafe { std::slice::from_raw_parts(first, signals.len() + modes.len()) };
                common.sweep(1, modes.as_chunks().0, &self.times[..2], &mut blocks[2..]);
                let last = &self.times[self.times.len() - 2..];
                for (block, times) in blocks.chunks_exact_mut(size).zip(self.times[2..].chunks(2).chain([last])) {
                    block[..2].copy_from_slice(times);
                }
                both.steps(count, all.as_chunks().0, blocks);
            }
            Code::Interpreted {
                common,
                own,
                inputs,
            } => {
                let size = self.shared + self.states;
                let blocks = blocks.as_flattened_mut();
                for (step, times) in self.times.as_flattened().chunks(2).enumerate() {
                    let (block, after) = blocks[step * size..].split_at_mut(size);
                    inputs.clear();
                    inputs.extend(modes.iter().chain(times));
                    common.eval(inputs, &mut block[..self.shared]);
                    inputs.clear();
                    inputs.extend(signals.iter().chain(&*block));
                    own.eval(inputs, &mut after[self.shared..size]);
                }
            }
        }
    }
}
