//! A simulation as a log: sampled so densely that the samples decide nothing.

use std::time::{Duration, Instant};

use lynkeus_model::Plant;
use serde::Serialize;

use crate::course::plant::recorded;
use crate::prepare::systems;
use crate::{Error, Study, Table};

/// Why a simulation was sampled at its interval.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub enum Resolution {
    /// the study says so: its sensors have noise, or a `sample_step`
    #[serde(rename = "study")]
    Study,
    /// at twice the interval every error is nearly the same
    #[serde(rename = "errors have settled")]
    Settled,
    /// at half the interval there would be too many rows, or it would take too long
    #[serde(rename = "cost")]
    Cost,
}

/// No more rows than this for the sake of the interval alone,
const ROWS: f64 = 20_000.0;
/// and none more where those at hand took so long.
const LONG: Duration = Duration::from_secs(4);

/// The study's plant as a logger would have it, with what is true.
pub struct Sampling {
    /// as a log
    pub table: Table,
    /// from one sample to the next
    pub step: f64,
    /// why this interval
    pub resolution: Resolution,
}

/// Samples of the study's simulation. Where the study says neither noise nor `sample_step` their interval is
/// halved until what `errors` finds on them is the same as before, or more would cost too much.
///
/// # Errors
/// A study that cannot be run, or what `errors` tells.
pub fn sampling<E>(
    study: &Study,
    plant: &Plant,
    errors: &mut dyn FnMut(&Table) -> Result<E, Error>,
    are_same: &dyn Fn(&E, &E) -> bool,
) -> Result<Sampling, Error> {
    let settings = systems::settings(study)?;
    let sampled = |step, resolution| {
        Ok(Sampling {
            table: recorded(study, plant, step)?,
            step,
            resolution,
        })
    };
    if let Some(step) = systems::sampled_every(study, settings) {
        return sampled(step, Resolution::Study);
    }
    let mut found = sampled(settings.row_step(), Resolution::Cost)?;
    let mut coarse: Option<E> = None;
    loop {
        let since = Instant::now();
        let fine = errors(&found.table)?;
        if coarse.is_some_and(|coarse| are_same(&coarse, &fine)) {
            found.resolution = Resolution::Settled;
            return Ok(found);
        }
        let is_long = since.elapsed() > LONG || study.budget.spent().is_some();
        if is_long || 2.0 * (settings.until - settings.start) / found.step > ROWS {
            return Ok(found);
        }
        coarse = Some(fine);
        found = sampled(found.step / 2.0, Resolution::Cost)?;
    }
}
