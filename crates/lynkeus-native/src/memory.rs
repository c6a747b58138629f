//! Code that may run.

use memmap2::{Mmap, MmapMut};

/// The shape of every function that is compiled: inputs, outputs, frame.
type Entry = unsafe extern "sysv64" fn(*const f64, *mut f64, *mut f64);

/// Machine code in memory of its own, which nobody can write to any more.
#[derive(Debug)]
pub(crate) struct Executable {
    code: Mmap,
}

impl Executable {
    /// None where the system does not let programs make code.
    pub fn new(bytes: &[u8]) -> Option<Self> {
        let mut memory = MmapMut::map_anon(bytes.len()).ok()?;
        memory.copy_from_slice(bytes);
        let code = memory.make_exec().ok()?;
        Some(Self { code })
    }

    /// Runs the code.
    ///
    /// # Safety
    /// The code must be what `emit` wrote for a program whose inputs, outputs and frame fit into
    /// what the pointers point at.
    pub unsafe fn run(&self, inputs: *const f64, outputs: *mut f64, frame: *mut f64) {
        // SAFETY: the memory holds a whole function with this signature, by the caller's promise
        let entry = unsafe { std::mem::transmute::<*const u8, Entry>(self.code.as_ptr()) };
        // SAFETY: what the pointers point at is large enough, by the caller's promise
        unsafe { entry(inputs, outputs, frame) }
    }
}
