//! A divided tape at work on many trajectories side by side.

use lynkeus_expr::lanes::Lanes;
use lynkeus_expr::{Evaluator, Tape};
use lynkeus_native::Function;

use super::split::Divided;
use super::{LANES, Lane};
use crate::routine::Backend;

/// Largest tape that is compiled for a batch.
const LARGEST: usize = 200_000;

/// A divided tape with its machine code, shared by all threads. Interpreter and machine code give
/// the same values to the bit.
#[derive(Debug)]
pub(crate) struct Code {
    tapes: Divided,
    common: Option<Function<LANES>>,
    own: Option<Function<LANES>>,
    /// from the outputs of one group of lanes to those of the next
    spacing: usize,
}

impl Code {
    pub fn new(tapes: Divided, spacing: usize) -> Self {
        let is_wanted = |tape: &Tape| Backend::compiles_at_once() && tape.len() <= LARGEST;
        let compiled = is_wanted(&tapes.common).then(|| Function::compile(&tapes.common));
        let shared = tapes.common.outputs();
        let sweep = is_wanted(&tapes.own).then(|| Function::sweeping(&tapes.own, shared, spacing));
        Self {
            common: compiled.flatten(),
            own: sweep.flatten(),
            tapes,
            spacing,
        }
    }

    /// Number of values that all trajectories share.
    pub fn shared(&self) -> usize {
        self.tapes.common.outputs()
    }

    /// Whether there is a function that lanes round in their own way.
    pub fn has_functions(&self) -> bool {
        self.tapes.has_functions
    }

    pub fn runner(&self) -> Runner {
        let engine = |tape: &Tape, compiled: &Option<Function<LANES>>| match compiled {
            Some(function) => Engine::Native(function.evaluator()),
            None => Engine::Interpreted(Box::new(tape.evaluator_in(Lanes))),
        };
        Runner {
            spacing: self.spacing,
            own_inputs: self.tapes.own.inputs() - self.shared(),
            outputs: self.tapes.own.outputs(),
            scratch: vec![[0.0; LANES]; self.tapes.own.inputs()],
            common: engine(&self.tapes.common, &self.common),
            own: engine(&self.tapes.own, &self.own),
        }
    }
}

/// Runs one [`Code`] again and again, without allocating.
#[derive(Debug)]
pub(crate) struct Runner {
    common: Engine,
    own: Engine,
    spacing: usize,
    own_inputs: usize,
    outputs: usize,
    scratch: Vec<Lane>,
}

#[derive(Debug)]
enum Engine {
    Native(lynkeus_native::Evaluator<LANES>),
    Interpreted(Box<Evaluator<Lanes<LANES>>>),
}

impl Runner {
    /// What all trajectories share at four instants: the lanes of `inputs`. Each instant has its
    /// place in `table`, of [`Code::shared`] values that have one number in all lanes.
    pub fn share(&mut self, inputs: &[Lane], table: &mut [Lane]) {
        let count = table.len() / LANES;
        let values = &mut self.scratch[..count];
        match &mut self.common {
            Engine::Native(native) => native.eval(inputs, values),
            Engine::Interpreted(tape) => tape.eval(inputs, values),
        }
        for (instant, places) in table.chunks_exact_mut(count.max(1)).enumerate() {
            for (place, value) in places.iter_mut().zip(values.iter()) {
                *place = [value[instant]; LANES];
            }
        }
    }

    /// The outputs of every group of lanes, from what is shared and what is its own.
    pub fn sweep(&mut self, groups: usize, shared: &[Lane], inputs: &[Lane], outputs: &mut [Lane]) {
        match &mut self.own {
            Engine::Native(native) => native.sweep(groups, shared, inputs, outputs),
            Engine::Interpreted(tape) => {
                let arguments = &mut self.scratch[..shared.len() + self.own_inputs];
                arguments[..shared.len()].copy_from_slice(shared);
                for group in 0..groups {
                    let own = &inputs[group * self.own_inputs..][..self.own_inputs];
                    arguments[shared.len()..].copy_from_slice(own);
                    let to = &mut outputs[group * self.spacing..][..self.outputs];
                    tape.eval(arguments, to);
                }
            }
        }
    }
}
