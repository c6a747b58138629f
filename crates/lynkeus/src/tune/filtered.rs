//! One position of a filter: the figures of observers, of replays of samples.

use std::ops::ControlFlow;

use lynkeus_expr::{Node, Tape};
use lynkeus_observers::{Design, Observer};
use lynkeus_run::{Column, Noise, Role};

use super::errors::run_away;
use super::judge::{Judge, Run};
use super::record::Record;
use super::reference::Reference;
use super::trial::{is_answer, thrifty};
use super::{Row, measures};
use crate::course::{Course, Samples};
use crate::crew::{Watch, part};
use crate::estimate::{course_of, run_settings, start_at_readings};
use crate::outcome::interrupted;
use crate::prepare::Prepared;
use crate::recorded::Recorded;
use crate::simulate::{alone, open_loop, seen, settings, within};
use crate::{Error, Series, replay};

/// Samples of a simulation, the same for every position.
#[derive(Debug)]
pub(super) struct Simulated {
    pub reference: Reference,
    exact: Sampled,
    noisy: Sampled,
}

/// A run of the plant, and what its sensors show.
#[derive(Debug)]
struct Sampled {
    plant: Recorded,
    samples: Samples,
}

impl Simulated {
    /// Samples every `step`, without noise and with it.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn new(prepared: &Prepared<'_>, observer: &Observer, step: f64) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let reference = Reference::new(prepared)?;
        let sampled = |noise: Noise| -> Result<Sampled, Error> {
            let mut simulation = open_loop(study, settings(study)?, plant)?;
            simulation.output_step = step;
            simulation.noise = noise;
            let watch = &mut |_| ControlFlow::Continue(());
            let run = alone(study, &simulation, &mut within(&study.budget, watch))?;
            Ok(Sampled {
                samples: seen(plant, observer, &run),
                plant: run,
            })
        };
        Ok(Self {
            exact: sampled(reference.exact())?,
            noisy: sampled(reference.noise.clone())?,
            reference,
        })
    }
}

/// Samples and what a filter makes of them.
struct Replayed<'a> {
    plant: &'a Recorded,
    course: Course,
}

impl Run for Replayed<'_> {
    fn times(&self) -> Vec<f64> {
        self.plant.time.to_vec()
    }

    fn column(&self, column: Column) -> Option<Vec<f64>> {
        let series = match column.role {
            Role::Estimate => self.course.estimates.get(column.index),
            _ => self.plant.column(column),
        };
        series.map(Series::to_vec)
    }
}

/// Judges a filter in simulation as [`trial`](super::trial) judges observers.
///
/// # Errors
/// Noises that do not fit.
pub(super) fn simulated(
    prepared: &Prepared<'_>,
    design: &Design,
    ground: &Simulated,
    mut row: Row,
    watch: &mut Watch<'_>,
) -> Result<Row, Error> {
    let judge = Judge {
        study: prepared.study(),
        plant: prepared.plant(),
        observer: design.observer.clone(),
        reference: &ground.reference,
    };
    let replayed = |sampled, watch: &mut Watch<'_>| replayed(prepared, design, sampled, watch);
    let exact_run = match replayed(&ground.exact, &mut part(watch, 0, 2))? {
        Ok(run) => run,
        Err(reason) => return Ok(row.failed(reason)),
    };
    let exact = judge.errors(&exact_run);
    if let Some(reason) = run_away(&exact.scaled) {
        return Ok(row.failed(reason));
    }
    judge.exact(&mut row, &exact, &exact_run);
    match replayed(&ground.noisy, &mut part(watch, 1, 2))? {
        Ok(run) => judge.noisy(&mut row, &exact, &run),
        Err(reason) => return Ok(row.failed(format!("with noise: {reason}"))),
    }
    Ok(row)
}

fn replayed<'s>(
    prepared: &Prepared<'_>,
    design: &Design,
    sampled: &'s Sampled,
    watch: &mut Watch<'_>,
) -> Result<Result<Replayed<'s>, String>, Error> {
    let course = course(prepared, design, &sampled.samples, watch)?;
    Ok(course.map(|course| Replayed {
        plant: &sampled.plant,
        course,
    }))
}

/// The filter over samples, or why its estimate is none.
fn course(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    watch: &mut Watch<'_>,
) -> Result<Result<Course, String>, Error> {
    let mut study = prepared.study().clone();
    study.estimate.smoothing = None;
    let prepared = prepared.run_by(&study);
    let mut run = run_settings(&study.estimate);
    run.method = thrifty(run.method, samples.time.len() as f64);
    let watch = &mut replay::Watch::only(watch);
    let mut course = course_of(&prepared, design, samples, run, watch)?;
    course.check()?;
    match course.ended.take() {
        None => Ok(Ok(course)),
        Some(error) if is_answer(&error) => Ok(Err(error.to_string())),
        Some(error) => Err(interrupted(error, &study.file)),
    }
}

/// Judges a filter on a log by its prediction of held-out samples: it is not shown them.
///
/// # Errors
/// A study or a log that cannot be used.
pub(super) fn logged(
    prepared: &Prepared<'_>,
    mut design: Design,
    record: &Record<'_>,
    mut row: Row,
    watch: &mut Watch<'_>,
) -> Result<Row, Error> {
    start_at_readings(prepared, &record.log.samples, &mut design);
    let samples = record.left();
    match course(prepared, &design, &samples, watch)? {
        Err(reason) => Ok(row.failed(format!("with samples held out: {reason}"))),
        Ok(course) => {
            let predicted = predicted(prepared, &design, &samples, &course)?;
            row.set(measures::HELD_OUT_ERROR, record.held_out_error(&predicted));
            Ok(row)
        }
    }
}

/// h at the estimates, by measured output; where a sample is not shown these are predictions.
fn predicted(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    course: &Course,
) -> Result<Vec<Series>, Error> {
    let observer = &design.observer;
    let outputs = observer.filter.iter().flat_map(|filter| &filter.outputs);
    let outputs: Vec<Node> = outputs.copied().collect();
    let states = observer.states.iter().map(|(signal, _)| signal.symbol);
    let inputs = observer.inputs.iter().map(|signal| signal.symbol);
    let symbols = std::iter::once(observer.time).chain(states).chain(inputs);
    let symbols: Vec<Node> = symbols.collect();
    let tape = Tape::new(prepared.extended().graph(), &symbols, &outputs);
    let tape = tape.map_err(Error::from_source)?;
    let mut evaluator = tape.evaluator();
    let columns = std::iter::once(&samples.time)
        .chain(&course.estimates)
        .chain(&samples.inputs);
    let mut columns: Vec<_> = columns.map(Series::iter).collect();
    let mut found = course.columns(outputs.len());
    let mut y = vec![0.0; outputs.len()];
    for _ in 0..samples.time.len() {
        let values = columns.iter_mut().map(|c| c.next().unwrap_or(f64::NAN));
        evaluator.eval(&values.collect::<Vec<f64>>(), &mut y);
        crate::course::add_row(&mut found, y.iter().copied());
    }
    Ok(found)
}
