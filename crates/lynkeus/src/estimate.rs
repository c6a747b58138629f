//! A log through the study's observer.

pub(crate) mod live;
mod told;

use std::ops::ControlFlow;

use lynkeus_observers::{Design, Observer, Signal};
use lynkeus_run::filter::FilterKind;
use lynkeus_run::{Estimator, EstimatorSettings, Fleet};

use crate::course::checkpoint::Checkpoint;
use crate::course::columns::{self, Log};
use crate::course::fixed_steps::unlocated;
use crate::course::inputs::{are_logged, refuse_strays, supplied};
use crate::course::replay::{Watch, refuse_smoothing, replay};
use crate::course::{Course, Samples};
use crate::crew::within;
use crate::judge::frozen::{Channel, Frozen, frozen};
use crate::judge::outcome::{Raw, is_observers_answer, measurements, settle};
use crate::prepare::systems::{self, method};
use crate::prepare::{Prepared, StudyDesign};
use crate::words::explain;
use crate::{
    Error, Outcome, Quantity, Series, Study, Table, course::filter, course::lines, course::sampled,
    judge::interval, prepare,
};
use lynkeus_study::{BetweenSamples, EstimateSettings, Method, Records};

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
    estimated(&Prepared::new(study, &plant)?, table, watch)
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
    watched(&prepared, prepared.design()?, table, watch)
}

/// The replay of a study that is prepared.
pub(crate) fn estimated(
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
    let study = prepared.study();
    let begun = Begun::new(prepared, design, table)?;
    let (design, samples) = (&begun.design, &begun.log.samples);
    let run = run_settings(&study.estimate);
    let is_judged_beside = is_judged_beside(study, design);
    let share = if is_judged_beside { 0.5 } else { 1.0 };
    let mut told = within(&study.budget, watch.watch);
    let mut checkpoint = watch.checkpoint;
    let own = &mut Watch {
        watch: &mut |done| told(share * done),
        checkpoint: checkpoint.as_deref_mut(),
    };
    let mut course = course_of(prepared, design, samples, run, own)?;
    if is_judged_beside && course.ended.is_none() {
        let beside = &mut Watch {
            watch: &mut |done| told(share * (1.0 + done)),
            checkpoint: checkpoint.map(Checkpoint::beside),
        };
        sampled::judge(prepared, design, samples, run, beside, &mut course)?;
    }
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

    /// What the course of its observer comes to.
    fn finish(self, prepared: &Prepared<'_>, mut course: Course) -> Result<Outcome, Error> {
        let Self { design, log } = self;
        let (study, samples) = (prepared.study(), &log.samples);
        let settings = &study.estimate;
        let rows = course.estimates.first().map_or(0, Series::len);
        settle(
            &mut course,
            rows,
            study,
            &log.table.place(),
            is_observers_answer,
        )?;
        let intervals = interval::intervals(prepared, &design, samples, &course);
        let logged = |name: &str| {
            let values = columns::logged(&log.table, settings, &log.time, name)?;
            Some(values.shortened(rows))
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
            time: samples.time.shortened(rows),
            origin: log.table.start(&log.time),
            quantities: estimated.into_iter().chain(known).collect(),
            measurements: measurements(&design, |signal| logged(&signal.name)),
            replayed: true,
            notes,
            course,
            prepared,
            design,
        };
        raw.finish()
    }
}

