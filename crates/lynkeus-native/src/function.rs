//! A compiled tape, and what evaluates it.

use std::sync::Arc;

use lynkeus_expr::Tape;
#[cfg(target_arch = "x86_64")]
use memmap2::Mmap;

use crate::record::Program;

#[cfg(target_arch = "x86_64")]
use crate::emit::{calls, emit};
#[cfg(target_arch = "x86_64")]
use crate::memory;
#[cfg(target_arch = "x86_64")]
use crate::registers::registers;
#[cfg(target_arch = "x86_64")]
use crate::schedule::scheduled;

/// Most instructions of a tape that is compiled.
const LARGEST: usize = 1_000_000;

/// Most bytes of inputs, of outputs and of a frame: addresses are offsets of 31 bits, and every
/// clone has a frame of its own.
const LARGEST_PLACE: usize = 1 << 28;

/// A tape as machine code, for one group of lanes or for many one after the other, evaluated again and
/// again without allocating. A clone shares the code and has a working memory of its own.
#[derive(Clone, Debug)]
pub struct Function<const LANES: usize> {
    compiled: Arc<Compiled>,
    /// constants, then what registers do not hold; one place more than is used, since logic reads
    /// beyond a single number
    frame: Buffer<LANES>,
}

#[derive(Debug)]
struct Compiled {
    inputs: usize,
    outputs: usize,
    /// number of first inputs that groups have in common
    shared: usize,
    course: Course,
    #[cfg(target_arch = "x86_64")]
    code: Mmap,
}

/// How code goes on to the next group.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// not at all
    Alone,
    /// so many values from the outputs of one group to those of the next
    Groups(usize),
    /// outputs are the last inputs of the next group
    Steps,
}

impl<const LANES: usize> Function<LANES> {
    /// Compiles a tape, for 1 lane, 4 or 8. None on machines that are not compiled for (other than
    /// x86-64 with AVX2 and FMA; for 8 lanes also AVX-512 with F, DQ and VL), where the system does not let programs make code, for tapes with
    /// operations that are not compiled, and for other numbers of lanes.
    pub fn compile(tape: &Tape) -> Option<Self> {
        Self::of(tape, 0, Course::Alone)
    }

    /// Compiles a tape that goes over many groups of lanes: the first `shared` inputs are common to
    /// all groups, and from the outputs of one group to those of the next there are `spacing` values.
    /// None as of [`Function::compile`], and where the inputs or `spacing` are too few.
    pub fn sweeping(tape: &Tape, shared: usize, spacing: usize) -> Option<Self> {
        if shared > tape.inputs() || spacing < tape.outputs() {
            return None;
        }
        Self::of(tape, shared, Course::Groups(spacing))
    }

    /// Compiles a tape that takes some values from step to step: its last inputs are the outputs of the step before.
    /// The first `shared` inputs are common to all steps, those between are each step's own. None as of
    /// [`Function::compile`], and where there are more outputs than inputs that are not shared.
    pub fn stepping(tape: &Tape, shared: usize) -> Option<Self> {
        let own = tape.inputs().checked_sub(shared)?;
        (tape.outputs() <= own).then(|| Self::of(tape, shared, Course::Steps))?
    }

    /// As [`Function::compile`], for a processor without AVX-512: to compare.
    pub fn compile_for_avx2(tape: &Tape) -> Option<Self> {
        let is_compiled_for = matches!(LANES, 1 | 4) && is_supported();
        Self::made(tape, 0, Course::Alone, is_compiled_for, false)
    }

    fn of(tape: &Tape, shared: usize, course: Course) -> Option<Self> {
        let is_extended = LANES != 4 && is_extended();
        let is_compiled_for = match LANES {
            1 | 4 => is_supported(),
            8 => is_extended,
            _ => false,
        };
        Self::made(tape, shared, course, is_compiled_for, is_extended)
    }

    fn made(
        tape: &Tape,
        shared: usize,
        course: Course,
        is_compiled_for: bool,
        is_extended: bool,
    ) -> Option<Self> {
        if !is_compiled_for || tape.len() > LARGEST {
            return None;
        }
        Self::compiled(&Program::record(tape)?, shared, course, is_extended)
    }

