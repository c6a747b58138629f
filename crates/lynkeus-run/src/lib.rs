//! Simulation and log replay of systems and their observers.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod adaptive;
mod closed_loop;
mod divergence;
mod dynamics;
mod error;
mod estimate;
mod estimator;
mod integrator;
mod method;
mod noise;
mod rk4;
mod simulate;
mod spectral;
mod switches;
mod system;
mod trajectory;
mod transplant;

pub use dynamics::{Dynamics, Function};
pub use error::{Error, Interrupted};
pub use estimate::{Estimates, Log, estimate, estimate_watched};
pub use estimator::{BetweenSamples, Estimator, EstimatorSettings};
pub use integrator::{Integrator, StepAdvice};
pub use method::{Method, Step, Tolerances};
pub use noise::{Level, Noise};
pub use rk4::Rk4;
pub use simulate::Simulation;
pub use spectral::spectral_radius;
pub use system::{Evaluation, System};
pub use trajectory::Trajectory;
