//! Observer families, one folder each.
//!
//! A [`Family`] takes the plant as an observer sees it
//! ([`AugmentedPlant`](lynkeus_structure::AugmentedPlant)) and a [`Tuning`], and returns a
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
mod design;
pub mod drift_observable;
mod estimate;
mod field;
mod generator;
pub mod guarantee;
pub mod kalman;
mod observer;
mod paper;
mod peaking;
mod printed;
mod sparse;
pub mod state_affine;
mod statement;
mod theorem;
pub mod triangular;
mod tuning;
pub mod unknown_input;

pub use block_triangular::Lee;
pub use certificate::{Assumptions, Bounds, Certificate, Constant, ReadingError, UltimateBound};
pub use design::{
    ChainGain, Design, DesignError, Examination, Family, ParameterValue, Shown, fit_word,
};
pub use estimate::starts;
pub use generator::{Generator, GeneratorError};
pub use guarantee::{Claim, Correction, Inequality, Injection, certify, is_certified_gain};
pub use lynkeus_gain::integrators::Pole;
pub use observer::{
    Estimate, FilterTuning, InputDerivative, Monitor, Observer, Sampled, Signal, Tunable,
};
pub use statement::{Check, Reason, Statement};
pub use triangular::Hammouri;
pub use tuning::{Initial, KeySpec, REQUIRED, Shape, Tuning, TuningError, Value};

pub use drift_observable::Germani;
pub use state_affine::Ltaief;
pub use unknown_input::Farza;

use block_triangular::BLOCK_TRIANGULAR;
use drift_observable::DRIFT_OBSERVABLE;
use kalman::{EKF, MHE, PARTICLE, UKF};
use state_affine::STATE_AFFINE;
use triangular::TRIANGULAR;
use unknown_input::UNKNOWN_INPUT;

/// Every family, in the order in which `auto` tries them.
pub const FAMILIES: &[&dyn Family] = &[
    TRIANGULAR,
    BLOCK_TRIANGULAR,
    STATE_AFFINE,
    UNKNOWN_INPUT,
    DRIFT_OBSERVABLE,
    EKF,
    UKF,
    MHE,
    PARTICLE,
];

/// The family of that name.
pub fn find(name: &str) -> Option<&'static dyn Family> {
    FAMILIES
        .iter()
        .copied()
        .find(|family| family.name() == name)
}
