//! From a plant's equations and a few sensors to estimates of what nobody measures.
//!
//! A plant is written in Modelica, or in Rust as functions over expressions. Both
//! give the same observer and the same estimate:
//!
//! ```
//! use lynkeus::model::{LoadOptions, Model, Plant};
//! use lynkeus::observers::{Tuning, triangular::TRIANGULAR};
//! use lynkeus::run::{Estimator, EstimatorSettings};
//! use lynkeus::structure::{AugmentedPlant, Sensors};
//!
//! // A tank of unknown inflow: der(level) = inflow - 0.5*sqrt(level).
//! let in_modelica = Plant::from_modelica(
//!     "model Tank
//!        input Real inflow;
//!        Real level(start = 4, min = 0.1, max = 10);
//!        output Real y = level;
//!      equation
//!        der(level) = inflow - 0.5*sqrt(level);
//!      end Tank;",
//!     "tank.mo",
//!     &LoadOptions::default(),
//! )?;
//!
//! let model = Model::new("Tank");
//! let inflow = model.input("inflow", |_| ());
//! let level = model.state("level", |level| {
//!     level.start = Some(4.0);
//!     (level.min, level.max) = (0.1, 10.0);
//! });
//! model.der(level, inflow - 0.5 * level.sqrt());
//! model.output("y", level, |_| ());
//! let in_rust = model.finish()?;
//!
//! // The sensor shows a tank at rest at 4: what flows in?
//! for plant in [in_modelica, in_rust] {
//!     let sensors = Sensors { unknown: vec!["inflow".into()], ..Sensors::default() };
//!     let augmented = AugmentedPlant::new(&plant, &sensors)?;
//!     let design = TRIANGULAR.design(&augmented, &Tuning::from([("theta", 1.0)]))?;
//!     let observer = lynkeus::observer_system(&plant, &design.observer)?;
//!     let mut estimator = Estimator::new(&observer, EstimatorSettings::default())?;
//!     for second in 0..60 {
//!         estimator.push(f64::from(second), &[4.0])?;
//!     }
//!     let [level, inflow] = estimator.estimate() else { unreachable!() };
//!     assert!((level - 4.0).abs() < 1e-6 && (inflow - 1.0).abs() < 1e-6);
//! }
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! With files instead, [`Study::load`] reads a study, [`estimator`] makes its estimator for live
//! samples, and [`check`], [`simulate`] and
//! [`estimate`] do what the commands of the same names do.
//!
//! Features, all on by default: `plot` draws pictures, `tune` sweeps tunings, and `command` is
//! the program `lynkeus`.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod accuracy;
mod assertions;
mod calibrate;
mod certify;
mod check;
mod checkpoint;
mod choice;
mod choose;
mod columns;
#[cfg(feature = "tune")]
mod compare;
mod continuous;
mod correction;
mod corrections;
mod course;
mod crew;
mod declared;
mod design;
mod estimate;
mod expected;
mod export;
#[cfg(feature = "plot")]
mod figure;
mod files;
mod filter;
mod fixed_steps;
mod fmu;
mod frozen;
mod headers;
mod incoming;
mod inputs;
pub mod interrupt;
mod interval;
mod judge;
mod lines;
mod live;
mod mentioned;
mod modes;
pub mod monte_carlo;
mod outcome;
mod outside;
#[cfg(feature = "plot")]
pub mod plot;
pub mod precision;
pub mod prepare;
mod propose;
mod quantity;
mod recorded;
mod replay;
#[cfg(feature = "tune")]
mod report;
mod runner;
mod sampled;
mod saturated;
pub mod series;
mod simulate;
mod spread;
pub mod study;
mod systems;
pub mod table;
mod thrifty;
mod tunable;
#[cfg(feature = "tune")]
pub mod tune;
mod words;

pub use accuracy::{Accuracy, Coverage, Settling};
pub use certify::{AtTheta, CertifyReport, Excitation, Excited, Strays, certify};
pub use check::{Assumption, CheckOptions, Knowledge, Known, Next, Report, Reserve, check};
pub use checkpoint::Checkpoint;
pub use choice::{Choice, Grounds, Proposal, Speed};
pub use columns::log;
#[cfg(feature = "tune")]
pub use compare::{Against, Compared, Comparison, Interval, Resolution, Run, Settled, compare};
pub use correction::{Correction, GainEntry, InjectionEntry};
pub use corrections::Corrections;
pub use declared::Account;
pub use design::{DesignReport, design};
pub use estimate::{estimate, estimate_resumed};
pub use export::{Artifact, Export, ExportOptions, Subject, Target, export};
#[cfg(feature = "plot")]
pub use figure::figure;
pub use frozen::Frozen;
pub use incoming::Incoming;
pub use interval::{Intervals, Sampled};
pub use judge::{Doubt, Innovations, Kind as DoubtKind, Level as DoubtLevel};
pub use live::estimator;
pub use monte_carlo::monte_carlo;
pub use outcome::{Outcome, Watch};
pub use outside::{Excursion, Outside};
pub use precision::precision;
pub use quantity::Quantity;
#[cfg(feature = "tune")]
pub use report::{Page, ReportOptions, report};
pub use runner::{Runner, Runners};
pub use series::Series;
pub use simulate::simulate;
pub use study::{Study, schema};
pub use systems::observer as observer_system;
pub use table::Table;
#[cfg(feature = "tune")]
pub use tune::tune;

pub use words::explain;

pub use lynkeus_answer::{Error, ErrorKind, near, visible};
pub use lynkeus_export::curly::c::Precision;
pub use lynkeus_export::curly::fmu::Version as FmiVersion;

pub use lynkeus_expr as expr;
pub use lynkeus_gain as gain;
pub use lynkeus_model as model;
pub use lynkeus_observability as observability;
pub use lynkeus_observers as observers;
pub use lynkeus_proof as proof;
pub use lynkeus_run as run;
pub use lynkeus_structure as structure;