    #[cfg(target_arch = "x86_64")]
    fn compiled(
        program: &Program,
        shared: usize,
        course: Course,
        is_extended: bool,
    ) -> Option<Self> {
        let spacing = match course {
            Course::Alone => None,
            Course::Groups(spacing) => Some(spacing),
            Course::Steps => Some(program.inputs - shared),
        };
        let registers = registers(is_extended);
        let program = &scheduled(program, registers, LANES == 1, calls::<LANES>);
        let emitter = emit::<LANES>(program, shared, spacing, is_extended);
        let outputs = spacing.unwrap_or(program.outputs.len());
        let places = [program.inputs, outputs, emitter.frame.len() + 1];
        let is_large = |&count: &usize| count > LARGEST_PLACE / (8 * LANES);
        if places.iter().any(is_large) {
            return None;
        }
        let mut frame = Buffer::new(emitter.frame.len() + 1);
        for (place, &value) in frame.values_mut().iter_mut().zip(&emitter.frame) {
            *place = [value; LANES];
        }
        let compiled = Arc::new(Compiled {
            inputs: program.inputs,
            outputs: program.outputs.len(),
            shared,
            course,
            code: memory::executable(&emitter.assembler.bytes)?,
        });
        Some(Self { compiled, frame })
    }

    #[cfg(not(target_arch = "x86_64"))]
    fn compiled(_: &Program, _: usize, _: Course, _: bool) -> Option<Self> {
        None
    }

    /// Writes the outputs at `inputs`.
    ///
    /// # Panics
    /// If the slices have not the tape's numbers of inputs and outputs.
    pub fn eval(&mut self, inputs: &[[f64; LANES]], outputs: &mut [[f64; LANES]]) {
        assert_eq!(inputs.len(), self.compiled.inputs, "one value per input");
        let places = self.compiled.outputs;
        assert_eq!(outputs.len(), places, "one place per output");
        self.sweep(1, &[], inputs, outputs);
    }

    /// For each of `groups` groups: writes the outputs at the shared inputs and its own ones, which
    /// stand one group after the other.
    ///
    /// # Panics
    /// If the slices are too short for so many groups, for more than one group of code that was
    /// compiled for one, and of code for steps.
    pub fn sweep(
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
        let spacing = match compiled.course {
            Course::Groups(spacing) => Some(spacing),
            Course::Alone if before == 0 => Some(0),
            Course::Alone | Course::Steps => None,
        };
        let spacing = spacing.expect("code for groups, or for one");
        assert_eq!(shared.len(), compiled.shared, "one value per shared input");
        assert!(inputs.len() >= groups * own, "inputs of every group");
        let needed = before * spacing + compiled.outputs;
        assert!(outputs.len() >= needed, "outputs of every group");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the code was emitted for these numbers of inputs, outputs and places of the
        // frame, of LANES numbers each, and there is room for so many groups, of which code
        // without spacing has one
        unsafe {
            let (inputs, outputs) = (inputs.as_ptr(), outputs.as_mut_ptr());
            let frame = self.frame.values_mut();
            memory::run(&compiled.code, inputs, outputs, frame, shared, groups);
        }
    }

    /// So many steps: `values` are the own inputs of each, one after the other, and of one more step, whose last ones
    /// are where the last step ends. Of every step but the first one the last inputs are written.
    ///
    /// # Panics
    /// If the slices are too short for so many steps, and of code that was not compiled for them.
    pub fn steps(&mut self, count: usize, shared: &[[f64; LANES]], values: &mut [[f64; LANES]]) {
        let compiled = &*self.compiled;
        let own = compiled.inputs - compiled.shared;
        if count == 0 {
            return;
        }
        assert_eq!(compiled.course, Course::Steps, "code for steps");
        assert_eq!(shared.len(), compiled.shared, "one value per shared input");
        assert!(values.len() >= (count + 1) * own, "inputs of every step");
        #[cfg(target_arch = "x86_64")]
        // SAFETY: the code was emitted for these numbers of inputs, outputs and places of the frame, of LANES numbers
        // each; a step reads its own inputs and writes to those of the next one, for which there is room
        unsafe {
            let first = values.as_mut_ptr();
            let outputs = first.add(2 * own - compiled.outputs);
            let frame = self.frame.values_mut();
            memory::run(&compiled.code, first, outputs, frame, shared, count);
        }
    }
}

/// The largest number of lanes that is compiled for here; 1 also where nothing is.
#[must_use]
pub fn widest() -> usize {
    match (is_supported(), is_extended()) {
        (true, true) => 8,
        (true, false) => 4,
        _ => 1,
    }
}

#[cfg(target_arch = "x86_64")]
fn is_supported() -> bool {
    std::arch::is_x86_feature_detected!("avx2") && std::arch::is_x86_feature_detected!("fma")
}

/// Whether there are eight lanes.
#[cfg(target_arch = "x86_64")]
fn is_extended() -> bool {
    is_supported()
        && std::arch::is_x86_feature_detected!("avx512f")
        && std::arch::is_x86_feature_detected!("avx512dq")
        && std::arch::is_x86_feature_detected!("avx512vl")
}

#[cfg(not(target_arch = "x86_64"))]
fn is_supported() -> bool {
    false
}

#[cfg(not(target_arch = "x86_64"))]
fn is_extended() -> bool {
    false
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
