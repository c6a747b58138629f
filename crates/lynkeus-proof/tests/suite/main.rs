//! The crate from outside, in one binary.
#![allow(clippy::unwrap_used)]

mod decay;
mod falsify;
mod tube;
