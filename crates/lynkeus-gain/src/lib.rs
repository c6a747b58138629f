//! Small dense linear algebra of observer gains.
//!
//! ```
//! use lynkeus_gain::{Bounds, lemma1};
//!
//! // two partial derivatives known to lie in [0.5, 2]
//! let bounds = [Bounds { lower: 0.5, upper: 2.0 }; 2];
//! let found = lemma1::construct(&bounds)?;
//! assert!(found.η > 0.0);
//! assert_eq!(found.S.gain().len(), 3); // S⁻¹Cᵀ
//! # Ok::<(), lynkeus_gain::lemma1::Error>(())
//! ```
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod integrators;
pub mod lemma1;
pub mod low_power;
pub mod sampling;
mod symmetric;

pub use lynkeus_proof::Bounds;
pub use symmetric::{FactorError, Tridiagonal, UnitFactor};
