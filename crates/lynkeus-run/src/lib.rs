//! Simulation and log replay of systems and their observers.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod dynamics;
mod error;
mod method;
mod rk4;
mod spectral;
mod switches;
mod system;
mod trajectory;
mod transplant;

pub use dynamics::{Dynamics, Function};
pub use error::{Error, Interrupted};
pub use method::{Method, Step, Tolerances};
pub use rk4::Rk4;
pub use spectral::spectral_radius;
pub use system::{Evaluation, System};
pub use trajectory::Trajectory;
