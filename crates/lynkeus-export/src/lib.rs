//! Expression graphs as source text in other languages.
//!
//! `Code` is what a tape computes as a list of operations that any language has: each once,
//! arguments first, nothing that no output needs. A `Dialect` says how one language writes an
//! operation; `Body` is the list in its words, one assignment after the other. A frame around
//! bodies, a module with functions for example, is the language's own ([`python`], [`curly`]).
//!
//! An operation that a dialect lacks is refused by name ([`Refusal`]); nothing is approximated.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod code;
pub mod curly;
mod dialect;
mod names;
pub mod python;

pub(crate) use code::Code;
pub(crate) use dialect::{Binding, Body, Dialect, Form, Text};
pub(crate) use names::Names;

/// What cannot be printed, and what to do about it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum Refusal {
    /// The root of equations that have to be searched.
    #[error(
        "the algebraic loop for {} cannot be printed: expected equations that are solved for their \
         unknowns or linear in them; solve them in the model, or run what the tool itself runs",
        .unknowns.join(", ")
    )]
    Loop {
        /// what the unknowns are called
        unknowns: Vec<String>,
    },
    /// The condition of a linear system that would be spelled out at too great a length.
    #[error(
        "the condition of a linear system of {size} unknowns cannot be printed: expected {most} at most"
    )]
    LargeSystem {
        /// number of unknowns
        size: usize,
        /// what can be printed
        most: usize,
    },
    /// A window of samples, over which a problem of optimisation is solved.
    #[error(
        "a moving horizon solves a problem of optimisation at every sample, which is not exported: \
         take family = \"ekf\" or \"ukf\""
    )]
    Window,
    /// Random numbers at every sample.
    #[error(
        "a particle filter runs many copies of the plant on random numbers, which is not exported: \
         take family = \"ekf\" or \"ukf\""
    )]
    Particles,
    /// The estimate is put into bounds by a problem of optimisation.
    #[error(
        "`bounds = \"project\"` solves a problem of optimisation where the estimate leaves its range, \
         which is not exported: leave the key out"
    )]
    Projection,
    /// Between samples the next one is needed.
    #[error(
        "lines between samples look ahead by one: take between_samples = \"hold\" or \"predict\""
    )]
    LooksAhead,
    /// A method without fixed steps.
    #[error("expected fixed steps: method = \"rk4\" with `step` or `substeps` in [estimate]")]
    NoFixedStep,
    /// What jumps with time alone.
    #[error(
        "the model jumps with time, at instants that are searched for in every interval: give what \
         jumps as a known input"
    )]
    JumpsWithTime,
    /// A number that the filter refuses.
    #[error("{error}")]
    Setting {
        /// what was expected
        error: String,
    },
    /// A draft that is none: a defect of this crate.
    #[error(
        "internal error: line {line} of the draft: expected {expected}, found `{found}`; please report this"
    )]
    Draft {
        /// line of the draft, from 1 on
        line: usize,
        /// what should stand there
        expected: String,
        /// what does
        found: String,
    },
    /// An operation that the language has not.
    #[error("{language} has no way to write {operation}")]
    Lacks {
        /// the language
        language: &'static str,
        /// the operation
        operation: String,
    },
}
