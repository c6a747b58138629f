//! Every family against hand-computed observers and the formulas of its paper.
#![allow(clippy::unwrap_used)]

mod block_triangular;
mod chains;
mod common;
mod drift_observable;
mod guarantee;
mod names;
mod peaking;
mod state_affine;
mod theorem_block_triangular;
mod theorem_state_affine;
mod theorem_triangular;
mod triangular;
mod unknown_input;
