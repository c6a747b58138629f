//! What certificates trust.
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod chain;
pub mod decay;
pub mod definite;
pub mod elimination;
pub mod hurwitz;
pub mod inverse;
pub mod lmi;
pub mod lyapunov;
pub mod magnitude;
pub mod matrix;
pub mod metzler;
pub mod riccati;
pub mod search;
mod vertices;

pub use vertices::{Bounds, varying, vertices};
