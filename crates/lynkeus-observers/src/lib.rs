//! Observer families, one file each.
//!
//! A [`Family`] takes the plant as an observer sees it
//! ([`Extended`](lynkeus_structure::Extended)) and a [`Tuning`], and returns a
//! [`Design`] whose [`Observer`] is another system of expressions: its inputs are
//! time, the known inputs and the measured outputs, its states are the estimate
//! and whatever the gain needs. Simulation, log replay and export are written
//! once, for such systems.
//!
//! A new family is one folder beside [`triangular`] with its stages (settings, form, design,
//! theorem) and one line in [`FAMILIES`].
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod block_triangular;
mod certificate;
mod conditions;
mod correction;
pub mod drift_observable;
mod enclosure;
mod estimate;
mod family;
mod generator;
mod guarantee;
pub mod kalman;
mod keys;
mod matrices;
mod observer;
mod peaking;
mod prolongation;
mod proof;
mod sampled;
mod stability;
mod stages;
pub mod state_affine;
mod statement;
pub mod triangular;
mod tunable;
mod tuning;
pub mod unknown_input;

pub use certificate::{Assumptions, Bounds, Certificate, Constant, UltimateBound};
pub use family::{ChainGain, Design, DesignError, Examination, FAMILIES, Family, find, fit_word};
pub use generator::{Generator, GeneratorError, Prefilter};
pub use guarantee::{Claim, Correction, Injection, certify};
pub use keys::{KeySpec, REQUIRED, Shape};
pub use lynkeus_gain::vandermonde::Pole;
pub use observer::{Estimate, FilterTuning, InputDerivative, Monitor, Observer, Signal};
pub use sampled::Sampled;
pub use statement::{Check, Farza, Germani, Hammouri, Inequality, Lee, Ltaief, Statement, Weight};
pub use tunable::{Tunable, Tunables};
pub use tuning::{Initial, Tuning, TuningError, Value};
