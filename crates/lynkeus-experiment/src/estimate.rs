//! A log through the study's observer.

mod followed;
pub(crate) mod live;
pub mod stream;
mod suspected;
mod told;

use std::ops::ControlFlow;

use lynkeus_observers::{Design, Observer, Signal};
use lynkeus_run::Fleet;

use crate::course::checkpoint::Checkpoint;
use crate::course::columns::{self, Log};
use crate::course::ended::{is_observers_answer, settle};
use crate::course::fixed_steps::unlocated;
use crate::course::inputs::{are_logged, supplied};
use crate::course::replay::{Watch, refuse_smoothing};
use crate::course::run::{refuse_settings, start_at_readings};
use crate::course::{Course, Samples, filter};
use crate::crew::within;
use crate::estimate::followed::followed;
use crate::estimate::suspected::suspected;
use crate::judge::frozen::{Channel, Frozen, frozen};
use crate::judge::interval;
use crate::judge::outcome::{Raw, measurements};
use crate::prepare::systems::{method, run_settings};
use crate::prepare::{self, Prepared, StudyDesign};
use crate::{Error, Origin, Outcome, Quantity, Series, Study, Table};
use lynkeus_study::{BetweenSamples, Method};

/// Replays a log; `watch` is told the fraction done and may stop the replay.
///
/// # Errors
/// A study that does not fit the plant, a log without the columns that the
/// observer reads, conditions that are refuted, an estimate that has no first row. One that is
/// not credible, or ends early, is a result: [`Outcome::refusal`].
pub fn estimate(
    study: &Study,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    let plant = prepare::plant(study)?;
    let prepared = Prepared::new(study, &plant)?;
    looked_at(&prepared, prepared.design()?, table, Watch::only(watch))
}

/// The same with a checkpoint: where this file holds the beginning of the same replay, it goes on
/// from there, and its result is the same to the last bit.
///
/// # Errors
/// As [`estimate`]; a checkpoint of another study or log, a file that is none or cannot be
/// written, and a study that smooths.
pub fn estimate_resumed(
    study: &Study,
    table: &Table,
    checkpoint: &mut Checkpoint,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    refuse_smoothing(study)?;
    let plant = prepare::plant(study)?;
    let watch = Watch {
        watch,
        checkpoint: Some(checkpoint),
    };
    let prepared = Prepared::new(study, &plant)?;
    looked_at(&prepared, prepared.design()?, table, watch)
}

/// The replay of a study that is prepared.
pub fn estimated(
    prepared: &Prepared<'_>,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    with_design(prepared, prepared.design()?, table, watch)
}

/// The same by the observer that was designed for the study.
pub(crate) fn with_design(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    watched(prepared, design, table, Watch::only(watch))
}

fn watched(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    table: &Table,
    watch: Watch<'_>,
) -> Result<Outcome, Error> {
    let begun = Begun::new(prepared, design, table)?;
    let course = begun.course(prepared, watch)?;
    begun.finish(prepared, course)
}

/// The same for somebody who looks at the result: a column that seems to be another quantity is named.
pub(crate) fn looked_at(
    prepared: &Prepared<'_>,
    design: StudyDesign,
    table: &Table,
    watch: Watch<'_>,
) -> Result<Outcome, Error> {
    let begun = Begun::new(prepared, design, table)?;
    let mut course = begun.course(prepared, watch)?;
    let suspicion = suspected(prepared, &begun.design, &begun.log.samples, &course);
    course.doubts.extend(suspicion);
    begun.finish(prepared, course)
}

/// How many logs of a study are best estimated [together](crate::Runner::estimate_together).
pub fn side_by_side(study: &Study) -> usize {
    let settings = &study.estimate;
    let mut families = study.observer.families();
    let is_done = families.all(|family| family.is_filter())
        && matches!(settings.method, Method::Rk4(_))
        && settings.between_samples == BetweenSamples::Hold
        && settings.smoothing.is_none();
    if is_done { Fleet::width() } else { 1 }
}

