//! A compiled tape, and what evaluates it.

use std::sync::Arc;

use lynkeus_expr::Tape;

use crate::record::Program;

#[cfg(target_arch = "x86_64")]
use crate::emit::emit;
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

/// A tape as machine code that goes over many groups of lanes: the first inputs are common to all
/// groups, and the outputs of the groups stand at a distance from each other. A clone shares the code.
#[derive(Clone, Debug)]
pub struct Sweep<const LANES: usize> {
    compiled: Arc<Compiled>,
}

#[derive(Debug)]
struct Compiled {
    inputs: usize,
    outputs: usize,
    /// number of inputs that groups have in common, of a [`Sweep`]
    shared: usize,
    /// from the outputs of one group to those of the next
    spacing: usize,
    constants: Vec<f64>,
    /// length of the frame, in values
    frame: usize,
    #[cfg(target_arch = "x86_64")]
    code: Executable,
}

impl<const LANES: usize> Function<LANES> {
    /// Compiles a tape, for 1 lane or 4. None on machines that are not compiled for (other than
    /// x86-64 with AVX2 and FMA), where the system does not let programs make code, for tapes with
    /// operations that are not compiled, and for other numbers of lanes.
    pub fn compile(tape: &Tape) -> Option<Self> {
        let program = recorded::<LANES>(tape)?;
        let compiled = Arc::new(Compiled::new::<LANES>(&program, 0, None)?);
        Some(Self { compiled })
    }

    /// An evaluator with its own working memory.
    pub fn evaluator(&self) -> Evaluator<LANES> {
        Evaluator {
            frame: self.compiled.frame(),
            compiled: self.compiled.clone(),
        }
    }
}

impl<const LANES: usize> Sweep<LANES> {
    /// Compiles a tape whose first `shared` inputs are common to all groups; from the outputs of one
    /// group to those of the next there are `spacing` values. None as of [`Function::compile`].
    pub fn compile(tape: &Tape, shared: usize, spacing: usize) -> Option<Self> {
        if shared > tape.inputs() || spacing < tape.outputs() {
            return None;
        }
        let program = recorded::<LANES>(tape)?;
        let compiled = Arc::new(Compiled::new::<LANES>(&program, shared, Some(spacing))?);
        Some(Self { compiled })
    }

    /// An evaluator with its own working memory.
    pub fn evaluator(&self) -> Sweeper<LANES> {
        Sweeper {
            frame: self.compiled.frame(),
            compiled: self.compiled.clone(),
        }
    }
}

fn recorded<const LANES: usize>(tape: &Tape) -> Option<Program> {
    let is_compiled_for = (LANES == 1 || LANES == 4) && is_supported();
    (is_compiled_for && tape.len() <= LARGEST).then(|| Program::record(tape))?
}

#[cfg(target_arch = "x86_64")]
fn is_supported() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

#[cfg(not(target_arch = "x86_64"))]
fn is_supported() -> bool {
    false
}

impl Compiled {
    #[cfg(target_arch = "x86_64")]
    fn new<const LANES: usize>(
        program: &Program,
        shared: usize,
        spacing: Option<usize>,
    ) -> Option<Self> {
        let emitted = emit::<LANES>(program, shared, spacing);
        let outputs = spacing.unwrap_or(program.outputs.len());
        let places = [program.inputs, outputs, emitted.frame + 1];
        if places
            .iter()
            .any(|count| *count > LARGEST_PLACE / (8 * LANES))
        {
            return None;
        }
        Some(Self {
            inputs: program.inputs,
            outputs: program.outputs.len(),
            shared,
            spacing: spacing.unwrap_or(program.outputs.len()),
            code: Executable::new(&emitted.code)?,
            constants: emitted.constants,
            frame: emitted.frame,
        })
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn new<const LANES: usize>(_: &Program, _: usize, _: Option<usize>) -> Option<Self> {
        None
    }

    /// Constants, then what registers do not hold; one place more than is used, since logic
    /// reads beyond a single number.
    fn frame<const LANES: usize>(&self) -> Buffer<LANES> {
        let mut frame = Buffer::new(self.frame + 1);
        for (place, &constant) in frame.values_mut().iter_mut().zip(&self.constants) {
            *place = [constant; LANES];
        }
        frame
    }
}

/// Evaluates a [`Function`] again and again, without allocating.
#[derive(Clone, Debug)]
pub struct Evaluator<const LANES: usize> {
    compiled: Arc<Compiled>,
    frame: Buffer<LANES>,
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
        // frame, of LANES numbers each, for one group and nothing shared, and the lengths were
        // compared
        unsafe {
            let frame = self.frame.values_mut();
            compiled.code.run(inputs, outputs, frame, &[], 1);
        }
    }
}

/// Evaluates a [`Sweep`] again and again, without allocating.
#[derive(Clone, Debug)]
pub struct Sweeper<const LANES: usize> {
    compiled: Arc<Compiled>,
    frame: Buffer<LANES>,
}

impl<const LANES: usize> Sweeper<LANES> {
    /// For each of `groups` groups: writes the outputs at the shared inputs and its own ones, which
    /// stand one group after the other.
    ///
    /// # Panics
    /// If the slices are too short for so many groups.
    pub fn eval(
        &mut self,
        groups: usize,
        shared: &[[f64; LANES]],
        inputs: &[[f64; LANES]],
        outputs: &mut [[f64; LANES]],
    ) {
        let compiled = &*self.compiled;
        let own = compiled.inputs - compiled.shared;
        let Some(before) = groups.checked_sub(1) else {
            return;
        };
        assert_eq!(shared.len(), compiled.shared, "one value per shared input");
        assert!(inputs.len() >= groups * own, "inputs of every group");
        let needed = before * compiled.spacing + compiled.outputs;
        assert!(outputs.len() >= needed, "outputs of every group");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the code was emitted for these numbers of inputs, outputs and places of the
        // frame, of LANES numbers each, and there is room for so many groups
        unsafe {
            let frame = self.frame.values_mut();
            compiled.code.run(inputs, outputs, frame, shared, groups);
        }
    }
}

/// Bytes of a cache line.
const LINE: usize = 64;

/// A run of values of `LANES` numbers that begins with a cache line, so that none of them lies
/// across two.
#[derive(Debug, Default)]
pub struct Buffer<const LANES: usize> {
    numbers: Vec<f64>,
    first: usize,
    len: usize,
}

impl<const LANES: usize> Buffer<LANES> {
    /// `len` values, all zero.
    #[must_use]
    pub fn new(len: usize) -> Self {
        let spare = LINE / size_of::<f64>();
        let numbers = vec![0.0; len * LANES + spare];
        let first = numbers.as_ptr().align_offset(LINE).min(spare);
        Self {
            numbers,
            first,
            len,
        }
    }

    /// The values.
    #[must_use]
    pub fn values(&self) -> &[[f64; LANES]] {
        let numbers = &self.numbers[self.first..];
        &numbers.as_chunks().0[..self.len]
    }

    /// The values, to write to.
    pub fn values_mut(&mut self) -> &mut [[f64; LANES]] {
        let numbers = &mut self.numbers[self.first..];
        &mut numbers.as_chunks_mut().0[..self.len]
    }
}

/// A copy begins with a cache line of its own.
impl<const LANES: usize> Clone for Buffer<LANES> {
    fn clone(&self) -> Self {
        let mut copy = Self::new(self.len);
        copy.values_mut().copy_from_slice(self.values());
        copy
    }
}
