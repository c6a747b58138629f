//! A sweep in words, as a table and for machines.

use std::fmt;

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_words::counted;
use serde::Serialize;
use serde_json::{Value, json};

use super::axis::shown;
use super::measures::brief;
use super::{Peak, Row, Sweep};
use crate::entries::Named;
use crate::prepare::declared::Account;
use crate::{Answer, Error, Series};
use lynkeus_table::significant;

/// The answer of `tune`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct SweepReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// the log by which it was judged; none in simulation
    log: Option<&'a str>,
    /// the keys that are swept
    keys: Vec<SweptKey<'a>>,
    /// the study's own value of each key
    present: Named<Option<f64>>,
    /// the tuning of the least error; of filters on a log the most likely one
    knee: Option<SweptRow<'a>>,
    /// values of the first key whose error is within 10 % of that, `[smallest, largest]`; of filters on a log
    /// those that are as likely within 95 %: the logarithm of the likelihood is at most 1.92 less
    nearly_as_good: Option<[f64; 2]>,
    /// each tuning
    rows: Vec<SweptRow<'a>>,
    /// what of the study's declarations was counted
    declared: &'a Account,
    /// what you should know
    notes: &'a [String],
}

/// A key that is swept.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SweptKey<'a> {
    /// the key of `[observer]`, or `process_noise.NAME`, `noise.OUTPUT`
    key: &'a str,
    /// whether its values are factors on all numbers of a list, or of a section
    factor: bool,
}

/// A tuning and its figures; errors are shares of the declared ranges.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
struct SweptRow<'a> {
    /// the value of each key that is swept
    keys: Named<f64>,
    /// by the names of the measures
    #[serde(flatten)]
    #[cfg_attr(feature = "schema", schemars(with = "super::measures::Figures"))]
    figures: Named<Option<f64>>,
    /// the largest error, where it is known
    #[serde(skip_serializing_if = "Option::is_none")]
    peak: Option<&'a Peak>,
    /// readings that the likelihood counts; of filters on a log
    #[serde(skip_serializing_if = "Option::is_none")]
    readings: Option<usize>,
    /// why there are no figures
    #[serde(skip_serializing_if = "Option::is_none")]
    failure: Option<&'a str>,
}

impl Sweep {
    /// The rows as CSV: the keys, the figures (empty where there is none), 1 at the knee, and
    /// why a run failed.
    ///
    /// # Errors
    /// What the CSV writer reports.
    pub fn to_csv(&self) -> Result<String, Error> {
        let failed = |e: &dyn fmt::Display| Error::input(format!("cannot write CSV: {e}"));
        let mut writer = csv::Writer::from_writer(vec![]);
        let mut header: Vec<String> = self.axes.iter().map(|a| a.label()).collect();
        header.extend(self.measures.iter().map(|m| m.name.to_owned()));
        header.extend(["knee", "failure"].map(str::to_owned));
        writer.write_record(&header).map_err(|e| failed(&e))?;
        for (i, row) in self.rows.iter().enumerate() {
            let number = |x: Option<f64>| x.map_or(String::new(), significant);
            let mut cells: Vec<String> = row.values.iter().copied().map(shown).collect();
            cells.extend(row.figures.iter().map(|x| number(*x)));
            cells.push(u8::from(self.knee == Some(i)).to_string());
            cells.push(row.failure.clone().unwrap_or_default());
            writer.write_record(&cells).map_err(|e| failed(&e))?;
        }
        let bytes = writer.into_inner().map_err(|e| failed(&e))?;
        Ok(String::from_utf8_lossy(&bytes).into_owned())
    }

    /// The sweep for machines.
    pub fn entries(&self) -> Value {
        let axes = || self.axes.iter();
        json!(SweepReport {
            plant: &self.plant,
            log: self.log.as_deref(),
            keys: axes()
                .map(|axis| SweptKey {
                    key: &axis.key,
                    factor: axis.is_factor,
                })
                .collect(),
            present: axes().map(|a| (a.key.clone(), a.present)).collect(),
            knee: self.chosen().map(|row| self.entry(row)),
            nearly_as_good: self.good().map(|range| [*range.start(), *range.end()]),
            rows: self.rows.iter().map(|row| self.entry(row)).collect(),
            declared: &self.declared,
            notes: &self.notes,
        })
    }

