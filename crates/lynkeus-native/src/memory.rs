//! Code that may run.

use memmap2::{Mmap, MmapMut};

/// The shape of every function that is compiled: inputs, outputs, frame, shared inputs, number
/// of groups.
type Entry = unsafe extern "sysv64" fn(*const f64, *mut f64, *mut f64, *const f64, usize);

/// The machine code in memory of its own, which nobody can write to any more; none where the system
/// does not let programs make code.
pub(crate) fn executable(bytes: &[u8]) -> Option<Mmap> {
    let mut memory = MmapMut::map_anon(bytes.len()).ok()?;
    memory.copy_from_slice(bytes);
    memory.make_exec().ok()
}

/// Runs the code on so many groups, at least one; `shared` are the inputs that all of them have
/// in common.
///
/// # Safety
/// The code must be what `emit` wrote for a program whose inputs, outputs and frame fit into
/// these places, group by group.
pub(crate) unsafe fn run<const LANES: usize>(
    code: &Mmap,
    inputs: *const [f64; LANES],
    outputs: *mut [f64; LANES],
    frame: &mut [[f64; LANES]],
    shared: &[[f64; LANES]],
    groups: usize,
) {
    // SAFETY: the memory holds a whole function with this signature, by the caller's promise
    let entry = unsafe { std::mem::transmute::<*const u8, Entry>(code.as_ptr()) };
    // SAFETY: the places are large enough, by the caller's promise
    unsafe {
        entry(
            inputs.cast(),
            outputs.cast(),
            frame.as_mut_ptr().cast(),
            shared.as_ptr().cast(),
            groups,
        );
    }
}
