//! Samples through an estimator, row by row, whatever kind of observer it is.

use std::ops::ControlFlow;

use lynkeus_run::filter::{Innovation, Reading, Row, SensorHealth};
use lynkeus_run::{Error as RunError, Estimator, Fleet};

use crate::course::checkpoint::{Checkpoint, Halfway};
use crate::course::corrections::Corrections;
use crate::course::trace::Trace;
use crate::course::{Course, Samples, add_row};
use crate::{Error, Study};
use lynkeus_study::Records;

/// Rows between two looks at whether there is room for them.
const LOOK: usize = 1 << 16;

/// Who watches a replay: told the fraction done, and may stop it.
pub(crate) struct Watch<'w> {
    pub watch: &'w mut dyn FnMut(f64) -> ControlFlow<()>,
    /// where the replay goes on after it was killed
    pub checkpoint: Option<&'w mut Checkpoint>,
}

impl<'w> Watch<'w> {
    /// Without a checkpoint.
    pub fn only(watch: &'w mut dyn FnMut(f64) -> ControlFlow<()>) -> Self {
        Self {
            watch,
            checkpoint: None,
        }
    }
}

/// The start is forgotten once the deviation with it is at most so many times that without it: half of
/// what the judge allows a settled innovation.
const FORGOTTEN: f64 = 2.5;

/// Runs an estimator over samples; the first `estimates` of its names are estimates, the rest
/// monitors. What ends the run early is told in the course.
///
/// # Errors
/// A checkpoint that cannot be used, or no room for the rows.
pub(crate) fn replay(
    estimator: &mut Estimator,
    samples: &Samples,
    estimates: usize,
    course: &mut Course,
    watch: &mut Watch<'_>,
) -> Result<(), Error> {
    let rows = samples.time.len();
    course.monitors = course.columns(estimator.names().len().saturating_sub(estimates));
    let deviations = estimator.deviations().map(<[f64]>::len);
    begin(
        course,
        (estimates, deviations, estimator.innovations().len()),
    );
    if course.keeps_effective && estimator.effective().is_some() {
        course.effective = course.columns(1);
    }
    match course.records {
        Records::Nothing => {}
        Records::Likelihood => course.predicted = course.columns(estimator.sensors()),
        Records::All => course.corrections = Corrections::of(estimator, &course.store),
    }
    let mut half = Halfway::default();
    let first = match &mut watch.checkpoint {
        None => 0,
        Some(checkpoint) => checkpoint.resume(estimator, samples, course, &mut half)?,
    };
    let mut signals = vec![0.0; samples.readings.len() + samples.inputs.len()];
    let mut left = samples.rows_from(first);
    for row in first..rows {
        if row.is_multiple_of(LOOK) {
            course.check()?;
        }
        let Some(time) = left.next(&mut signals) else {
            break;
        };
        if let Err(error) = estimator.push(time, &signals) {
            // a sample that was lost is no fault of the log
            samples.check()?;
            course.ended = Some(error);
            break;
        }
        let (told, monitored) = estimator.estimate().split_at(estimates);
        add_row(&mut course.estimates, told.iter().copied());
        add_row(&mut course.monitors, monitored.iter().copied());
        if let (Some(columns), Some(row)) = (&mut course.deviations, estimator.deviations()) {
            add_row(columns, row.iter().copied());
        }
        judge(course, time, estimator.innovations().iter().copied());
        add_row(&mut course.effective, estimator.effective());
        if let Some(record) = estimator.record() {
            course.log_likelihood += record.log_likelihood;
            add_row(&mut course.predicted, record.predicted.iter().copied());
            if let Some(corrections) = &mut course.corrections {
                corrections.add(record);
            }
        }
        if row == rows / 2 {
            half = Halfway::at(estimator, watch.checkpoint.is_some());
        }
        let stopped = (watch.watch)((row + 1) as f64 / rows as f64).is_break();
        if let Some(checkpoint) = &mut watch.checkpoint
            && (stopped || checkpoint.is_due())
        {
            checkpoint.keep(estimator, course, &half)?;
        }
        if stopped {
            course.ended = Some(RunError::Cancelled { time });
            break;
        }
    }
    if !estimator.innovations().is_empty() {
        end(course, &estimator.health().sensors, &half.sensors);
    }
    Ok(())
}

/// The columns of so many estimates, deviations and sensors.
fn begin(course: &mut Course, (estimates, deviations, sensors): (usize, Option<usize>, usize)) {
    course.estimates = course.columns(estimates);
    course.deviations = deviations.map(|count| course.columns(count));
    course.traces = vec![Trace::default(); sensors];
    course.settled = course.traces.clone();
    if course.keeps_innovations {
        course.innovations = course.columns(2 * sensors);
    }
}

