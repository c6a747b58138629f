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
//! Features: `plot` (on by default) draws pictures, `parquet` reads and writes Parquet. The program
//! `lynkeus` is a crate of its own, `lynkeus-cli`.
//!
//! What runs a study is the crate [`lynkeus_experiment`], whose names stand here, too: name them here. Here are what is
//! known, proved and fitted, and what is told and printed for elsewhere. The rooms stand in their order: each uses only
//! those before it, which a test sees to.
#![cfg_attr(test, allow(clippy::unwrap_used))]

// what the commands answer
mod check;

mod certify;

mod design;

mod fit;

pub mod precision;

// estimators for other machines
mod print;

mod report;

mod export;

#[cfg(test)]
mod answers_schema;

pub use certify::{
    AtTheta, CertifyReport, ErrorTube, Excitation, Excited, Followed, Reading, Strays, Tube,
    Witness, certify,
};
pub use check::{Assumption, CheckOptions, Knowledge, Known, Next, Report, Reserve, check};
pub use design::{DesignReport, design};
pub use export::export;
pub use fit::function::{LikelihoodFunction, LikelihoodPoint, LogInnovations, likelihood};
pub use fit::{Fit, FitOptions, fit};
pub use precision::precision;
pub use print::target::{Artifact, Export, ExportOptions, Subject, Target};
pub use report::{Page, ReportOptions, report};

pub use lynkeus_experiment::monte_carlo::monte_carlo;
pub use lynkeus_experiment::tune::tune;
pub use lynkeus_experiment::{
    Account, Accuracy, Against, Answer, Change, Checkpoint, Choice, Compared, Comparison,
    Correction, Corrections, Coverage, Doubt, DoubtKind, DoubtLevel, Excursion, Frozen, GainEntry,
    Grounds, InjectionEntry, Interval, Intervals, Misfit, OpenRun, Origin, Outcome, Outside,
    Proposal, Quantity, Resolution, Run, Runner, Runners, Sampled, Settled, Settling, Simulated,
    Speed, Watch, compare, estimate, estimate_resumed, estimator, explain, interrupt,
    late_estimator, log, log_of, observer_system, open_run, side_by_side, simulate, whole_log,
};

/// From a study to its plant, its choice of an observer and the design.
pub mod prepare {
    pub use lynkeus_experiment::prepare::{Prepared, StudyDesign, plant, refuse_misfits};
}

/// Rows that come one by one under the names of a log, and what is told of them.
pub mod stream {
    pub use lynkeus_experiment::stream::{Alarm, Channel, Given, Stream, Told};
}

/// What every page is made of: its style, and what draws pictures in it.
pub mod report_parts {
    pub use crate::report::{PLOT, PLOT_LICENSE, PLOT_STYLE, STYLE};
}

/// Values of keys, tried: which is best.
pub mod tune {
    pub use lynkeus_experiment::tune::axis::{changed, usual};
    pub use lynkeus_experiment::tune::{Axis, Change, Foretold, Measure, Peak, Row, Sweep, tune};
}

/// Many runs of a study, each with a seed of its own.
pub mod monte_carlo {
    pub use lynkeus_experiment::monte_carlo::{
        Again, Bands, Failure, MonteCarlo, Scattered, Settled, monte_carlo,
    };
}

pub use lynkeus_answer::{Document, Error, ErrorKind, code, document, near, visible};
pub use lynkeus_export::curly::c::Precision;
pub use lynkeus_export::curly::fmu::Version as FmiVersion;
pub use lynkeus_study::{Records, Study, schema};
pub use lynkeus_table::{Incoming, Series, Table, series};

pub use lynkeus_expr as expr;
pub use lynkeus_gain as gain;
pub use lynkeus_model as model;
pub use lynkeus_observability as observability;
pub use lynkeus_observers as observers;
#[cfg(feature = "plot")]
pub use lynkeus_plot as plot;
pub use lynkeus_proof as proof;
pub use lynkeus_run as run;
pub use lynkeus_structure as structure;
pub use lynkeus_study as study;
pub use lynkeus_table as table;
