//! A run in figures, for programs.

use serde::Serialize;
use serde_json::{Value, json};

use super::{Ended, Outcome, Watch};
use crate::entries::{Named, finite};
use crate::judge::InnovationCounts;
use crate::judge::interval::SamplingLimits;
use crate::judge::outside::OutsideBox;
use crate::prepare::declared::Account;
use crate::{Accuracy, Doubt, Frozen};

/// The answer of `simulate` and `estimate`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct RunReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// the observer family
    family: &'static str,
    /// the states of each chain, from the sensor outward
    chains: &'a [Vec<String>],
    /// the gain by measured output, then by state, of families with a constant one
    gains: Named<Named<f64>>,
    /// number of rows
    rows: usize,
    /// headers of the columns
    columns: Vec<String>,
    /// headers of the estimates, by quantity
    estimates: Named<&'a str>,
    /// the last estimate of each quantity, in its unit
    #[serde(rename = "final")]
    #[cfg_attr(feature = "schema", schemars(with = "Named<f64>"))]
    last: Named<Option<f64>>,
    /// root mean square error of each quantity over the last half of the rows, where its truth is known
    rms_error_last_half: Named<f64>,
    /// errors of each quantity whose truth is known
    errors: Named<&'a Accuracy>,
    /// the log's samples beside what the observer stands
    sampling: Option<SamplingLimits>,
    /// sensors that hang
    frozen: &'a [Frozen],
    /// monitors of the observer
    monitors: Named<&'a Watch>,
    /// where the run leaves the declared ranges
    outside_box: OutsideBox<'a>,
    /// of a filter, by sensor
    innovations: Named<InnovationCounts>,
    /// of a particle filter
    particles: Option<ParticleCounts>,
    /// whether nothing speaks against the estimates
    credible: bool,
    /// what of the study's declarations was counted
    declared: &'a Account,
    /// why it ended before its last row, where it did
    ended: Option<&'a Ended>,
    /// what speaks against the estimates
    doubts: &'a [Doubt],
    /// what of the log contradicts itself, or counts nowhere
    warnings: &'a [String],
    /// what you should know
    notes: &'a [String],
}

/// How particles went.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct ParticleCounts {
    /// how many there are
    particles: usize,
    /// updates by readings
    updates: usize,
    /// number of resamplings
    resampled: usize,
    /// the least number that counted after an update, (Σw)²/Σw²
    lowest_ess: Option<f64>,
    /// updates whose readings no particle explains
    starved: usize,
    /// updates after which one had all the weight
    alone: usize,
}

impl Outcome {
    /// The run in figures, as the command's `--json` prints it.
    pub fn entries(&self) -> Value {
        let estimated = || {
            let quantities = self.quantities.iter();
            quantities.filter_map(|q| Some((q, q.estimate.as_ref()?)))
        };
        let columns = self.columns().into_iter();
        json!(RunReport {
            plant: &self.plant,
            family: self.design.examination.family.name(),
            chains: &self.design.examination.chains,
            gains: self.gains(),
            rows: self.time.len(),
            columns: columns.map(|(name, _)| name).collect(),
            estimates: estimated()
                .map(|(q, _)| (q.name.clone(), &*q.estimate_header))
                .collect(),
            last: estimated()
                .map(|(q, estimate)| (q.name.clone(), estimate.last()))
                .collect(),
            rms_error_last_half: estimated().filter_map(|(q, _)| q.told_error()).collect(),
            errors: self
                .accuracies
                .iter()
                .map(|a| (a.quantity.clone(), a))
                .collect(),
            sampling: self.intervals.as_ref().map(|found| found.entry(false)),
            frozen: &self.frozen,
            monitors: self
                .watches
                .iter()
                .map(|w| (w.monitor.name.clone(), w))
                .collect(),
            outside_box: OutsideBox {
                plant: &self.plant_outside,
                estimate: &self.estimate_outside,
            },
            innovations: self
                .innovations
                .iter()
                .map(|i| (i.output.clone(), i.into()))
                .collect(),
            particles: self.particles.map(|(count, told)| ParticleCounts {
                particles: count,
                updates: told.updates,
                resampled: told.resampled,
                lowest_ess: finite(told.lowest),
                starved: told.starved,
                alone: told.alone,
            }),
            credible: self.is_credible(),
            declared: &self.declared,
            ended: self.ended.as_ref(),
            doubts: &self.doubts,
            warnings: &self.warnings,
            notes: &self.notes,
        })
    }

    fn gains(&self) -> Named<Named<f64>> {
        let gains = self.design.gains.iter();
        gains
            .map(|gain| (gain.output.clone(), gain.entries.iter().cloned().collect()))
            .collect()
    }
}
