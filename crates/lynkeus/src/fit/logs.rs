//! The logs of a fit.

use lynkeus_run::filter::Row;

use crate::{Error, Table};
use lynkeus_experiment::course::Samples;
use lynkeus_experiment::course::columns::Log;
use lynkeus_experiment::course::filter::noise;
use lynkeus_experiment::course::run::start_at_readings;
use lynkeus_experiment::prepare::{Prepared, StudyDesign};
use lynkeus_experiment::words::number;

/// A log as a fit reads it.
#[derive(Clone, Debug)]
pub(crate) struct FittedLog {
    /// its file, or what stands for it
    pub place: String,
    pub time: Vec<f64>,
    /// row by row
    readings: Vec<f64>,
    inputs: Vec<f64>,
    /// numbers in a row of each
    widths: [usize; 2],
    /// rows that are fitted; those after them are held out
    pub fitted: usize,
    /// the start of each state
    pub starts: Vec<f64>,
    samples: Samples,
    pub notes: Vec<String>,
    pub warnings: Vec<String>,
}

impl FittedLog {
    /// In one of several logs a sensor may not have reported at all.
    ///
    /// # Errors
    /// Columns that the log does not have, times that are no order, no reading to fit.
    pub fn new(
        prepared: &Prepared<'_>,
        design: &StudyDesign,
        table: &Table,
        is_one_of_several: bool,
    ) -> Result<Self, Error> {
        let log = match is_one_of_several {
            true => Log::one_of(prepared, table)?,
            false => Log::read(prepared, table)?,
        };
        let mut design = design.clone();
        start_at_readings(prepared, &log.samples, &mut design);
        let place = log.table.place();
        // of several logs nobody knows which one is meant
        let named = |all: Vec<String>| match is_one_of_several {
            true => all.iter().map(|told| format!("{place}: {told}")).collect(),
            false => all,
        };
        let samples = log.samples;
        let time = samples.time.to_vec();
        let widths = [samples.readings.len(), samples.inputs.len()];
        let (mut readings, mut inputs) = (vec![], vec![]);
        let mut rows = samples.rows_from(0);
        let mut row = vec![f64::NAN; widths[0] + widths[1]];
        while rows.next(&mut row).is_some() {
            readings.extend_from_slice(&row[..widths[0]]);
            inputs.extend_from_slice(&row[widths[0]..]);
        }
        drop(rows);
        let fitted = match prepared.study().fit.held_out {
            None => time.len(),
            Some(share) => {
                let from = time.first().copied().unwrap_or(0.0);
                let until = from + (1.0 - share) * samples.span();
                time.partition_point(|t| *t <= until)
            }
        };
        let fitted_readings = &readings[..fitted * widths[0]];
        if !fitted_readings.iter().any(|y| y.is_finite()) {
            return Err(
                Error::input("no sensor reports in any row that is fitted").at(log.table.place())
            );
        }
        Ok(Self {
            place: log.table.place(),
            time,
            readings,
            inputs,
            widths,
            fitted,
            starts: design
                .observer
                .states
                .iter()
                .map(|(_, start)| *start)
                .collect(),
            samples,
            notes: named(log.notes),
            warnings: named(log.warnings),
        })
    }

    /// From the first time to the last.
    pub fn span(&self) -> f64 {
        self.samples.span()
    }

    /// How much the readings of a sensor scatter.
    pub fn scatter(&self, sensor: usize) -> Option<f64> {
        noise::scatter(&self.samples.time, self.samples.readings.get(sensor)?, 0)
    }

    /// So many of the first rows.
    pub fn rows(&self, count: usize) -> impl Iterator<Item = Row<'_>> {
        let [outputs, inputs] = self.widths;
        let time = self.time.iter().take(count).enumerate();
        time.map(move |(k, &t)| Row {
            t,
            readings: &self.readings[k * outputs..(k + 1) * outputs],
            inputs: &self.inputs[k * inputs..(k + 1) * inputs],
        })
    }

    /// The usual time between two rows.
    pub fn interval(&self) -> f64 {
        let mut steps: Vec<f64> = self.time.windows(2).map(|pair| pair[1] - pair[0]).collect();
        steps.retain(|step| *step > 0.0);
        let middle = steps.len() / 2;
        match steps.is_empty() {
            true => 1.0,
            false => *steps.select_nth_unstable_by(middle, f64::total_cmp).1,
        }
    }

    /// What is to be said of steps that are too many, where two rows are as far apart as if they were of two logs.
    pub fn gap(&self) -> Option<Error> {
        let interval = self.interval();
        let mut pairs = self.time.windows(2);
        let gap = pairs.find(|pair| pair[1] - pair[0] > FARTHEST * interval)?;
        let message = format!(
            "no row between {} and {}, {:.1e} times the usual {}",
            number(gap[0]),
            number(gap[1]),
            (gap[1] - gap[0]) / interval,
            number(interval)
        );
        let hint = "give what is before and after as two logs: each has a start of its own";
        Some(Error::input(message).at(&self.place).hint(hint))
    }
}

/// Usual intervals between two rows beyond which they are of two logs.
const FARTHEST: f64 = 1e6;