/// Takes what became of the readings of a row.
fn judge(course: &mut Course, time: f64, innovations: impl Iterator<Item = Innovation> + Clone) {
    let traces = course.traces.iter_mut().zip(&mut course.settled);
    for ((trace, settled), innovation) in traces.zip(innovations.clone()) {
        trace.take(
            time,
            innovation.reading,
            innovation.value / innovation.deviation,
        );
        // while the start counts, an innovation says nothing of what is left without it
        if innovation.deviation <= FORGOTTEN * innovation.settled {
            let z = innovation.value / innovation.settled;
            settled.take(time, innovation.reading, z);
        }
    }
    if course.keeps_innovations {
        let kept = innovations.flat_map(|innovation| row_of(&innovation));
        add_row(&mut course.innovations, kept);
    }
}

/// How the readings went, and those of the last half of the rows.
fn end(course: &mut Course, sensors: &[SensorHealth], half: &[SensorHealth]) {
    course.sensors = sensors.to_vec();
    let late = course.sensors.iter().zip(half);
    course.late = late.map(|(all, half)| all.since(half)).collect();
}

/// Runs filters side by side over samples of their own, as [`replay`] each of them.
///
/// # Errors
/// No room for the rows, of the place that is told.
pub(crate) fn replay_together(
    fleet: &mut Fleet,
    samples: &[&Samples],
    courses: &mut [Course],
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Vec<Result<(), Error>> {
    let states = fleet.names().len();
    let longest = samples.iter().map(|s| s.time.len()).max().unwrap_or(0);
    let mut left: Vec<_> = samples.iter().map(|s| s.rows_from(0)).collect();
    let mut signals: Vec<Vec<f64>> = samples
        .iter()
        .map(|s| vec![0.0; s.columns().count()])
        .collect();
    let mut half: Vec<Vec<SensorHealth>> = vec![vec![]; samples.len()];
    let mut found: Vec<Result<(), Error>> = samples.iter().map(|_| Ok(())).collect();
    for (course, samples) in courses.iter_mut().zip(samples) {
        begin(course, (states, Some(states), samples.readings.len()));
    }
    for row in 0..longest {
        let mut times = vec![None; samples.len()];
        for (place, time) in times.iter_mut().enumerate() {
            let course = &mut courses[place];
            if row.is_multiple_of(LOOK) && found[place].is_ok() {
                found[place] = course.check();
            }
            if found[place].is_ok() && course.ended.is_none() {
                *time = left[place].next(&mut signals[place]);
            }
        }
        let rows = times.iter().zip(&signals).zip(samples);
        let rows = rows.map(|((t, signals), samples)| {
            let (readings, inputs) = signals.split_at(samples.readings.len());
            t.map(|t| Row {
                t,
                readings,
                inputs,
            })
        });
        let rows: Vec<Option<Row<'_>>> = rows.collect();
        for (place, error) in fleet.push(&rows) {
            // a sample that was lost is no fault of the log
            found[place] = samples[place].check();
            courses[place].ended = Some(error);
        }
        for (place, time) in times.iter().enumerate() {
            let (Some(time), None) = (time, &courses[place].ended) else {
                continue;
            };
            let course = &mut courses[place];
            add_row(&mut course.estimates, fleet.estimate(place));
            if let Some(columns) = &mut course.deviations {
                add_row(columns, fleet.deviations(place));
            }
            judge(course, *time, fleet.innovations(place));
            if row == samples[place].time.len() / 2 {
                half[place].clone_from(&fleet.health(place).sensors);
            }
        }
        if watch((row + 1) as f64 / longest as f64).is_break() {
            for (course, time) in courses.iter_mut().zip(&times) {
                course.ended = match (course.ended.take(), time) {
                    (None, Some(time)) => Some(RunError::Cancelled { time: *time }),
                    (ended, _) => ended,
                };
            }
            break;
        }
    }
    for (place, course) in courses.iter_mut().enumerate() {
        end(course, &fleet.health(place).sensors, &half[place]);
    }
    found
}

/// An innovation with its standard deviation.
fn row_of(innovation: &Innovation) -> [f64; 2] {
    match innovation.reading {
        Reading::Missing => [f64::NAN; 2],
        _ => [innovation.value, innovation.deviation],
    }
}

/// Later rows would have to be in a checkpoint, too.
pub(crate) fn refuse_smoothing(study: &Study) -> Result<(), Error> {
    match study.estimate.smoothing {
        None => Ok(()),
        Some(_) => Err(Error::input(
            "`smooth` and `lag` of [estimate] look at later rows: such a replay has no checkpoint",
        )
        .at(&study.file)
        .hint("leave --checkpoint out, or smooth in a run of its own")),
    }
}
