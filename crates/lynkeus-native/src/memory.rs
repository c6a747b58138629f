//! Code that may run.

use memmap2::{Mmap, MmapMut};

/// The shape of every function that is compiled: inputs, outputs, frame, shared inputs, number
/// of groups.
type Entry = unsafe extern "sysv64" fn(*const f64, *mut f64, *mut f64, *const f64, usize);

/// What code works on.
pub(crate) struct Places {
    pub inputs: *const f64,
    pub outputs: *mut f64,
    pub frame: *mut f64,
    /// the inputs that all groups have in common
    pub shared: *const f64,
    /// number of groups, at least 1
    pub groups: usize,
}

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
    /// what the pointers point at, group by group.
    pub unsafe fn run(&self, places: Places) {
        // SAFETY: the memory holds a whole function with this signature, by the caller's promise
        let entry = unsafe { std::mem::transmute::<*const u8, Entry>(self.code.as_ptr()) };
        // SAFETY: what the pointers point at is large enough, by the caller's promise
        unsafe {
            entry(
                places.inputs,
                places.outputs,
                places.frame,
                places.shared,
                places.groups,
            );
        }
    }
}
