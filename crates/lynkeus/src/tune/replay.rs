//! One value on a log: how well held-out samples are predicted, and how white the innovation is.

use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::{Design, Observer};
use lynkeus_run::{BetweenSamples, EstimatorSettings, Log, System, Trajectory, estimate_watched};

use super::errors::{Errors, rms};
use super::holdout::{HELD_OUT, Plan, predicted, switchable};
use super::speed::longest_step;
use super::trial::{is_answer, thrifty};
use super::whiteness::{Whiteness, whiteness};
use super::{Row, measures};
use crate::columns::{refuse_stray_columns, signal};
use crate::crew::{Watch, part};
use crate::estimate::{refuse_derivatives, run_settings};
use crate::headers::{refuse_seconds, time_of};
use crate::outcome::interrupted_on;
use crate::prepare::Prepared;
use crate::systems::{self, Reported};
use crate::{Error, Study, Table};

/// Judges the tuning of a study on a log; an estimate that diverges is a row without figures.
///
/// # Errors
/// A study or a log that cannot be used.
pub(super) fn logged(
    prepared: &Prepared<'_>,
    design: &Design,
    table: &Table,
    mut row: Row,
    watch: &mut Watch<'_>,
) -> Result<Row, Error> {
    let replay = Replay::new(prepared.study(), prepared.plant(), design, table)?;
    match replay.judge(&mut row, watch)? {
        None => Ok(row),
        Some(reason) => Ok(row.failed(reason)),
    }
}

/// One value on a log.
struct Replay<'a> {
    switchable: Observer,
    /// the same, compiled
    observer: System,
    time: Vec<f64>,
    names: Vec<String>,
    columns: Vec<Vec<f64>>,
    /// values of the measured outputs
    measured: Vec<Vec<f64>>,
    plan: Plan,
    settings: EstimatorSettings,
    file: &'a str,
    /// the file of the study
    study: &'a str,
}

/// A replay, or why its estimate is none.
type Ran = Result<Trajectory, String>;

impl<'a> Replay<'a> {
    fn new(
        study: &'a Study,
        plant: &Plant,
        design: &Design,
        table: &'a Table,
    ) -> Result<Self, Error> {
        let settings = &study.estimate;
        let run = run_settings(settings);
        refuse_derivatives(study, design)?;
        refuse_stray_columns(plant, settings)?;
        let column = |name: &str| signal(table, settings, &design.observer, name)?.held();
        let names = |signals: &[lynkeus_observers::Signal]| -> Vec<String> {
            signals.iter().map(|s| s.name.clone()).collect()
        };
        let measured = names(&design.observer.measured);
        let mut read = names(&design.observer.inputs);
        read.extend(measured.iter().cloned());
        let header_of_time = time_of(table, plant, settings, read.iter().map(String::as_str))?;
        refuse_seconds(study, table, &header_of_time)?;
        let time = table.time(&header_of_time)?.held()?;
        let columns: Result<Vec<_>, Error> = read.iter().map(|n| column(n)).collect();
        let measured: Result<Vec<_>, Error> = measured.iter().map(|n| column(n)).collect();
        let switchable = switchable(plant, &design.observer);
        Ok(Self {
            observer: systems::observer(plant, &switchable)?,
            switchable,
            plan: Plan::new(study, time.len())?,
            names: read,
            columns: columns?,
            measured: measured?,
            settings: EstimatorSettings {
                method: thrifty(run.method, time.len() as f64),
                ..run
            },
            time,
            file: table.file(),
            study: &study.file,
        })
    }

    /// Fills the row in; the reason where a replay failed.
    fn judge(&self, row: &mut Row, watch: &mut Watch<'_>) -> Result<Option<String>, Error> {
        let causal = EstimatorSettings {
            between: BetweenSamples::Hold,
            ..self.settings
        };
        let nothing = vec![0.0; self.time.len()];
        match self.run(nothing, causal, &mut part(watch, 0, 2))? {
            Ok(run) => {
                if let Some(reason) = self.judge_innovation(row, &run) {
                    return Ok(Some(reason));
                }
                row.set(measures::LOG_MARGIN, self.margin(&run));
            }
            Err(reason) => return Ok(Some(reason)),
        }
        let held_out = self.plan.held_out.clone();
        match self.run(held_out, self.settings, &mut part(watch, 1, 2))? {
            Ok(run) => {
                row.set(measures::HELD_OUT_ERROR, self.held_out_error(&run));
                Ok(None)
            }
            Err(reason) => Ok(Some(format!("with samples held out: {reason}"))),
        }
    }

