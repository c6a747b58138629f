//! The study's observer over samples, whatever kind of observer it is.

use std::ops::ControlFlow;

use lynkeus_observers::Design;
use lynkeus_run::filter::FilterKind;
use lynkeus_run::{Estimator, EstimatorSettings};

use crate::course::inputs::refuse_strays;
use crate::course::replay::{Watch, replay};
use crate::course::{Course, Samples, filter, lines, sampled};
use crate::prepare::systems::{self, run_settings};
use crate::prepare::{Prepared, StudyDesign};
use crate::words::explain;
use crate::{Error, Series};
use lynkeus_study::{BetweenSamples, Records};

/// A measured state for which neither the study nor the model says where it starts: it begins at
/// its sensor's first reading, (reading − offset)/slope.
pub struct AtReading {
    /// place among the states
    pub state: usize,
    /// place among the measured outputs
    pub sensor: usize,
    /// of the reading by the state
    pub slope: f64,
    /// the reading where the state is 0
    pub offset: f64,
}

/// The states that start at a reading.
pub fn at_readings(prepared: &Prepared<'_>) -> Vec<AtReading> {
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
pub fn start_at_readings(prepared: &Prepared<'_>, samples: &Samples, design: &mut StudyDesign) {
    for (state, start) in first_readings(prepared, samples) {
        if let Some(own) = design.observer.states.get_mut(state) {
            own.1 = start;
            design.notes.push(told_start(prepared, state, start));
        }
    }
}

/// The places of these states, each with where the first reading of a log puts it.
pub(crate) fn first_readings(prepared: &Prepared<'_>, samples: &Samples) -> Vec<(usize, f64)> {
    let of = |at: AtReading| {
        let readings = samples.readings.get(at.sensor)?;
        let y = readings.iter().find(|y| y.is_finite())?;
        let start = (y - at.offset) / at.slope;
        start.is_finite().then_some((at.state, start))
    };
    at_readings(prepared).into_iter().filter_map(of).collect()
}

/// What is to be said of it.
pub(crate) fn told_start(prepared: &Prepared<'_>, state: usize, start: f64) -> String {
    format!(
        "{} starts at its first reading, {}: neither `initial` nor the model's `start` says where",
        prepared.augmented().states[state].name,
        lynkeus_words::short(start)
    )
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
pub fn refuse_settings(prepared: &Prepared<'_>, design: &Design) -> Result<(), Error> {
    refuse_strays(prepared)?;
    let study = prepared.study();
    let Some(filter) = &design.observer.filter else {
        if study.records != Records::Nothing {
            let message = format!(
                "record: expected a filter (\"ekf\", \"ukf\", \"mhe\" or \"particle\"), found the {} observer, which has neither innovation covariances nor a likelihood",
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
