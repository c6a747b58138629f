//! The crate from outside, in one binary; but for its use of memory, which needs an allocator of its own.
#![allow(clippy::unwrap_used, clippy::print_stdout)]

mod batches;
mod common;
mod coverage;
mod fleet;
mod followed;
mod integration;
mod late;
mod likelihood;
mod linear_plants;
mod manifold;
mod particles;
mod replay;
mod second_opinion;
mod simulation;
mod snapshots;
mod state_events;
mod time_events;
mod whens;
