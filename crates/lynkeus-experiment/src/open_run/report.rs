//! An open run in words, as JSON and as columns.

use crate::answer::Origin;
use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
#[cfg(feature = "plot")]
use lynkeus_plot::Figure;
use lynkeus_words::{counted, figures};
use serde::Serialize;
use serde_json::{Value, json};

use super::{Misfit, OpenRun, Simulated};
use crate::entries::{Named, finite};
use crate::judge::outcome::Ended;
use crate::{Answer, Error, Series};

/// The answer of `simulate` with `inputs`.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct OpenRunReport<'a> {
    /// the name of the model
    plant: &'a str,
    /// the log whose inputs drive it
    log: &'a str,
    /// number of rows
    rows: usize,
    /// headers of the columns
    columns: Vec<String>,
    /// where each state starts
    #[cfg_attr(feature = "schema", schemars(with = "Named<f64>"))]
    start: Named<Option<f64>>,
    /// errors of each output that the log has readings of
    errors: Named<MisfitEntry<'a>>,
    /// why it ended before its last row, where it did
    ended: Option<&'a Ended>,
    /// what of the log contradicts itself, or counts nowhere
    warnings: &'a [String],
    /// what you should know
    notes: &'a [String],
}

/// An output of the plant alone beside what a log has of it.
#[derive(Debug, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Misfit")
)]
struct MisfitEntry<'a> {
    /// its unit
    unit: Option<&'a str>,
    /// header of the column with reading − output
    column: &'a str,
    /// rows that count
    readings: usize,
    /// rows without a reading
    missing: usize,
    /// readings at an end of their sensor's range, which do not count
    at_ends: usize,
    /// root mean square error, in its unit
    rms: Option<f64>,
    /// mean error, in its unit
    mean: Option<f64>,
    /// 100 (1 − ‖y − ŷ‖/‖y − mean of y‖), in percent; 100 is perfect, 0 no better than the mean of the readings
    fit_percent: Option<f64>,
}

impl OpenRun {
    fn compared(&self) -> impl Iterator<Item = (&Simulated, &Misfit)> {
        let all = self.variables.iter();
        all.filter_map(|variable| Some((variable, variable.misfit.as_ref()?)))
    }

    fn table(&self) -> Table {
        let titles = [
            "output",
            "unit",
            "readings",
            "missing",
            "RMS error",
            "mean error",
            "fit in %",
        ];
        let number = |x: Option<f64>| {
            let dash = || "\u{2013}".to_owned();
            Cell::Number(x.map_or_else(dash, |x| figures(x, 4)))
        };
        let rows = self.compared().map(|(variable, misfit)| {
            let count = |n: usize| Cell::Number(n.to_string());
            vec![
                variable.name.as_str().into(),
                variable.unit.clone().unwrap_or_default().into(),
                count(misfit.counted),
                count(misfit.missing),
                number(misfit.rms),
                number(misfit.mean),
                number(misfit.fit),
            ]
        });
        Table::new(titles).with(rows).dense()
    }
}

crate::displayed!(OpenRun);

impl Answer for OpenRun {
    fn document(&self) -> Document {
        let Self { plant, log, .. } = self;
        let rows = counted(self.time.len(), "row");
        let mut document = Document::new(format!("{plant}: the plant alone on {rows} of {log}"));
        let starts = self.starts.iter();
        let starts: Vec<String> = starts
            .map(|(name, start)| format!("{name} = {}", lynkeus_words::short(*start)))
            .collect();
        document.line(format!("starts at {}", starts.join(", ")));
        if self.compared().next().is_some() {
            document.part().table(self.table());
        }
        let at_ends = self.compared().filter(|(_, misfit)| misfit.at_ends > 0);
        for (variable, misfit) in at_ends {
            document.line(format!(
                "{}: {} at an end of the sensor's range, not counted",
                variable.name,
                counted(misfit.at_ends, "reading")
            ));
        }
        document
    }

    fn entries(&self) -> Value {
        let columns = self.columns().into_iter();
        let errors = self.compared().map(|(variable, misfit)| {
            let entry = MisfitEntry {
                unit: variable.unit.as_deref(),
                column: &misfit.error_header,
                readings: misfit.counted,
                missing: misfit.missing,
                at_ends: misfit.at_ends,
                rms: misfit.rms,
                mean: misfit.mean,
                fit_percent: misfit.fit,
            };
            (variable.name.clone(), entry)
        });
        let starts = self.starts.iter();
        json!(OpenRunReport {
            plant: &self.plant,
            log: &self.log,
            rows: self.time.len(),
            columns: columns.map(|(name, _)| name).collect(),
            start: starts.map(|(name, x)| (name.clone(), finite(*x))).collect(),
            errors: errors.collect(),
            ended: self.ended.as_ref(),
            warnings: &self.warnings,
            notes: &self.notes,
        })
    }

    fn columns(&self) -> Vec<(String, Series)> {
        let own = |v: &Simulated| (v.name.clone(), v.values.clone());
        let error = |(_, m): (&Simulated, &Misfit)| (m.error_header.clone(), m.error.clone());
        std::iter::once((self.time_header.clone(), self.time.clone()))
            .chain(self.variables.iter().map(own))
            .chain(self.compared().map(error))
            .collect()
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.figure()?.to_svg().map(Some)
    }

    #[cfg(feature = "plot")]
    fn panels(&self) -> Result<Option<Figure>, Error> {
        self.figure().map(Some)
    }

    fn origin(&self) -> Option<Origin> {
        self.origin
    }

    fn refusal(&self) -> Option<Error> {
        let ended = self.ended.as_ref()?;
        let rows = counted(self.time.len(), "row");
        let message = format!("{} (the {rows} before are written)", ended.message);
        let refusal = Error::refused(message).at(&ended.file);
        Some(match ended.by_limit {
            true => refusal.as_ended().hint("allow more time or memory"),
            false => refusal,
        })
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }
}
