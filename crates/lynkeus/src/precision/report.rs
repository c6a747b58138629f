//! The report for machines: JSON and columns.

use lynkeus_observability::precision::{Advice, SensorSet};
use serde_json::{Map, Value, json};

use super::Report;
use crate::prepare::headers::Headers;

impl Report {
    /// The report as one JSON object; what is not seen is `null`.
    pub fn to_json(&self) -> Value {
        let last = self.last();
        let of = |values: fn(&lynkeus_observability::precision::Deviations) -> &Vec<f64>| {
            let pairs = self.names.iter().enumerate().map(|(i, name)| {
                let value = last.and_then(|d| values(d).get(i)).copied();
                (
                    name.clone(),
                    finite(self.told(i, value.unwrap_or(f64::INFINITY))),
                )
            });
            Value::Object(pairs.collect())
        };
        let scales = self.names.iter().zip(&self.scales);
        let sensors = self.sensors.iter().enumerate().map(|(i, s)| {
            json!({
                "name": s.name,
                "noise": s.noise,
                "noise_stated": s.is_stated,
                "measured": i < self.measured,
            })
        });
        let rank = last.map(|d| d.rank).unwrap_or_default();
        json!({
            "plant": self.plant,
            "start": self.start,
            "sample_step": self.step,
            "horizon": self.horizons.last(),
            "sensors": sensors.collect::<Vec<_>>(),
            "scale": Value::Object(scales.map(|(n, s)| (n.clone(), json!(s))).collect()),
            "standard_error": of(|d| &d.present),
            "standard_error_of_start": of(|d| &d.start),
            "standard_error_exact_model": self.by_name(self.exact.last()),
            "filter_sd": self.by_name(self.filtered.as_ref().and_then(|all| all.last())),
            "counts_process_noise": self.counts_process_noise,
            "declared": self.declared.to_json(),
            "disturbances_taken_as_zero": self.disturbances,
            "ranked": self.ranked().iter().map(|&i| &self.names[i]).collect::<Vec<_>>(),
            "rank": {
                "seen": rank.seen,
                "of": rank.of,
                "weakest_seen": finite(rank.weakest_seen),
                "strongest_unseen": rank.strongest_unseen,
                "threshold": rank.threshold,
                "doubtful": self.is_doubtful,
            },
            "over_horizon": self.over_horizon(),
            "advice": self.advice.as_ref().map(|advice| self.advice_json(advice)),
        })
    }

    fn by_name(&self, values: Option<&Vec<f64>>) -> Value {
        let pairs = self.names.iter().zip(values.into_iter().flatten());
        let pairs = pairs.enumerate();
        let pairs = pairs.map(|(i, (name, σ))| (name.clone(), finite(self.told(i, *σ))));
        Value::Object(pairs.collect())
    }

    fn over_horizon(&self) -> Value {
        let mut object = Map::new();
        object.insert(self.horizon_header(), json!(self.horizons));
        for (i, name) in self.names.iter().enumerate() {
            let values = self
                .deviations
                .iter()
                .map(|d| finite(self.told(i, d.present[i])));
            object.insert(name.clone(), values.collect());
        }
        Value::Object(object)
    }

    fn advice_json(&self, advice: &Advice) -> Value {
        let set = |set: &SensorSet| {
            let names = set.sensors.iter().filter_map(|&s| self.sensors.get(s));
            json!({
                "sensors": names.map(|s| &s.name).collect::<Vec<_>>(),
                "unseen": set.unseen,
                "mean_share": finite(set.score.exp()),
                "worst": self.names.get(set.worst),
                "worst_share": finite(self.share(&set.deviations, set.worst)),
            })
        };
        let sets = |sets: &[SensorSet]| -> Value { sets.iter().map(set).collect() };
        json!({
            "present": set(&advice.present),
            "same_size": sets(&advice.same_size),
            "same_size_complete": advice.is_complete,
            "additions": sets(&advice.additions),
            "singles": sets(&advice.singles),
            "pairs": sets(&advice.pairs),
        })
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

fn finite(value: f64) -> Value {
    match value.is_finite() {
        true => json!(value),
        false => Value::Null,
    }
}