    fn entry<'a>(&self, row: &'a Row) -> SweptRow<'a> {
        let keys = self.axes.iter().zip(&row.values);
        let figures = self.measures.iter().zip(&row.figures);
        SweptRow {
            keys: keys.map(|(axis, x)| (axis.key.clone(), *x)).collect(),
            figures: figures.map(|(m, x)| (m.name.to_owned(), *x)).collect(),
            peak: row.peak.as_ref(),
            readings: row.readings,
            failure: row.failure.as_deref(),
        }
    }

    /// The knee in a sentence.
    pub fn verdict(&self) -> Option<String> {
        let row = self.chosen()?;
        let pairs = self.axes.iter().zip(&row.values);
        let at: Vec<String> = pairs
            .map(|(axis, x)| format!("{} = {}", axis.label(), shown(*x)))
            .collect();
        let decides = self.measures.get(self.objective)?;
        let least = row
            .figure(self.objective)
            .map_or(String::new(), |x| decides.shown(x));
        let mut text = format!("knee: {} ({} {least})", at.join(", "), decides.title);
        let good = self.good().filter(|g| g.start() < g.end());
        if let (Some(good), Some(axis)) = (good, self.axes.first()) {
            let (low, high) = (shown(*good.start()), shown(*good.end()));
            text += &format!(
                "; {} from {} = {low} to {high}",
                self.nearly("it"),
                axis.label()
            );
        }
        if let Some(peak) = &row.peak {
            text += &format!(
                "; its largest error is at t = {}, where {} is estimated at {}",
                brief(peak.time, 3),
                peak.name,
                brief(peak.estimate, 3)
            );
        }
        Some(text)
    }
}

crate::displayed!(Sweep);

impl Answer for Sweep {
    fn document(&self) -> Document {
        let on = self
            .log
            .as_deref()
            .map_or("in simulation".to_owned(), |log| format!("on {log}"));
        let values = counted(self.rows.len(), "value");
        let mut document = Document::new(format!("{}: {values} {on}", self.plant));
        document.part().table(self.table());
        if let Some(verdict) = self.verdict() {
            document.part().line(verdict);
        }
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let whole = |values: &mut dyn Iterator<Item = Option<f64>>| -> Series {
            let values: Vec<f64> = values.map(|x| x.unwrap_or(f64::NAN)).collect();
            values.into()
        };
        let rows = || self.rows.iter();
        let keys = self.axes.iter().enumerate().map(|(place, axis)| {
            let values = whole(&mut rows().map(|row| row.values.get(place).copied()));
            (axis.key.clone(), values)
        });
        let figures = self.measures.iter().enumerate().map(|(place, measure)| {
            (
                measure.name.to_owned(),
                whole(&mut rows().map(|row| row.figure(place))),
            )
        });
        keys.chain(figures).collect()
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.to_svg().map(Some)
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}

impl Sweep {
    fn table(&self) -> Table {
        let keys = self.axes.iter().map(|axis| axis.label());
        let measures = self.measures.iter().map(|m| m.name.replace('_', " "));
        let titles = keys.chain(measures).chain([String::new()]);
        let rows = self.rows.iter().enumerate().map(|(place, row)| {
            let values = row.values.iter().map(|x| Cell::Number(shown(*x)));
            let figures = self.measures.iter().zip(&row.figures);
            let figures = figures.map(|(measure, x)| Cell::number(*x, |x| measure.shown(x)));
            let knee = (self.knee == Some(place)).then(|| "\u{2190} knee".to_owned());
            let failure = row.failure.as_deref().map(shortened);
            let remarks: Vec<String> = knee.into_iter().chain(failure).collect();
            values
                .chain(figures)
                .chain([remarks.join("  ").into()])
                .collect()
        });
        Table::new(titles).with(rows)
    }
}

/// The beginning of a reason, for a line of a table.
pub fn shortened(reason: &str) -> String {
    const MOST: usize = 72;
    let line = reason.lines().next().unwrap_or_default();
    match line.chars().count() > MOST {
        true => line.chars().take(MOST).chain(['\u{2026}']).collect(),
        false => line.to_owned(),
    }
}
