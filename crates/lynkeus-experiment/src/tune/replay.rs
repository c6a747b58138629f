//! One value on a log: how well held-out samples are predicted, and how white the innovation is.

use lynkeus_model::Home;
use lynkeus_run::filter::SensorHealth;

use super::Row;
use super::errors::{rms, run_away};
use super::foretold::Foretold;
use super::holdout::{predicted, switchable};
use super::record::{Record, Replayed, course, span};
use super::speed::longest_step;
use super::whiteness::{Whiteness, whiteness};
use crate::course::inputs::supplied;
use crate::course::run::start_at_readings;
use crate::course::{Course, curved};
use crate::crew::{Watch, part};
use crate::prepare::{Prepared, StudyDesign};
use crate::{Error, Series, prepare::systems};
use lynkeus_table::series::steps;

/// Judges the tuning of an observer or of a filter on a log; an estimate that diverges is a row without figures.
///
/// # Errors
/// A study or a log that cannot be used.
pub(super) fn logged(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    record: &Record<'_>,
    mut row: Row,
    watch: &mut Watch<'_>,
) -> Result<Row, Error> {
    let judged = foretold(prepared, design, record, watch)?;
    let found = judged.foretold;
    let figures = [
        found.nll_per_reading,
        found.held_out_error,
        found.innovation,
        found.ljung_box,
        found.outside_band,
        judged.margin,
    ];
    let own = match record.is_filters {
        true => &figures[..5],
        false => &figures[1..],
    };
    for (measure, figure) in own.iter().enumerate() {
        row.set(measure, *figure);
    }
    row.readings = found.readings;
    row.failure = judged.failure;
    Ok(row)
}

/// What a log says of an estimate.
#[derive(Debug, Default)]
pub(super) struct Judged {
    pub foretold: Foretold,
    /// the longest stable step over the longest of the log; none of filters
    margin: Option<f64>,
    /// why a replay failed
    pub failure: Option<String>,
}

/// Replays a log twice: with all samples, and without those that are held out.
///
/// # Errors
/// A study or a log that cannot be used.
pub(super) fn foretold(
    prepared: &Prepared<'_>,
    mut design: StudyDesign,
    record: &Record<'_>,
    watch: &mut Watch<'_>,
) -> Result<Judged, Error> {
    let sources = supplied(prepared, &mut design)?;
    let record = &record.supplied(prepared, &sources)?;
    start_at_readings(prepared, &record.log.samples, &mut design);
    if !record.is_filters {
        design.observer = switchable(prepared.plant(), &design.observer);
    }
    let replay = Replay {
        prepared,
        design,
        record,
    };
    let mut judged = Judged::default();
    judged.failure = replay.judge(&mut judged, watch)?;
    Ok(judged)
}

/// One value on a log.
struct Replay<'a> {
    prepared: &'a Prepared<'a>,
    /// an observer is switchable
    design: StudyDesign,
    record: &'a Record<'a>,
}