/// Whether readings have noises to be judged by, and the run itself follows no error.
fn is_judged_beside(study: &Study, design: &Design) -> bool {
    let is_followed = design.observer.filter.is_some() || study.estimate.follows_errors();
    !is_followed && !study.sensors.noise.is_empty()
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

/// A measured state for which neither the study nor the model says where it starts: it begins at
/// its sensor's first reading, (reading − offset)/slope.
pub(crate) struct AtReading {
    /// place among the states
    pub state: usize,
    /// place among the measured outputs
    pub sensor: usize,
    pub slope: f64,
    pub offset: f64,
}

/// The states that start at a reading.
pub(crate) fn at_readings(prepared: &Prepared<'_>) -> Vec<AtReading> {
    let augmented = prepared.augmented();
    let initial = &prepared.study().observer.tuning.initial;
    let number = |node| augmented.graph().constant_value(node);
    let of = |(sensor, output): (usize, &lynkeus_structure::Measurement)| {
        let (i, slope, offset) = output.state?;
        let state = &augmented.states[i];
        let given = initial.of(&state.name).or(initial.default);
        let (slope, offset) = (number(slope)?, number(offset)?);
        given.or(state.start).is_none().then_some(AtReading {
            state: i,
            sensor,
            slope,
            offset,
        })
    };
    augmented
        .outputs
        .iter()
        .enumerate()
        .filter_map(of)
        .collect()
}

/// Lets them start at the first readings of a log.
pub(crate) fn start_at_readings(
    prepared: &Prepared<'_>,
    samples: &Samples,
    design: &mut StudyDesign,
) {
    for at in at_readings(prepared) {
        let readings = samples.readings.get(at.sensor);
        let Some(y) = readings.and_then(|r| r.iter().find(|y| y.is_finite())) else {
            continue;
        };
        let start = (y - at.offset) / at.slope;
        let own = design.observer.states.get_mut(at.state);
        if let (true, Some(own)) = (start.is_finite(), own) {
            own.1 = start;
            design.notes.push(format!(
                "{} starts at its first reading, {}: neither `initial` nor the model's `start` says where",
                prepared.augmented().states[at.state].name,
                lynkeus_words::short(start)
            ));
        }
    }
}

/// The observer's run over samples: a filter takes readings when they are there; an observer
/// whose correction is in its flow needs a stand-in for those that are not.
pub(crate) fn course(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Course, Error> {
    let run = run_settings(&prepared.study().estimate);
    course_of(prepared, design, samples, run, &mut Watch::only(watch))
}

/// What the study asks of an observer that it cannot give.
pub(crate) fn refuse_settings(prepared: &Prepared<'_>, design: &Design) -> Result<(), Error> {
    refuse_strays(prepared)?;
    let study = prepared.study();
    let Some(filter) = &design.observer.filter else {
        if study.records != Records::Nothing {
            let message = format!(
                "record: expected a filter (\"ekf\", \"ukf\" or \"mhe\"), found the {} observer, which has neither innovation covariances nor a likelihood",
                design.examination.family
            );
            return Err(Error::input(message).at(&study.file));
        }
        return match study.estimate.smoothing {
            Some(_) => Err(Error::input("`smooth` and `lag` of [estimate] need a filter (\"ekf\", \"ukf\" or \"mhe\"): this observer has no covariance to smooth with").at(&study.file)),
            None => Ok(()),
        };
    };
    if let FilterKind::Unscented(points) = &filter.kind {
        let states = design.observer.states.len();
        points.weights(states).map_err(explain)?;
    }
    filter::refuse_longer_lag(study, &filter.kind)
}

/// The same with other limits of the method.
pub(crate) fn course_of(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let study = prepared.study();
    let settings = &study.estimate;
    refuse_settings(prepared, design)?;
    if design.observer.filter.is_some() {
        return filter::run(prepared, design, samples, run, watch);
    }
    let is_linear = settings.between_samples == BetweenSamples::Linear;
    if is_linear && samples.have_gaps() && !settings.follows_errors() {
        return across_gaps(prepared, design, samples, run, watch);
    }
    let stands_in = samples.have_gaps() || settings.follows_errors();
    if stands_in || settings.between_samples == BetweenSamples::Predict {
        let mut course = sampled::run(prepared, design, samples, run.method, watch)?;
        if is_linear {
            let key = match settings.deviations {
                true => "sd",
                false => "innovations",
            };
            course.notes.push(format!("with `{key}` the measurements are held between samples, not linear: standard deviations are those of a causal observer"));
        }
        return Ok(course);
    }
    plain(prepared, design, samples, run, watch)
}

/// Lines between the samples reach across those that are missing.
fn across_gaps(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let filled = |columns: &[Series]| -> Vec<Series> {
        let time = &samples.time;
        columns.iter().map(|c| lines::between(time, c)).collect()
    };
    let whole = Samples {
        time: samples.time.clone(),
        readings: filled(&samples.readings),
        inputs: filled(&samples.inputs),
    };
    let mut course = plain(prepared, design, &whole, run, watch)?;
    course
        .notes
        .push("readings that are missing lie on the line between their neighbours".to_owned());
    Ok(course)
}

fn plain(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let observer = systems::observer(prepared.plant(), &design.observer)?;
    let mut estimator = Estimator::new(&observer, run).map_err(explain)?;
    let mut course = Course::default();
    let count = design.observer.estimates.len();
    replay(&mut estimator, samples, count, &mut course, watch)?;
    if run.between == lynkeus_run::BetweenSamples::Linear {
        course.notes.push(
            "between_samples = \"linear\" looks ahead one sample: the estimate at a row is that of an off-line replay".to_owned(),
        );
    }
    let advice = estimator.advice();
    if let Some(advice) = advice.filter(lynkeus_run::StepAdvice::is_unstable) {
        course.notes.push(format!(
            "the step {} is too long for this observer: its fastest mode needs {:.3e} or less",
            advice.used, advice.needed
        ));
    }
    Ok(course)
}

/// The study's settings as the runner has them.
pub(crate) fn run_settings(settings: &EstimateSettings) -> EstimatorSettings {
    EstimatorSettings {
        between: match settings.between_samples {
            // the inter-sample predictor is not the integrator's business
            BetweenSamples::Hold | BetweenSamples::Predict => lynkeus_run::BetweenSamples::Hold,
            BetweenSamples::Linear => lynkeus_run::BetweenSamples::Linear,
        },
        method: method(&settings.method),
    }
}
