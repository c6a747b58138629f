//! Experiments with a study: simulated, estimated from a log, tuned, compared, run many times; and whether the result
//! is credible.
//!
//! A study has its plant, its choice of an observer and the design from [`prepare`]. [`course`] is the one engine that
//! takes plant and observer through time, over rows of a log or of a simulation, and [`judge`] says what is to be
//! thought of the result, an [`Outcome`]. [`tune`](mod@tune), `compare` and [`monte_carlo`](mod@monte_carlo) ask the
//! engine again and again; where a study leaves the observer open, its choice asks `tune`.
//!
//! It knows studies, logs and observers. It must not know what is proved of them, how a fit searches, what is printed
//! for other machines, or which command asks: that is `lynkeus`, which is also what users name.
//!
//! The rooms below stand in their order: each uses only those before it, which a test sees to.
#![cfg_attr(test, allow(clippy::unwrap_used))]

// what all rooms need
pub mod crew;
pub mod entries;
pub mod interrupt;
pub mod thrifty;
pub mod words;

// from a study to its plant, its choice of an observer and the design
pub mod prepare;

// the plant through time, and one observer over the rows of a log or a simulation
pub mod course;

// what an answer tells
pub mod answer;

// whether the result is credible, and what is said of it
pub mod judge;

// what the commands answer
mod estimate;

mod simulate;

// chosen values into a study file
pub mod rewrite;

pub mod tune;

mod compare;

#[cfg(feature = "plot")]
pub mod figure;

pub mod monte_carlo;

// the plant alone, driven by a log
mod open_run;

// the same study again and again
mod choose;

pub use answer::{Answer, Origin};
pub use choose::runner::{Runner, Runners};
pub use compare::{Against, Compared, Comparison, Interval, Run, Settled, compare};
pub use course::checkpoint::Checkpoint;
pub use course::columns::{log, log_of, whole_log};
pub use course::corrections::Corrections;
pub use course::doubt::{Doubt, Kind as DoubtKind, Level as DoubtLevel};
pub use course::quantity::Quantity;
pub use course::sampling::Resolution;
pub use estimate::live::{blueprint, estimator, late_estimator};
pub use estimate::stream;
pub use estimate::{estimate, estimate_resumed, estimated, side_by_side};
pub use judge::accuracy::{Accuracy, Coverage, Settling};
pub use judge::frozen::Frozen;
pub use judge::interval::{Intervals, Sampled};
pub use judge::outcome::{Outcome, Watch};
pub use judge::outside::{Excursion, Outside};
pub use monte_carlo::monte_carlo;
pub use open_run::{Misfit, OpenRun, Simulated, open_run};
pub use prepare::choice::{Choice, Grounds, Proposal, Speed};
pub use prepare::correction::{Correction, GainEntry, InjectionEntry};
pub use prepare::declared::Account;
pub use prepare::systems::observer as observer_system;
pub use rewrite::Change;
pub use simulate::{simulate, simulated, simulated_by};
pub use tune::tune;
pub use words::explain;

// what their JSON is, for the test that writes the schema down
#[cfg(feature = "schema")]
pub use {
    compare::ComparisonReport, judge::outcome::RunReport, monte_carlo::MonteCarloReport,
    open_run::OpenRunReport, tune::SweepReport,
};

use lynkeus_answer::{Error, ErrorKind, near, visible};
use lynkeus_study::Study;
use lynkeus_table::{Series, Table};
