//! A compiled tape, and what evaluates it.

use std::sync::Arc;

use lynkeus_expr::Tape;

use crate::record::Program;

#[cfg(target_arch = "x86_64")]
use crate::memory::Executable;

/// Most instructions of a tape that is compiled.
const LARGEST: usize = 1_000_000;

/// Most bytes of inputs, of outputs and of a frame: addresses are offsets of 31 bits, and every
/// evaluator has a frame of its own.
const LARGEST_PLACE: usize = 1 << 28;

/// A tape as machine code. A clone shares the code.
#[derive(Clone, Debug)]
pub struct Function<const LANES: usize> {
    compiled: Arc<Compiled>,
}

#[derive(Debug)]
struct Compiled {
    inputs: usize,
    outputs: usize,
    constants: Vec<f64>,
    /// length of the frame, in values
    frame: usize,
    #[cfg(target_arch = "x86_64")]
    code: Executable,
}

impl<const LANES: usize> Function<LANES> {
    /// Compiles a tape, for 1 lane or 4. None on machines that are not compiled for (other than
    /// x86-64 with AVX2), where the system does not let programs make code, for tapes with
    /// operations that are not compiled, and for other numbers of lanes.
    pub fn compile(tape: &Tape) -> Option<Self> {
        if !(LANES == 1 || LANES == 4) || tape.len() > LARGEST || !is_supported() {
            return None;
        }
        let compiled = Compiled::new::<LANES>(&Program::record(tape)?)?;
        Some(Self {
            compiled: Arc::new(compiled),
        })
    }

    /// An evaluator with its own working memory.
    pub fn evaluator(&self) -> Evaluator<LANES> {
        let compiled = &self.compiled;
        let mut frame = vec![[0.0; LANES]; compiled.frame + 1];
        for (place, &constant) in frame.iter_mut().zip(&compiled.constants) {
            *place = [constant; LANES];
        }
        Evaluator {
            compiled: compiled.clone(),
            frame,
        }
    }
}

#[cfg(target_arch = "x86_64")]
fn is_supported() -> bool {
    std::arch::is_x86_feature_detected!("avx2")
}

#[cfg(not(target_arch = "x86_64"))]
fn is_supported() -> bool {
    false
}

impl Compiled {
    #[cfg(target_arch = "x86_64")]
    fn new<const LANES: usize>(program: &Program) -> Option<Self> {
        let emitted = crate::emit::emit::<LANES>(program);
        let places = [program.inputs, program.outputs.len(), emitted.frame + 1];
        if places
            .iter()
            .any(|count| *count > LARGEST_PLACE / (8 * LANES))
        {
            return None;
        }
        Some(Self {
            inputs: program.inputs,
            outputs: program.outputs.len(),
            code: Executable::new(&emitted.code)?,
            constants: emitted.constants,
            frame: emitted.frame,
        })
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn new<const LANES: usize>(_: &Program) -> Option<Self> {
        None
    }
}

/// Evaluates a [`Function`] again and again, without allocating.
#[derive(Clone, Debug)]
pub struct Evaluator<const LANES: usize> {
    compiled: Arc<Compiled>,
    /// constants, then what registers do not hold; one place more than is used, since logic
    /// reads beyond a single number
    frame: Vec<[f64; LANES]>,
}

impl<const LANES: usize> Evaluator<LANES> {
    /// Writes the outputs at `inputs`.
    ///
    /// # Panics
    /// If the slices have not the tape's numbers of inputs and outputs.
    pub fn eval(&mut self, inputs: &[[f64; LANES]], outputs: &mut [[f64; LANES]]) {
        let compiled = &*self.compiled;
        assert_eq!(inputs.len(), compiled.inputs, "one value per input");
        assert_eq!(outputs.len(), compiled.outputs, "one place per output");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the code was emitted for these numbers of inputs, outputs and places of the
        // frame, of LANES numbers each, and the lengths were compared
        unsafe {
            compiled.code.run(
                inputs.as_ptr().cast(),
                outputs.as_mut_ptr().cast(),
                self.frame.as_mut_ptr().cast(),
            );
        }
    }
}
