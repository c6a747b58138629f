//! A comparison for people and machines.

use std::fmt;

use lynkeus_words::figures;
use serde_json::{Map, Value, json};

use crate::Doubt;

use super::{Against, Compared, Comparison, Interval};

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
