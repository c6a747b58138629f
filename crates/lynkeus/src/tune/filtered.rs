//! One value of a filter: the figures of observers, of replays of samples.

use std::ops::ControlFlow;

use lynkeus_expr::{Node, Tape};
use lynkeus_observers::{Design, Observer};
use lynkeus_run::{Column, Role, Simulation};

use super::disturbed::disturbed;
use super::judge::{Judge, Run, Runs, Under};
use super::record::{Record, course};
use super::reference::Reference;
use super::{Row, measures};
use crate::course::recorded::Recorded;
use crate::course::{Course, Samples};
use crate::crew::Watch;
use crate::crew::within;
use crate::prepare::Prepared;
use crate::prepare::systems::settings;
use crate::simulate::{alone, open_loop, seen};
use crate::words::explain;
use crate::{Error, ErrorKind, Series};

/// Samples of a simulation, the same for every position.
#[derive(Debug)]
pub(super) struct Simulated {
    pub reference: Reference,
    exact: Sampled,
    noisy: Sampled,
    /// none where no disturbance is stated; or why the plant has no run under it
    disturbed: Option<Result<Sampled, String>>,
}

/// A run of the plant, and what its sensors show.
#[derive(Debug)]
struct Sampled {
    plant: Recorded,
    samples: Samples,
}

impl Simulated {
    /// Samples every `step`.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn new(prepared: &Prepared<'_>, observer: &Observer, step: f64) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let reference = Reference::new(prepared)?;
        let mut exact = open_loop(study, settings(study)?, plant)?;
        exact.output_step = step;
        exact.noise = reference.exact();
        let noisy = Simulation {
            noise: reference.noise.clone(),
            ..exact.clone()
        };
        let is_disturbed = !study.tune.disturbance.is_empty();
        let disturbed = is_disturbed.then(|| disturbed(study, plant, observer, exact.clone()));
        let exact = sampled(prepared, observer, &exact)?;
        Ok(Self {
            disturbed: disturbed
                .transpose()?
                .map(|run| as_read(sampled(prepared, observer, &run), &exact))
                .transpose()?,
            noisy: sampled(prepared, observer, &noisy)?,
            exact,
            reference,
        })
    }
}

/// The plant alone, and what an observer reads of it.
fn sampled(
    prepared: &Prepared<'_>,
    observer: &Observer,
    simulation: &Simulation,
) -> Result<Sampled, Error> {
    let study = prepared.study();
    let watch = &mut |_| ControlFlow::Continue(());
    let run = alone(study, simulation, &mut within(&study.budget, watch))?;
    Ok(Sampled {
        samples: seen(prepared.plant(), observer, &run),
        plant: run,
    })
}

/// A disturbed run with the inputs as they are read, those of the exact one; why there is none where
/// the plant diverges.
fn as_read(
    disturbed: Result<Sampled, Error>,
    exact: &Sampled,
) -> Result<Result<Sampled, String>, Error> {
    match disturbed {
        Ok(mut disturbed) => {
            disturbed.samples.inputs = exact.samples.inputs.clone();
            Ok(Ok(disturbed))
        }
        Err(error) if error.kind() == ErrorKind::Refused => Ok(Err(error.message().to_owned())),
        Err(error) => Err(error),
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
    let trial = Trial {
        prepared,
        design,
        ground,
    };
    match judge.judge(&mut row, &trial, watch)? {
        None => Ok(row),
        Some(reason) => Ok(row.failed(reason)),
    }
}

/// One value on the samples of the simulation.
struct Trial<'a> {
    prepared: &'a Prepared<'a>,
    design: &'a Design,
    ground: &'a Simulated,
}

impl<'a> Runs for Trial<'a> {
    type Run = Replayed<'a>;

    fn run(
        &self,
        under: Under,
        watch: &mut Watch<'_>,
    ) -> Result<Result<Replayed<'a>, String>, Error> {
        let ground = self.ground;
        let sampled = match (under, &ground.disturbed) {
            (Under::Exact, _) | (Under::Disturbance, None) => &ground.exact,
            (Under::Noise, _) => &ground.noisy,
            (Under::Disturbance, Some(Ok(disturbed))) => disturbed,
            (Under::Disturbance, Some(Err(reason))) => return Ok(Err(reason.clone())),
        };
        let study = self.prepared.study();
        let course = course(
            self.prepared,
            self.design,
            &sampled.samples,
            study.estimate.between_samples,
            &study.file,
            watch,
        )?;
        Ok(course.map(|course| Replayed {
            plant: &sampled.plant,
            course,
        }))
    }

    /// A filter corrects at samples only.
    fn margin(&self, _: &Replayed<'a>) -> Option<f64> {
        None
    }
}

/// Fills in a filter's prediction of held-out samples, which it is not shown; the reason where it
/// has no estimate.
///
/// # Errors
/// A study or a log that cannot be used.
pub(super) fn held_out(
    prepared: &Prepared<'_>,
    design: &Design,
    record: &Record<'_>,
    row: &mut Row,
    watch: &mut Watch<'_>,
) -> Result<Option<String>, Error> {
    let samples = record.left();
    let between = prepared.study().estimate.between_samples;
    let place = record.log.table.place();
    match course(prepared, design, &samples, between, &place, watch)? {
        Err(reason) => Ok(Some(format!("with samples held out: {reason}"))),
        Ok(course) => {
            let predicted = predicted(prepared, design, &samples, &course)?;
            row.set(measures::HELD_OUT_ERROR, record.held_out_error(&predicted));
            Ok(None)
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
    let tape = Tape::new(prepared.augmented().graph(), &symbols, &outputs);
    let tape = tape.map_err(explain)?;
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
