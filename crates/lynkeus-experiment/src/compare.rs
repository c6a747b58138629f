//! Every observer that can be had, on the same data.

mod print;
mod run;
mod samples;

use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::{FAMILIES, Family};
use lynkeus_structure::Standing;
use serde::Serialize;

#[cfg(feature = "schema")]
pub use print::ComparisonReport;
pub use run::{Compared, Run, Settled};
use run::{of_family, run_all};
pub use samples::Interval;

use crate::prepare::Prepared;
use crate::prepare::mentioned::asked;
use crate::{Error, Study, Table, prepare};

/// The answer of `lynkeus compare`.
#[derive(Debug)]
pub struct Comparison {
    /// name of the plant
    pub plant: String,
    /// one per family
    pub rows: Vec<Compared>,
    /// what the figures are measured against
    pub against: Against,
    /// how a simulation was sampled; none of a log
    pub interval: Option<Interval>,
    /// the unit of time, where the study has one
    pub time_unit: Option<String>,
}

/// What errors are measured against.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Against {
    /// the simulated plant
    Simulation,
    /// columns of the log that the observers do not read
    Log,
    /// nothing: the log has no true values
    Nothing,
}

/// Runs every family of `[compare]`, or each that fits and the filters, on a log, or on samples of
/// the study's simulation: the same for each. Keys of `[observer]` reach the families that own
/// them. Where the simulation has no noise its sensors are continuous: samples lie on lines, as
/// densely as it takes until halving their interval changes no error any more.
///
/// # Errors
/// A study that does not fit its plant; no family that can be run; a log without the columns
/// that are read.
pub fn compare(
    study: &Study,
    log: Option<&Table>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Comparison, Error> {
    let plant = prepare::plant(study)?;
    let families = families(study, &plant)?;
    let (rows, interval) = match log {
        Some(table) => (run_all(study, &plant, &families, table, watch)?, None),
        None => {
            let (rows, interval) = samples::simulated(study, &plant, &families, watch)?;
            (rows, Some(interval))
        }
    };
    if rows.iter().all(|row| row.run.is_err()) {
        let mut reasons = rows.iter().filter_map(|row| row.run.as_ref().err());
        let first = reasons.next().cloned().unwrap_or_default();
        return Err(Error::refused(format!("no family can be run: {first}")).at(&study.file));
    }
    let mut runs = rows.iter().filter_map(|row| row.run.as_ref().ok());
    let known = runs.any(|run| run.peak.is_some());
    Ok(Comparison {
        plant: plant.name.clone(),
        rows,
        against: match (log, known) {
            (None, _) => Against::Simulation,
            (Some(_), true) => Against::Log,
            (Some(_), false) => Against::Nothing,
        },
        interval,
        time_unit: study.time_unit.clone(),
    })
}

/// The families asked for; else those that are not refuted, whose required keys are there or not,
/// and the filters; those that draw random numbers where they are asked for.
fn families(study: &Study, plant: &Plant) -> Result<Vec<&'static dyn Family>, Error> {
    if let Some(asked) = asked(study)? {
        return Ok(asked);
    }
    let mut found = vec![];
    let is_able = |family: &&&'static dyn Family| {
        !family.is_sampled() && (plant.whens.is_empty() || family.follows_jumps())
    };
    for &family in FAMILIES.iter().filter(is_able) {
        let own = of_family(study, family);
        let prepared = Prepared::new(&own, plant)?;
        let examined = prepared.examinations()?;
        if examined.iter().any(|e| e.fit() != Standing::Refuted) {
            found.push(family);
        }
    }
    Ok(found)
}

impl Comparison {
    /// Whether an estimate of some family is credible.
    #[must_use]
    pub fn is_positive(&self) -> bool {
        let mut runs = self.rows.iter().filter_map(|row| row.run.as_ref().ok());
        runs.any(|run| run.doubt.is_none())
    }
}
