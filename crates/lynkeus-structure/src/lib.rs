//! What can be observed: chains found in the equations, and conditions decided
//! on the declared box.
//!
//! [`AugmentedPlant`] is the plant as an observer sees it: unknown inputs are states,
//! disturbances are zero. [`chains`] finds the triangular form of its equations,
//! [`sign`] decides whether a partial derivative keeps its sign on the box
//! — [`Verdict`]: proved, refuted with a witness, or undecided with the box
//! that is left.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod augmented;
pub mod blocks;
pub mod chains;
pub mod detectability;
mod exact;
mod jumps;
pub mod layers;
mod matrix;
mod misfit;
pub mod one_to_one;
pub mod output_map;
mod range;
pub mod rank;
mod region;
mod regularity;
pub mod sign;
pub mod slopes;
pub mod superdiagonal;
pub mod uniform;
mod verdict;
mod zero;

pub use augmented::{AugmentedPlant, Measurement, Sensors, SensorsError};
pub use blocks::Blocks;
pub use chains::{Assignment, Chain, ChainRequest};
pub use layers::Layers;
pub use matrix::Matrix;
pub use misfit::Misfit;
pub use one_to_one::OneToOne;
pub use range::{Magnitude, Range, enclosure_within, magnitude_within, range, range_within};
pub use region::{Coordinate, Dimension, Place, Point, Region};
pub use regularity::{has_value_at, regularity, steps};
pub use slopes::{Innovation, Slopes};
pub use superdiagonal::Superdiagonal;
pub use uniform::{Blind, Uniformity, apart_whatever, determined, uncertain, uniformity};
pub use verdict::{Finding, Reason, Shown, Standing, Verdict, Witness};
pub use zero::vanishes;
