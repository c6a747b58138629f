//! The crate from outside, in one binary.
#![allow(clippy::unwrap_used)]

mod known_starts;
mod precision;
mod published;
mod verdicts;
