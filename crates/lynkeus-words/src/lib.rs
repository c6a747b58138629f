//! What the engine finds, in sentences. The engine's crates return data: statements, reasons, notes;
//! here each gets its words, and advice that names keys of a study. One file per crate or family.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod conditions;
mod numbers;
mod observability;
mod structure;

pub use numbers::{counted, figures, short};

/// What has words.
pub trait Words {
    /// As people read it, without a full stop.
    fn words(&self) -> String;
}
