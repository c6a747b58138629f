//! The crate from outside, in one binary.
#![allow(clippy::unwrap_used)]

mod balance;
mod delays;
mod examples;
mod flat_files;
mod hostile;
mod language;
mod linear_loops;
mod long_algorithms;
mod ode_model;
mod parameters;
mod refusals;
mod rumoca;
mod scopes;
mod soup;
mod support;
mod symbols;
mod tables;
mod written_out;
