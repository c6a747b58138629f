//! Simulation and log replay of systems and their observers.
//!
//! A [`System`] is x' = f(t, x, w) with outputs, compiled from expressions; a
//! plant, an observer and the inputs of a study are all systems. A
//! [`Simulation`] runs a plant, and an observer with it; an [`Estimator`] takes samples one by
//! one, live or from a log, of any kind of observer.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_run::{Estimator, EstimatorSettings, Role, Simulation, System};
//!
//! let g = Graph::new();
//! let [time, x, u, y, x̂] = ["time", "x", "u", "y", "x_hat"].map(|name| g.symbol(name));
//! let named = |name: &str, e: lynkeus_expr::Expr<'_>| (name.to_string(), e.node());
//!
//! // a tank: x' = u − √x, y = x; the valve u opens at t = 2
//! let level = [("x".to_string(), x.node(), 1.0)];
//! let dx = u - x.sqrt();
//! let tank = System::new(&g, time.node(), &level, &[named("u", u)], &[dx.node()], &[named("y", x)])?;
//! let valve = time.less(g.constant(2.0)).select(g.constant(0.5), g.constant(1.5));
//! let inputs = System::new(&g, time.node(), &[], &[], &[], &[named("u", valve)])?;
//!
//! // its observer: x̂' = u − √|x̂| + 5(y − x̂)
//! let estimate_of_level = [("x_hat".to_string(), x̂.node(), 3.0)];
//! let dx̂ = u - x̂.abs().sqrt() + (y - x̂) * 5.0;
//! let signals = [named("u", u), named("y", y)];
//! let observer = System::new(&g, time.node(), &estimate_of_level, &signals, &[dx̂.node()], &[])?;
//!
//! let mut simulation = Simulation::new(tank, inputs, 4.0, 0.05);
//! simulation.observer = Some(observer.clone());
//! simulation.record_outputs = true;
//! let table = simulation.run()?;
//! let (_, last) = table.row(table.len() - 1).unwrap();
//! let roles = [Role::State, Role::Input, Role::Output, Role::Measured, Role::Estimate];
//! let names: Vec<&str> = roles.iter().flat_map(|role| table.names(*role)).collect();
//! assert_eq!(names, ["x", "u", "y", "y", "x_hat"]);
//! assert!((last[0] - last[4]).abs() < 1e-6);
//!
//! // the same observer on what was recorded
//! let mut estimator = Estimator::new(&observer, EstimatorSettings::default())?;
//! for (time, row) in table.rows() {
//!     estimator.push(time, &[row[1], row[3]])?;
//! }
//! assert!((estimator.estimate()[0] - last[0]).abs() < 0.02); // held samples lag behind
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # What a run guarantees
//!
//! - Integration stops at every row, at every noise sample, and at every instant
//!   at which an expression *of time alone* jumps (relations, `floor`, `sign`) or
//!   has a kink (`abs`, `min`, `max`). They are isolated by interval arithmetic and
//!   bisected to the last bit, so that no pulse is too short to be seen; what rounding
//!   errors hide for more than a millionth of the interval, and what switches more than
//!   100,000 times in it, or 400,000 times and 1000 more per interval in a run, is refused by name. Jumps that depend on states are left to
//!   the error control.
//! - A value that is NaN or infinite never becomes an estimate: an adaptive step
//!   into it is shortened, and if the solution really leads there the run ends with
//!   the time, the state and the operation, keeping the rows before.
//! - The same settings and seed give the same numbers ([`Noise`] says how).
//! - Fixed steps come with [`StepAdvice`]; automatic ones are small enough for the
//!   fastest mode.
//!
//! # Choice of the integrator
//!
//! [`Method::Adaptive`] starts explicit, looks at the spectral radius of the
//! Jacobian every 40 steps, and changes to the implicit method where stability and
//! not accuracy holds the explicit one back, and back again. The Jacobian is that of the
//! graph ([`Slopes`]), compiled when it is first asked for; where it is sparse its factors are,
//! too. Only right-hand sides that do not know it (closures, a state that slides along a surface,
//! dense equations of very many operations) are looked at by differences.
//!
//! The explicit method is DOP853 (order 8) of Dormand and Prince, the implicit one Radau IIA of
//! order 5 (three stages), both after Hairer, Nørsett and Wanner and written here. Three crates
//! were built and run first, on the oscillator, Robertson's reaction (to t = 4·10⁴), van der
//! Pol's equation (μ = 1000), a finite escape and a derivative that turns NaN, at relative
//! tolerances 1e-6 to 1e-10:
//!
//! | crate | added crates, clean build (2 cores) | explicit | stiff | NaN, escape |
//! |---|---|---|---|---|
//! | `differential-equations` 0.7 | 16, 16 s | DOP853: error 6e-10 at 1e-10 in 63 µs, exact stops | Radau5 panics for states of dynamic length, and with fixed length is wrong by 1e-7 at 1e-10; BDF fails to start below 1e-8 | DOP853 rejects the step; Radau5 accepts NaN |
//! | `diffsol` 0.18 (only `nalgebra`) | 106, 223 s | Tsit45: 2e-10 in 506 µs | BDF accurate: 0.33 ms for Robertson at 1e-10 | Tsit45 accepts NaN |
//! | `ode_solvers` 0.6 | 33, not built | DOP853 | none | not run |
//!
//! None stops exactly at every row, refuses what is not finite and is right for stiff systems of
//! any length at once. Both methods are tested against values that other integrators give at
//! tighter tolerances.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod adaptive;
mod batch;
mod blueprint;
mod classical;
mod closed_loop;
mod correlation;
pub mod credible;
mod divergence;
mod dynamics;
mod equations;
mod error;
mod estimator;
mod events;
pub mod filter;
mod fleet;
mod grid;
mod integrator;
mod jacobian;
mod lanes;
mod late;
mod linearised;
pub mod manifold;
mod method;
mod noise;
mod routine;
mod run;
mod runner;
mod sampled;
mod settings;
mod simulation;
mod slopes;
mod snapshot;
mod spread;
mod standing;
mod steps;
mod system;
mod trajectory;

pub use batch::{Batch, Ended, Member};
pub use blueprint::{Blueprint, Tuned, Updates, fastest_at, fastest_mode};
pub use dynamics::{Dynamics, Events, Function};
pub(crate) use error::Result;
pub use error::{Error, Interrupted, Margin};
pub use estimator::Estimator;
pub use events::{
    Cause, ClauseShape, Clauses, Guards, Instants, JumpSlopes, Memory, Seen, WhenExpressions,
    first_jump,
};
pub use fleet::{Apart, Fleet};
pub use integrator::{Integrator, Rk4, StepAdvice};
pub use jacobian::{Fastest, spectral_radius};
pub use late::{Handover, HandoverRow, Late, Revised, is_of_row};
pub use linearised::{Jacobian, Jacobians, Linearised};
pub use manifold::Manifold;
pub use method::{Method, Step, Tolerances};
pub use noise::{Level, Noise, ProcessDraws, deviate, process_draws};
pub use routine::Backend;
pub use settings::{BetweenSamples, EstimatorSettings};
pub use simulation::Simulation;
pub use slopes::{Place, Slopes};
pub use snapshot::{Digest, SnapshotFault};
pub use spread::Lag;
pub use standing::{Errors, Standing};
pub use steps::fuse_steps;
pub use system::{Evaluation, Expressions, Parts, System};
pub use trajectory::{Column, Role, Trajectory};
