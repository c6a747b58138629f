//! The report for machines: JSON and columns.

use lynkeus_observability::precision::{self, Advice};
use serde::Serialize;
use serde_json::{Value, json};

use super::Report;
use lynkeus_experiment::entries::{Named, finite};
use lynkeus_experiment::prepare::declared::Account;
use lynkeus_experiment::prepare::headers::Headers;

/// The answer of `check --how-well`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct HowWellReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// the first instant
    start: f64,
    /// time between samples
    sample_step: f64,
    /// the longest span of readings
    horizon: Option<f64>,
    /// sensors and their noise
    sensors: Vec<SensorUsed<'a>>,
    /// the size of each quantity that its error is compared with, in its unit
    scale: Named<f64>,
    /// of the present value of each quantity, in its unit; none where it is not seen
    standard_error: Named<Option<f64>>,
    /// of the value at the start
    standard_error_of_start: Named<Option<f64>>,
    /// of the present value were the model exact
    standard_error_exact_model: Named<Option<f64>>,
    /// standard deviation that an extended Kalman filter has at the end, where it does not break down
    filter_sd: Named<Option<f64>>,
    /// whether `[process_noise]` is counted
    counts_process_noise: bool,
    /// what of the study's declarations was counted
    declared: &'a Account,
    /// disturbances that are not counted
    disturbances_taken_as_zero: &'a [String],
    /// quantities, the one that is known best first
    ranked: Vec<&'a str>,
    /// how many directions are seen
    rank: Rank,
    /// standard errors over the span of readings, as the columns
    over_horizon: Named<Vec<Option<f64>>>,
    /// which sensors to add or to take, where that was asked
    advice: Option<AdviceEntry<'a>>,
}

/// A sensor.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct SensorUsed<'a> {
    /// the output
    name: &'a str,
    /// its noise in words
    noise: &'a str,
    /// whether the study says it
    noise_stated: bool,
    /// whether the study measures it; else it was tried
    measured: bool,
}

/// Directions of the state that the readings show.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct Rank {
    /// how many are seen
    seen: usize,
    /// how many there are
    of: usize,
    /// the weakest that counts as seen
    weakest_seen: Option<f64>,
    /// the strongest that does not
    strongest_unseen: Option<f64>,
    /// the border between them
    threshold: Option<f64>,
    /// whether that border is in doubt
    doubtful: bool,
}

/// Which sensors to add or to take.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Advice"))]
struct AdviceEntry<'a> {
    /// the study's sensors
    present: SensorSet<'a>,
    /// other sets of as many
    same_size: Vec<SensorSet<'a>>,
    /// whether all of these were tried
    same_size_complete: bool,
    /// the study's with one more
    additions: Vec<SensorSet<'a>>,
    /// one sensor alone
    singles: Vec<SensorSet<'a>>,
    /// two sensors alone
    pairs: Vec<SensorSet<'a>>,
}

/// A set of sensors.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct SensorSet<'a> {
    /// the outputs
    sensors: Vec<&'a str>,
    /// quantities that it does not show
    unseen: usize,
    /// standard errors of what is seen as a share of their scales, the geometric mean
    mean_share: Option<f64>,
    /// the quantity that is known worst
    worst: Option<&'a str>,
    /// its standard error as a share of its scale
    worst_share: Option<f64>,
}

impl Report {
    /// The report as one JSON object; what is not seen is `null`.
    pub fn entries(&self) -> Value {
        let last = self.last();
        let scales = self.names.iter().cloned().zip(self.scales.iter().copied());
        let sensors = self.sensors.iter().enumerate().map(|(i, s)| SensorUsed {
            name: &s.name,
            noise: &s.noise,
            noise_stated: s.is_stated,
            measured: i < self.measured,
        });
        let rank = last.map(|d| d.rank).unwrap_or_default();
        let ranked = self.ranked();
        json!(HowWellReport {
            plant: &self.plant,
            start: self.start,
            sample_step: self.step,
            horizon: self.horizons.last().copied(),
            sensors: sensors.collect(),
            scale: scales.collect(),
            standard_error: self.of_all(last.map(|d| &d.present)),
            standard_error_of_start: self.of_all(last.map(|d| &d.start)),
            standard_error_exact_model: self.by_name(self.exact.last()),
            filter_sd: self.by_name(self.filtered.as_ref().and_then(|all| all.last())),
            counts_process_noise: self.counted.contains(&super::PROCESS_NOISE),
            declared: &self.declared,
            disturbances_taken_as_zero: &self.disturbances,
            ranked: ranked.iter().map(|&i| &*self.names[i]).collect(),
            rank: Rank {
                seen: rank.seen,
                of: rank.of,
                weakest_seen: finite(rank.weakest_seen),
                strongest_unseen: finite(rank.strongest_unseen),
                threshold: finite(rank.threshold),
                doubtful: self.is_doubtful,
            },
            over_horizon: self.over_horizon(),
            advice: self.advice.as_ref().map(|advice| self.advised(advice)),
        })
    }

    /// Of every quantity, be there a value or not.
    fn of_all(&self, values: Option<&Vec<f64>>) -> Named<Option<f64>> {
        let value = |i: usize| values.and_then(|values| values.get(i)).copied();
        let told = |i| finite(self.told(i, value(i).unwrap_or(f64::INFINITY)));
        let names = self.names.iter().cloned().enumerate();
        names.map(|(i, name)| (name, told(i))).collect()
    }

    fn by_name(&self, values: Option<&Vec<f64>>) -> Named<Option<f64>> {
        let values = values.into_iter().flatten().enumerate();
        let names = self.names.iter().cloned().zip(values);
        names
            .map(|(name, (i, σ))| (name, finite(self.told(i, *σ))))
            .collect()
    }

    fn over_horizon(&self) -> Named<Vec<Option<f64>>> {
        let columns = self.columns().into_iter();
        columns
            .map(|(name, values)| (name, values.into_iter().map(finite).collect()))
            .collect()
    }

    fn advised(&self, advice: &Advice) -> AdviceEntry<'_> {
        let set = |set: &precision::SensorSet| {
            let sensors = set.sensors.iter().filter_map(|&s| self.sensors.get(s));
            SensorSet {
                sensors: sensors.map(|s| &*s.name).collect(),
                unseen: set.unseen,
                mean_share: finite(set.score.exp()),
                worst: self.names.get(set.worst).map(String::as_str),
                worst_share: finite(self.share(&set.deviations, set.worst)),
            }
        };
        let sets = |sets: &[precision::SensorSet]| sets.iter().map(set).collect();
        AdviceEntry {
            present: set(&advice.present),
            same_size: sets(&advice.same_size),
            same_size_complete: advice.is_complete,
            additions: sets(&advice.additions),
            singles: sets(&advice.singles),
            pairs: sets(&advice.pairs),
        }
    }

    /// `horizon`, unless a quantity is called so.
    fn horizon_header(&self) -> String {
        Headers::beside_names(self.names.iter().cloned()).free("horizon", "the horizon")
    }

    /// `horizon` (`horizon_2` where a quantity is called so), then the present standard error
    /// of every quantity at it.
    pub fn columns(&self) -> Vec<(String, Vec<f64>)> {
        let curve = |i: usize| {
            let errors = self.deviations.iter();
            errors.map(|d| self.told(i, d.present[i])).collect()
        };
        let curves = self.names.iter().enumerate();
        std::iter::once((self.horizon_header(), self.horizons.clone()))
            .chain(curves.map(|(i, name)| (name.clone(), curve(i))))
            .collect()
    }
}