    fn run(
        &self,
        held_out: Vec<f64>,
        settings: EstimatorSettings,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Ran, Error> {
        let mut names = self.names.clone();
        names.push(HELD_OUT.to_owned());
        let mut columns = self.columns.clone();
        columns.push(held_out);
        let log = Log::new(names, self.time.to_vec(), columns)
            .map_err(|error| Error::from_source(error).at(self.file))?;
        match estimate_watched(&self.observer, &log, settings, watch) {
            Ok(estimates) => Ok(Ok(estimates.trajectory)),
            Err(error) if is_answer(&error.error) => Ok(Err(error.error.to_string())),
            Err(error) => Err(interrupted_on(error.error, self.file, self.study)),
        }
    }

    /// What the observer predicts of a measured output.
    fn predicted<'r>(&self, run: &'r Trajectory, place: usize) -> Option<&'r [f64]> {
        let reported = Reported::new(&self.switchable, run);
        predicted(&self.switchable, reported, place)
    }

    /// The root mean square over outputs of each one's error on the scored rows, over the span
    /// of its values on the whole log.
    fn held_out_error(&self, run: &Trajectory) -> Option<f64> {
        let error = |(place, values): (usize, &Vec<f64>)| {
            let prediction = self.predicted(run, place)?;
            let rows = self.plan.scored();
            let errors: Option<Vec<f64>> = rows
                .map(|row| Some(values.get(row)? - prediction.get(row)?))
                .collect();
            Some(rms(&errors?) / span(values))
        };
        let errors: Option<Vec<f64>> = self.measured.iter().enumerate().map(error).collect();
        Some(rms(&errors?))
    }

    /// The innovation of a replay that looks at no later sample, past the first block; the
    /// reason where it shows that the estimate runs away.
    fn judge_innovation(&self, row: &mut Row, run: &Trajectory) -> Option<String> {
        let innovation = |(place, values): (usize, &Vec<f64>)| -> Option<Vec<f64>> {
            let prediction = self.predicted(run, place)?;
            let pairs = values.iter().zip(prediction).skip(self.plan.first);
            // over all rows: not within the loop over them
            let span = span(values);
            Some(pairs.map(|(y, hat)| (y - hat) / span).collect())
        };
        let measured = self.measured.iter().enumerate();
        let innovations = Errors {
            time: self.time.iter().copied().skip(self.plan.first).collect(),
            scaled: measured.filter_map(innovation).collect(),
        };
        let reason = innovations.run_away();
        if reason.is_some() {
            return reason;
        }
        let all = innovations.scaled;
        let sizes: Vec<f64> = all.iter().map(|series| rms(series)).collect();
        row.set(measures::INNOVATION, Some(rms(&sizes)));
        let white: Vec<Whiteness> = all.iter().filter_map(|series| whiteness(series)).collect();
        let mean = |of: fn(&Whiteness) -> f64| {
            let sum: f64 = white.iter().map(of).sum();
            (!white.is_empty()).then(|| sum / white.len() as f64)
        };
        row.set(measures::LJUNG_BOX, mean(|w| w.ljung_box));
        row.set(measures::OUTSIDE_BAND, mean(|w| w.outside));
        None
    }

    /// The longest stable step over the longest step of the log.
    fn margin(&self, run: &Trajectory) -> Option<f64> {
        let names = self.observer.signals().to_vec();
        let place = |name: &String| self.names.iter().position(|n| n == name);
        let places: Vec<Option<usize>> = names.iter().map(place).collect();
        let reported = Reported::new(&self.switchable, run);
        let step = longest_step(
            &self.observer,
            run.times(),
            reported,
            &mut |row, _, signals| {
                for (signal, place) in signals.iter_mut().zip(&places) {
                    let column = place.and_then(|place| self.columns.get(place));
                    // the one signal that is no column is the switch, which is off
                    *signal = column.and_then(|c| c.get(row).copied()).unwrap_or(0.0);
                }
                ControlFlow::Continue(())
            },
        )?;
        let steps = self.time.windows(2).map(|pair| pair[1] - pair[0]);
        let longest = steps.fold(0.0, f64::max);
        (longest > 0.0).then(|| step / longest)
    }
}

/// From the least to the greatest, or the magnitude of a constant, or 1.
fn span(values: &[f64]) -> f64 {
    let low = values.iter().copied().fold(f64::INFINITY, f64::min);
    let high = values.iter().copied().fold(f64::NEG_INFINITY, f64::max);
    match high - low {
        span if span > 0.0 => span,
        _ if high.abs() > 0.0 => high.abs(),
        _ => 1.0,
    }
}