/// Several logs by the observer that was designed for their study, side by side where that gives what each gives
/// alone, else one after the other.
pub(crate) fn together(
    prepared: &Prepared<'_>,
    design: &StudyDesign,
    tables: &[&Table],
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Vec<Result<Outcome, Error>> {
    if let Some(found) = in_lanes(prepared, design, tables, watch) {
        return found;
    }
    let count = tables.len() as f64;
    let alone = tables.iter().enumerate().map(|(place, table)| {
        let watch = &mut |done| watch((place as f64 + done) / count);
        with_design(prepared, design.clone(), table, watch)
    });
    alone.collect()
}

/// None where they are to be done one after the other.
pub(crate) fn in_lanes(
    prepared: &Prepared<'_>,
    design: &StudyDesign,
    tables: &[&Table],
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Option<Vec<Result<Outcome, Error>>> {
    let study = prepared.study();
    if tables.len() < 2 || side_by_side(study) == 1 || refuse_settings(prepared, design).is_err() {
        return None;
    }
    let begun = tables.iter();
    let begun = begun.map(|table| Begun::new(prepared, design.clone(), table));
    let begun: Vec<Result<Begun<'_>, Error>> = begun.collect();
    let runs = begun.iter().flatten();
    let runs: Vec<(&Design, &Samples)> = runs.map(|b| (&*b.design, &b.log.samples)).collect();
    let told = &mut within(&study.budget, watch);
    let courses = filter::together(prepared, &runs, run_settings(&study.estimate), told)?;
    let mut courses = courses.into_iter();
    let finished = begun.into_iter().map(|begun| {
        let begun = begun?;
        // one for each that has begun
        let course = courses.next().unwrap_or_else(|| Ok(Course::default()))?;
        begun.finish(prepared, course)
    });
    Some(finished.collect())
}

/// A log that is read, and the observer that begins at it.
struct Begun<'t> {
    design: StudyDesign,
    log: Log<'t>,
}

impl<'t> Begun<'t> {
    fn new(
        prepared: &Prepared<'_>,
        mut design: StudyDesign,
        table: &'t Table,
    ) -> Result<Self, Error> {
        let sources = supplied(prepared, &mut design)?;
        let mut log = Log::read(prepared, table)?;
        if !are_logged(prepared, &sources) {
            log.samples.inputs = log.inputs(prepared, &sources)?;
        }
        start_at_readings(prepared, &log.samples, &mut design);
        Ok(Self { design, log })
    }

    fn course(&self, prepared: &Prepared<'_>, watch: Watch<'_>) -> Result<Course, Error> {
        let run = run_settings(&prepared.study().estimate);
        followed(prepared, &self.design, &self.log.samples, run, watch)
    }

    /// What the course of its observer comes to.
    fn finish(self, prepared: &Prepared<'_>, mut course: Course) -> Result<Outcome, Error> {
        let Self { design, log } = self;
        let (study, samples) = (prepared.study(), &log.samples);
        let settings = &study.estimate;
        let done = |course: &Course| course.estimates.first().map_or(0, Series::len);
        let all = done(&course);
        settle(
            &mut course,
            all,
            study,
            &log.table.place(),
            is_observers_answer,
        )?;
        let intervals = interval::intervals(prepared, &design, samples, &course);
        if let Some(among) = &log.interleaved {
            among.thin(&mut course);
        }
        let rows = done(&course);
        let logged = |name: &str| {
            let values = columns::logged(&log.table, settings, &log.time, name)?;
            Some(values.shortened(rows))
        };
        // cells that are no readings show nothing, and late ones stand where their samples were taken
        let counted = |name: &str| {
            let declared = prepared.declared();
            let is_screened = declared.screens.of(name).is_some();
            if !is_screened && declared.late.of(name).is_none() {
                return None;
            }
            let mut outputs = prepared.augmented().outputs.iter();
            let place = outputs.position(|output| output.variable.name == name)?;
            Some(log.own(samples.readings.get(place)?).shortened(rows))
        };
        let estimated = design.observer.estimates.iter().enumerate();
        let estimated = estimated.map(|(i, e)| {
            let mut quantity = Quantity {
                name: e.variable.name.clone(),
                unit: e.variable.unit.clone(),
                description: e.variable.description.clone(),
                truth: columns::truth(prepared, &log, &e.variable.name).map(|x| x.shortened(rows)),
                unknown_input: e.unknown_input,
                is_input: e.unknown_input,
                ..Quantity::default()
            };
            course.give(i, settings.deviations, &mut quantity);
            quantity
        });
        let estimated: Vec<Quantity> = estimated.collect();
        let known = prepared.augmented().inputs.iter();
        let known = known.map(|input| Quantity {
            name: input.name.clone(),
            truth: logged(&input.name),
            is_input: true,
            ..Quantity::default()
        });
        let mut notes = design.notes.clone();
        notes.extend_from_slice(&log.notes);
        course.warnings.extend_from_slice(&log.warnings);
        notes.extend(unlocated(prepared.plant(), method(&settings.method)));
        let raw = Raw {
            intervals,
            frozen: hanging(prepared, &design.observer, samples),
            time: log.own(&samples.time).shortened(rows),
            origin: log.table.start(&log.time).map(|instant| Origin {
                instant,
                unit: settings.log.seconds(),
            }),
            quantities: estimated.into_iter().chain(known).collect(),
            measurements: measurements(&design, |signal| {
                counted(&signal.name).or_else(|| logged(&signal.name))
            }),
            replayed: true,
            notes,
            course,
            prepared,
            design,
        };
        raw.finish()
    }
}

/// Where the sensors that an observer reads hang.
fn hanging(prepared: &Prepared<'_>, observer: &Observer, samples: &Samples) -> Vec<Frozen> {
    let declared = prepared.declared();
    let sensors = observer.measured.iter().zip(&samples.readings);
    let of = |(signal, readings): (&Signal, &Series)| {
        let limits = declared.limits.of(&signal.name);
        let channel = Channel {
            noise: declared.noise.of(&signal.name).copied(),
            limits: limits.map(|limits| (limits.low, limits.high)),
        };
        frozen(&signal.name, &samples.time, readings, channel)
    };
    sensors.flat_map(of).collect()
}
