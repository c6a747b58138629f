//! A comparison for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_words::figures;
use serde_json::{Map, Value, json};

use super::{Against, Compared, Comparison, Interval, Run};
use crate::{Answer, Doubt, Error};

impl Comparison {
    /// For machines.
    #[must_use]
    pub fn to_json(&self) -> Value {
        let row = |row: &Compared| match &row.run {
            Err(reason) => json!({ "family": row.family, "refused": reason }),
            Ok(run) => {
                let rms: Map<String, Value> = run
                    .settled
                    .iter()
                    .map(|s| (s.quantity.clone(), json!(s.rms)))
                    .collect();
                json!({
                    "family": row.family,
                    "rms": rms,
                    "peak": run.peak,
                    "settling_time": run.settling,
                    "roughness": run.roughness,
                    "seconds_per_sample": run.per_sample,
                    "credible": run.doubt.is_none(),
                    "doubts": run.outcome.doubts.iter().map(Doubt::to_json).collect::<Vec<_>>(),
                })
            }
        };
        json!({
            "plant": self.plant,
            "against": match self.against {
                Against::Simulation => "simulation",
                Against::Log => "log",
                Against::Nothing => "nothing",
            },
            "sampling": self.interval.as_ref().map(Interval::to_json),
            "families": self.rows.iter().map(row).collect::<Vec<_>>(),
            "warnings": self.warnings(),
        })
    }

    /// What of the log contradicts itself, or counts nowhere: the same for every family.
    #[must_use]
    pub fn warnings(&self) -> &[String] {
        self.runs()
            .next()
            .map_or(&[], |(_, run)| &run.outcome.warnings)
    }
}

/// Quantities shown in a table for people.
const SHOWN: usize = 5;

impl Answer for Comparison {
    fn document(&self) -> Document {
        let against = match self.against {
            Against::Simulation => "against the simulated plant",
            Against::Log => "against the columns of the log that are not read",
            Against::Nothing => "the log has no true values",
        };
        let sampled = self
            .interval
            .as_ref()
            .map(|interval| format!(", {interval}"));
        let sampled = sampled.unwrap_or_default();
        let mut document = Document::new(format!("{}: {against}{sampled}", self.plant));
        document.part().table(self.table());
        for (family, run) in self.runs() {
            if let Some(doubt) = &run.doubt {
                document.part().line(format!("{family}: {doubt}"));
            }
        }
        for row in &self.rows {
            if let Err(reason) = &row.run {
                document.part().line(format!("{}: {reason}", row.family));
            }
        }
        document.part().line("RMS over the last half; peak and roughness (the scatter from sample to sample) in widths of the declared ranges; settling within 5 % of them");
        document
    }

    fn to_json(&self) -> Value {
        Self::to_json(self)
    }

    fn is_positive(&self) -> bool {
        Self::is_positive(self)
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.picture().to_svg().map(Some)
    }

    fn warnings(&self) -> &[String] {
        Self::warnings(self)
    }
}

impl Comparison {
    fn runs(&self) -> impl Iterator<Item = (&'static str, &Run)> {
        let rows = self.rows.iter();
        rows.filter_map(|row| Some((row.family, row.run.as_ref().ok()?)))
    }

    fn table(&self) -> Table {
        let first = self.runs().next();
        let settled = first.map_or(&[][..], |(_, run)| &run.settled);
        let names: Vec<&str> = settled
            .iter()
            .map(|s| s.quantity.as_str())
            .take(SHOWN)
            .collect();
        let errors = names.iter().map(|name| format!("RMS {name}"));
        let others = ["peak", "settling", "roughness", "µs/sample"].map(str::to_owned);
        let titles = std::iter::once("family".to_owned())
            .chain(errors)
            .chain(others);
        let rows = self.runs().map(|(family, run)| {
            let rms = names.iter().map(|name| {
                let settled = run.settled.iter().find(|s| s.quantity == *name);
                settled.and_then(|s| s.rms)
            });
            let judged = rms.chain([run.peak, run.settling, run.roughness]);
            let judged = judged.map(|x| Cell::number(x, |x| figures(x, 3)));
            let cost = Cell::Number(figures(1e6 * run.per_sample, 2));
            std::iter::once(family.into())
                .chain(judged)
                .chain([cost])
                .collect()
        });
        Table::new(titles).with(rows)
    }
}
