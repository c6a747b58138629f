//! A comparison for people and machines.

use std::fmt;

use lynkeus_words::figures;
use serde::Serialize;
use serde_json::{Value, json};

use crate::Doubt;
use crate::entries::Named;

use super::{Against, Compared, Comparison, Interval, Run};

/// The answer of `compare`.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
pub(crate) struct ComparisonReport<'a> {
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
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Compared"))]
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
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct Figures<'a> {
    /// root mean square error of each quantity over the last half of the rows, in its unit
    rms: Named<Option<f64>>,
    /// the largest error after the first row, in widths of the declared ranges
    peak: Option<f64>,
    /// time until every error stays within 5 % of its range; none where it does not
    settling_time: Option<f64>,
    /// scatter of the estimates from sample to sample, in widths of the declared ranges
    roughness: Option<f64>,
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
            seconds_per_sample: run.per_sample,
            credible: run.doubt.is_none(),
            doubts: &run.outcome.doubts,
        }
    }
}

impl Comparison {
    /// For machines.
    #[must_use]
    pub fn to_json(&self) -> Value {
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
        let mut runs = self.rows.iter().filter_map(|row| row.run.as_ref().ok());
        runs.next().map_or(&[], |run| &run.outcome.warnings)
    }
}

/// Quantities shown in a table for people.
const SHOWN: usize = 5;

impl fmt::Display for Comparison {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let against = match self.against {
            Against::Simulation => "against the simulated plant",
            Against::Log => "against the columns of the log that are not read",
            Against::Nothing => "the log has no true values",
        };
        write!(f, "{}: {against}", self.plant)?;
        if let Some(interval) = &self.interval {
            write!(f, ", {interval}")?;
        }
        writeln!(f, "\n")?;
        let runs = || {
            self.rows
                .iter()
                .filter_map(|row| Some((row.family, row.run.as_ref().ok()?)))
        };
        let names: Vec<&str> = match runs().next() {
            Some((_, run)) => run
                .settled
                .iter()
                .map(|s| s.quantity.as_str())
                .take(SHOWN)
                .collect(),
            None => vec![],
        };
        let mut table = vec![vec!["family".to_owned()]];
        table[0].extend(names.iter().map(|name| format!("RMS {name}")));
        for title in ["peak", "settling", "roughness", "µs/sample"] {
            table[0].push(title.to_owned());
        }
        for (family, run) in runs() {
            let mut line = vec![family.to_owned()];
            for name in &names {
                let settled = run.settled.iter().find(|s| s.quantity == *name);
                line.push(cell(settled.and_then(|s| s.rms)));
            }
            line.push(cell(run.peak));
            line.push(cell(run.settling));
            line.push(cell(run.roughness));
            line.push(figures(1e6 * run.per_sample, 2));
            table.push(line);
        }
        aligned(f, &table)?;
        for (family, run) in runs() {
            if let Some(doubt) = &run.doubt {
                writeln!(f, "\n{family}: {doubt}")?;
            }
        }
        for row in &self.rows {
            if let Err(reason) = &row.run {
                writeln!(f, "\n{}: {reason}", row.family)?;
            }
        }
        writeln!(
            f,
            "\nRMS over the last half; peak and roughness (the scatter from sample to sample) in widths of the declared ranges; settling within 5 % of them"
        )
    }
}

fn cell(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), |x| figures(x, 3))
}

fn aligned(f: &mut fmt::Formatter<'_>, table: &[Vec<String>]) -> fmt::Result {
    let columns = table.first().map_or(0, Vec::len);
    let width = |j: usize| {
        table
            .iter()
            .map(|row| row[j].chars().count())
            .max()
            .unwrap_or(0)
    };
    let widths: Vec<usize> = (0..columns).map(width).collect();
    for row in table {
        let cells = row.iter().zip(&widths).enumerate();
        for (j, (text, width)) in cells {
            match j {
                0 => write!(f, "{text:<width$}")?,
                _ => write!(f, "  {text:>width$}")?,
            }
        }
        writeln!(f)?;
    }
    Ok(())
}
