//! A comparison for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_words::figures;
use serde::Serialize;
use serde_json::{Value, json};

use crate::entries::Named;
use crate::tune::Foretold;
use crate::{Answer, Doubt};

use super::{Against, Compared, Comparison, Interval, Run};

/// The answer of `compare`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct ComparisonReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// where the truth comes from
    against: Against,
    /// the samples, in simulation
    sampling: Option<&'a Interval>,
    /// the families
    families: Vec<ComparedEntry<'a>>,
    /// what of the log contradicts itself, or counts nowhere
    warnings: &'a [String],
}

/// A family in a comparison; one that was refused has `family` and `refused` only.
#[derive(Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Compared")
)]
struct ComparedEntry<'a> {
    /// its name
    family: &'static str,
    #[serde(flatten)]
    figures: Option<Figures<'a>>,
    /// why it did not run, where it did not
    #[serde(skip_serializing_if = "Option::is_none")]
    refused: Option<&'a str>,
}

#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct Figures<'a> {
    /// root mean square error of each quantity over the last half of the rows, in its unit
    rms: Named<Option<f64>>,
    /// the largest error after the first row, in widths of the declared ranges
    peak: Option<f64>,
    /// time until every error stays within 5 % of its range; none where it does not
    settling_time: Option<f64>,
    /// scatter of the estimates from sample to sample, in widths of the declared ranges
    roughness: Option<f64>,
    /// how well it foretells the log, where that has no true values
    #[serde(flatten)]
    foretold: Option<&'a Foretold>,
    /// why that is not known, or not of all of the log
    #[serde(skip_serializing_if = "Option::is_none")]
    unforetold: Option<&'a str>,
    /// computing time of a sample, in seconds
    seconds_per_sample: f64,
    /// whether nothing speaks against it
    credible: bool,
    /// what speaks against it
    doubts: &'a [Doubt],
}

impl<'a> From<&'a Compared> for ComparedEntry<'a> {
    fn from(row: &'a Compared) -> Self {
        Self {
            family: row.family,
            figures: row.run.as_ref().ok().map(Figures::from),
            refused: row.run.as_ref().err().map(String::as_str),
        }
    }
}

impl<'a> From<&'a Run> for Figures<'a> {
    fn from(run: &'a Run) -> Self {
        let settled = run.settled.iter();
        Self {
            rms: settled.map(|s| (s.quantity.clone(), s.rms)).collect(),
            peak: run.peak,
            settling_time: run.settling,
            roughness: run.roughness,
            foretold: run.foretold.as_ref(),
            unforetold: run.unforetold.as_deref(),
            seconds_per_sample: run.per_sample,
            credible: run.doubt.is_none(),
            doubts: &run.outcome.doubts,
        }
    }
}

impl Comparison {
    /// For machines.
    #[must_use]
    pub fn entries(&self) -> Value {
        json!(ComparisonReport {
            plant: &self.plant,
            against: self.against,
            sampling: self.interval.as_ref(),
            families: self.rows.iter().map(ComparedEntry::from).collect(),
            warnings: self.warnings(),
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

crate::displayed!(Comparison);

impl Answer for Comparison {
    fn document(&self) -> Document {
        let against = match self.against {
            Against::Simulation => "against the simulated plant",
            Against::Log => "against the columns of the log that are not read",
            Against::Nothing => {
                "the log has no true values: judged by what is foretold of its readings"
            }
        };
        let sampled = self
            .interval
            .as_ref()
            .map(|interval| format!(", {interval}"));
        let sampled = sampled.unwrap_or_default();
        let mut document = Document::new(format!("{}: {against}{sampled}", self.plant));
        let is_known = self.against != Against::Nothing;
        document.part().table(match is_known {
            true => self.table(),
            false => self.foretold(),
        });
        for (family, run) in self.runs() {
            let unforetold = run.unforetold.iter();
            for reason in unforetold.chain(&run.doubt) {
                document.part().line(format!("{family}: {reason}"));
            }
        }
        for row in &self.rows {
            if let Err(reason) = &row.run {
                document.part().line(format!("{}: {reason}", row.family));
            }
        }
        document.part().line(match is_known {
            true => "RMS over the last half; peak and roughness (the scatter from sample to sample) in widths of the declared ranges; settling within 5 % of them",
            false => "\u{2212}log likelihood of filters; errors on samples that are held out, and innovations, in spans of the readings; Ljung\u{2013}Box per lag: 1 where innovations are white, and 0.05 of their autocorrelations are then outside of the band; roughness (the scatter of estimates from sample to sample) in widths of the declared ranges",
        });
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn is_positive(&self) -> bool {
        Self::is_positive(self)
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, crate::Error> {
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

    /// Of a log without true values.
    fn foretold(&self) -> Table {
        let titles = [
            "family",
            "\u{2212}log L/reading",
            "held-out error",
            "innovation",
            "Ljung\u{2013}Box",
            "outside band",
            "roughness",
            "µs/sample",
        ];
        let rows = self.runs().map(|(family, run)| {
            let found = run.foretold.clone().unwrap_or_default();
            let judged = [
                found.held_out_error,
                found.innovation,
                found.ljung_box,
                found.outside_band,
                run.roughness,
            ];
            let judged = judged.map(|x| Cell::number(x, |x| figures(x, 3)));
            // of many readings small differences tell
            let likely = Cell::number(found.nll_per_reading, |x| figures(x, 6));
            [family.into(), likely]
                .into_iter()
                .chain(judged)
                .chain([cost(run)])
                .collect()
        });
        Table::new(titles).with(rows)
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
            std::iter::once(family.into())
                .chain(judged)
                .chain([cost(run)])
                .collect()
        });
        Table::new(titles).with(rows)
    }
}

/// Microseconds of a sample.
fn cost(run: &Run) -> Cell {
    Cell::Number(figures(1e6 * run.per_sample, 2))
}
