//! What the engine finds, in sentences. The engine's crates return data: statements, reasons, notes;
//! here each gets its words, and advice that names keys of a study. One file per crate or family.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod block_triangular;
mod chains;
mod conditions;
mod drift_observable;
mod guarantee;
mod numbers;
mod observability;
mod parameters;
mod state_affine;
mod structure;
mod triangular;
mod unknown_input;

pub use numbers::{counted, figures, short};

/// What has words.
pub trait Words {
    /// As people read it, without a full stop.
    fn words(&self) -> String;
}

/// `(x1, x2) → (x3)`: lists of names that lead from one to the next.
fn arrows(lists: &[Vec<String>]) -> String {
    let each: Vec<String> = lists
        .iter()
        .map(|names| format!("({})", names.join(", ")))
        .collect();
    each.join(" → ")
}

/// To declare the ends of these, or else something else.
fn declare(names: &[String], otherwise: &str) -> String {
    match names.is_empty() {
        true => otherwise.to_owned(),
        false => format!("declare min and max of {}", names.join(", ")),
    }
}