impl Replay<'_> {
    /// Fills in what is judged; the reason where a replay failed.
    fn judge(&self, judged: &mut Judged, watch: &mut Watch<'_>) -> Result<Option<String>, Error> {
        match self.run(&self.record.whole, &mut part(watch, 0, 2))? {
            Ok(run) => {
                if let Some(reason) = self.judge_innovation(&mut judged.foretold, &run) {
                    return Ok(Some(reason));
                }
                match self.record.is_filters {
                    true => judge_likelihood(&mut judged.foretold, &run),
                    false => judged.margin = self.margin(&run)?,
                }
            }
            Err(reason) => return Ok(Some(reason)),
        }
        match self.run(&self.record.parts, &mut part(watch, 1, 2))? {
            Ok(run) => {
                let predicted = self.predicted(&run);
                judged.foretold.held_out_error = self.record.held_out_error(predicted);
                Ok(None)
            }
            Err(reason) => Ok(Some(format!("with samples held out: {reason}"))),
        }
    }

    /// What is expected of each measured output, by row.
    fn predicted<'c>(&self, run: &'c Course) -> &'c [Series] {
        match self.record.is_filters {
            true => &run.predicted,
            false => predicted(&self.design.observer, run),
        }
    }

    fn run(
        &self,
        replayed: &Replayed,
        watch: &mut Watch<'_>,
    ) -> Result<Result<Course, String>, Error> {
        let (samples, between) = (&replayed.samples, replayed.between);
        let place = self.record.log.table.place();
        let course = course(self.prepared, &self.design, samples, between, &place, watch)?;
        Ok(course.map(|mut course| {
            // of an angle the turn in which it is read
            let outputs = self.prepared.augmented().outputs.iter();
            let columns = course.predicted.iter_mut().zip(self.record.readings());
            for ((predicted, readings), output) in columns.zip(outputs) {
                if let Home::Circle { .. } = output.variable.home {
                    *predicted = curved::lifted(predicted, readings);
                }
            }
            course
        }))
    }

    /// The innovation of a replay that looks at no later sample, past the first block, in the
    /// rows with readings; the reason where it shows that the estimate runs away.
    fn judge_innovation(&self, found: &mut Foretold, run: &Course) -> Option<String> {
        let innovation = |(values, prediction): (&Series, &Series)| -> Vec<f64> {
            let pairs = values.iter().zip(prediction).skip(self.record.plan.first);
            // over all rows: not within the loop over them
            let span = span(values);
            let readings = pairs.filter(|(y, _)| y.is_finite());
            readings.map(|(y, hat)| (y - hat) / span).collect()
        };
        let pairs = self.record.readings().iter().zip(self.predicted(run));
        let all: Vec<Vec<f64>> = pairs.map(innovation).filter(|i| !i.is_empty()).collect();
        let reason = run_away(&all);
        if reason.is_some() {
            return reason;
        }
        let sizes: Vec<f64> = all.iter().map(|series| rms(series)).collect();
        found.innovation = Some(rms(&sizes));
        let white: Vec<Whiteness> = all.iter().filter_map(|series| whiteness(series)).collect();
        let mean = |of: fn(&Whiteness) -> f64| {
            let sum: f64 = white.iter().map(of).sum();
            (!white.is_empty()).then(|| sum / white.len() as f64)
        };
        found.ljung_box = mean(|w| w.ljung_box);
        found.outside_band = mean(|w| w.outside);
        None
    }

    /// The longest stable step over the longest step of the log; a prediction stands in for a
    /// reading that is missing.
    fn margin(&self, run: &Course) -> Result<Option<f64>, Error> {
        let observer = &self.design.observer;
        let system = systems::observer(self.prepared.plant(), observer)?;
        let samples = &self.record.whole.samples;
        let predicted = predicted(observer, run);
        let step = longest_step(&system, samples.time.len(), &mut |row, x, signals| {
            for (x, column) in x.iter_mut().zip(&run.monitors) {
                *x = column.get(row)?;
            }
            for (i, (signal, column)) in signals.iter_mut().zip(samples.columns()).enumerate() {
                let value = column.get(row)?;
                *signal = match value.is_finite() {
                    true => value,
                    false => predicted.get(i)?.get(row)?,
                };
            }
            samples.time.get(row)
        });
        let longest = steps(samples.time.iter()).fold(0.0, f64::max);
        Ok(step.filter(|_| longest > 0.0).map(|step| step / longest))
    }
}

/// How likely a filter held the readings that it took, the first among them.
fn judge_likelihood(found: &mut Foretold, run: &Course) {
    let count = |sensor: &SensorHealth| sensor.taken + sensor.at_limit;
    let readings: usize = run.sensors.iter().map(count).sum();
    let mean = -run.log_likelihood / readings as f64;
    found.nll_per_reading = Some(mean).filter(|mean| mean.is_finite());
    found.readings = Some(readings);
}

#[cfg(test)]
mod tests {
    use std::ops::ControlFlow;
    use std::path::Path;

    use lynkeus_run::{BetweenSamples, Estimator, EstimatorSettings};

    use super::*;
    use crate::prepare::systems::run_settings;
    use crate::{Study, Table, prepare};

    /// An estimator that takes the rows one by one knows nothing of gaps, nor of files.
    #[test]
    fn a_log_without_gaps_is_replayed_to_the_bit() {
        let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../examples/two-tanks");
        let study = Study::load(folder.join("study.toml")).unwrap();
        let table = Table::load(folder.join("log.csv")).unwrap();
        let plant = prepare::plant(&study).unwrap();
        let prepared = Prepared::new(&study, &plant).unwrap();
        let record = Record::new(&prepared, &table, false).unwrap();
        let mut design = prepared.design().unwrap();
        design.observer = switchable(&plant, &design.observer);
        let system = systems::observer(&plant, &design.observer).unwrap();
        let replay = Replay {
            prepared: &prepared,
            design,
            record: &record,
        };
        for (replayed, between) in [
            (&record.whole, BetweenSamples::Hold),
            (&record.parts, BetweenSamples::Linear),
        ] {
            let samples = &replayed.samples;
            let settings = EstimatorSettings {
                between,
                ..run_settings(&study.estimate)
            };
            let mut estimator = Estimator::new(&system, settings).unwrap();
            let columns: Vec<Vec<f64>> = samples.columns().map(Series::to_vec).collect();
            let rows = samples.time.to_vec().into_iter().enumerate();
            let expected: Vec<Vec<f64>> = rows
                .map(|(k, t)| {
                    let signals: Vec<f64> = columns.iter().map(|column| column[k]).collect();
                    estimator.push(t, &signals).unwrap().to_vec()
                })
                .collect();
            let watch = &mut |_| ControlFlow::Continue(());
            let run = replay.run(replayed, watch).unwrap().unwrap();
            for (i, column) in run.estimates.iter().chain(&run.monitors).enumerate() {
                let expected: Vec<f64> = expected.iter().map(|row| row[i]).collect();
                assert_eq!(column.to_vec(), expected, "{between:?} {i}");
            }
        }
        let out = record.parts.samples.inputs.last().unwrap().iter();
        assert_eq!(out.sum::<f64>(), record.plan.held_out.iter().sum::<f64>());
    }
}
