//! Whether the user asked to stop: one flag for the whole process.
//!
//! The command raises it when a signal arrives (Ctrl-C, TERM, HUP); a program that uses the
//! library may raise it as well. Long computations look at it now and then and end with what they
//! have. Floors below this crate take the flag as an argument.

use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock};

static FLAG: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// The flag itself, to hand on or to raise.
pub fn flag() -> Arc<AtomicBool> {
    Arc::clone(&FLAG)
}

/// True once the user asked to stop.
pub fn interrupted() -> bool {
    FLAG.load(Ordering::Relaxed)
}
