//! The families on a simulation, sampled so densely that the samples do not decide the comparison.

use std::fmt;

use lynkeus_model::Plant;
use lynkeus_observers::Family;
use lynkeus_words::short;
use serde::Serialize;

use super::run::{Compared, Watch, run_all};
use crate::course::sampling::{Resolution, Sampling, sampling};
use crate::{Error, Study, Table};
use lynkeus_study::BetweenSamples;

/// How a simulation was sampled.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "ComparedSampling")
)]
pub struct Interval {
    /// time between two samples
    #[serde(rename = "interval")]
    pub step: f64,
    /// why this one
    #[serde(rename = "chosen_by")]
    pub resolution: Resolution,
    /// unit of time, where the study names it
    #[serde(skip)]
    pub unit: Option<String>,
}

/// Errors that differ by no more than this share of the larger one are the same.
const SAME: f64 = 0.25;

/// Errors below this share of a quantity's range are as good as none.
const NONE: f64 = 1e-4;

/// The families on samples of the study's simulation.
pub(super) fn simulated(
    study: &Study,
    plant: &Plant,
    families: &[&'static dyn Family],
    watch: Watch<'_>,
) -> Result<(Vec<Compared>, Interval), Error> {
    let mut continuous = study.clone();
    continuous.estimate.between_samples = BetweenSamples::Linear;
    // windows of many samples take long and see what the other filters see: they are not asked
    let quick = families.iter().copied();
    let quick: Vec<&'static dyn Family> = quick.filter(|family| !family.owns(WINDOW)).collect();
    let mut from = 0.0;
    let errors = &mut |table: &Table| {
        let to = from + (0.5 - from) / 2.0;
        let part = &mut |done: f64| watch(from + done * (to - from));
        let found = run_all(&continuous, plant, &quick, table, part)?;
        from = to;
        Ok(found)
    };
    let Sampling {
        table,
        step,
        resolution,
    } = sampling(study, plant, errors, &|a, b| are_same(a, b))?;
    let rows = match resolution {
        Resolution::Study => run_all(study, plant, families, &table, watch)?,
        Resolution::Settled | Resolution::Cost => {
            let last = &mut |done: f64| watch(0.5 + 0.5 * done);
            run_all(&continuous, plant, families, &table, last)?
        }
    };
    let unit = study.time_unit.clone();
    let interval = Interval {
        step,
        resolution,
        unit,
    };
    Ok((rows, interval))
}

/// The key of families that look at a window of samples.
const WINDOW: &str = "horizon";

/// Whether every family has the same errors, or none, in both.
fn are_same(coarse: &[Compared], fine: &[Compared]) -> bool {
    coarse
        .iter()
        .zip(fine)
        .all(|(a, b)| match (&a.run, &b.run) {
            (Ok(a), Ok(b)) => {
                let mut pairs = a.settled.iter().zip(&b.settled);
                pairs.all(|(a, b)| is_same(a.rms, b.rms, a.width))
            }
            (a, b) => a.is_err() == b.is_err(),
        })
}

fn is_same(a: Option<f64>, b: Option<f64>, width: f64) -> bool {
    let (Some(a), Some(b)) = (a, b) else {
        return a.is_none() && b.is_none();
    };
    let larger = a.max(b);
    larger <= NONE * width || (a - b).abs() <= SAME * larger
}

impl fmt::Display for Interval {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let unit = self
            .unit
            .as_ref()
            .map_or(String::new(), |u| format!(" {u}"));
        let step = short(self.step);
        match self.resolution {
            Resolution::Study => write!(f, "sampled every {step}{unit} as the study says"),
            Resolution::Settled => write!(
                f,
                "sampled every {step}{unit} with lines in between: at twice the interval the errors are the same within 25 %"
            ),
            Resolution::Cost => write!(
                f,
                "sampled every {step}{unit} with lines in between: a shorter interval may still change errors, and costs too much"
            ),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::is_same;

    #[test]
    fn errors_are_the_same_within_a_quarter_or_where_there_are_none() {
        assert!(is_same(Some(0.4), Some(0.31), 1.0));
        assert!(!is_same(Some(0.4), Some(0.29), 1.0));
        // both less than 1e-4 of a range of 10
        assert!(is_same(Some(9e-4), Some(1e-9), 10.0));
        assert!(!is_same(Some(9e-4), Some(1e-9), 1.0));
        assert!(is_same(None, None, 1.0) && !is_same(None, Some(0.0), 1.0));
    }
}
