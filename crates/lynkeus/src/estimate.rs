//! A log through the study's observer.

use std::borrow::Cow;
use std::ops::ControlFlow;

use lynkeus_model::Plant;
use lynkeus_observers::{Design, Observer, Signal};
use lynkeus_run::{Estimator, EstimatorSettings};

use crate::checkpoint::Checkpoint;
use crate::course::{Course, Samples};
use crate::frozen::{Channel, Frozen, frozen};
use crate::headers::time_of;
use crate::outcome::{Raw, measurements, settle};
use crate::prepare::Prepared;
use crate::replay::{Watch, refuse_smoothing, replay};
use crate::simulate::within;
use crate::study::{BetweenSamples, EstimateSettings};
use crate::systems::{self, method};
use crate::{Error, Outcome, Quantity, Study, Table, filter, interval, prepare, sampled};

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
    watched(&Prepared::new(study, &plant)?, table, watch)
}

/// The replay of a study that is prepared.
pub(crate) fn estimated(
    prepared: &Prepared<'_>,
    table: &Table,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Outcome, Error> {
    watched(prepared, table, Watch::only(watch))
}

fn watched(prepared: &Prepared<'_>, table: &Table, watch: Watch<'_>) -> Result<Outcome, Error> {
    let (study, plant) = (prepared.study(), prepared.plant());
    let settings = &study.estimate;
    let mut design = prepared.design()?;
    refuse_derivatives(study, &design)?;
    refuse_stray_columns(plant, settings)?;
    let read = design
        .observer
        .measured
        .iter()
        .chain(&design.observer.inputs);
    let names = read.map(|signal| signal.name.as_str());
    let time_header = time_of(table, plant, settings, names)?;
    let ordered = match settings.strict {
        true => None,
        false => table.in_order(&time_header, settings.late)?,
    };
    let order_notes = ordered.as_ref().map_or(&[][..], |o| &o.notes).to_vec();
    let table = ordered.as_ref().map_or(table, |o| &o.table);
    let signals = Signals::of(table, &time_header, settings, &design.observer)?;
    start_at_readings(prepared, &signals, &mut design);
    // the log, the estimates, and both as the outcome has them
    let read = 1 + signals.readings.len() + signals.inputs.len();
    table.check_room(2 * read + 2 * (1 + design.observer.estimates.len()))?;
    let watch = &mut Watch {
        watch: &mut within(&study.budget, watch.watch),
        checkpoint: watch.checkpoint,
    };
    let mut course = course_of(prepared, &design, &signals.samples(), watch)?;
    let rows = course.estimates.first().map_or(0, Vec::len);
    settle(&mut course, rows, study, table.file())?;
    let intervals = interval::intervals(prepared, &design, &signals.samples(), &course);
    let logged = |name: &str| {
        let values = logged(table, settings, &time_header, name)?;
        Some(values[..rows].to_vec())
    };
    let estimated = design.observer.estimates.iter().enumerate();
    let estimated = estimated.map(|(i, e)| {
        let mut quantity = Quantity {
            name: e.variable.name.clone(),
            unit: e.variable.unit.clone(),
            description: e.variable.description.clone(),
            truth: logged(&e.variable.name),
            unknown_input: e.unknown_input,
            is_input: e.unknown_input,
            ..Quantity::default()
        };
        course.give(i, settings.deviations, &mut quantity);
        quantity
    });
    let estimated: Vec<Quantity> = estimated.collect();
    let known = design.observer.inputs.iter().map(|signal| Quantity {
        name: signal.name.clone(),
        truth: logged(&signal.name),
        is_input: true,
        ..Quantity::default()
    });
    let mut notes = design.notes.clone();
    notes.extend(order_notes);
    notes.extend(gaps(table, settings, &time_header, &design));
    let raw = Raw {
        intervals,
        frozen: hanging(study, &design.observer, &signals),
        time: &signals.time[..rows],
        quantities: estimated.into_iter().chain(known).collect(),
        measurements: measurements(&design, |signal| logged(&signal.name)),
        notes,
        course,
        prepared,
        design,
    };
    Ok(raw.finish())
}

/// Where the sensors that an observer reads hang.
fn hanging(study: &Study, observer: &Observer, signals: &Signals<'_>) -> Vec<Frozen> {
    let sensors = observer.measured.iter().zip(&signals.readings);
    let of = |(signal, readings): (&Signal, &&[f64])| {
        let noises = &mut study.sensors.noise.iter();
        let limits = &mut study.sensors.limits.iter();
        let channel = Channel {
            noise: noises.find(|(n, _)| n.text == signal.name).map(|n| n.1),
            limits: limits
                .find(|(n, ..)| n.text == signal.name)
                .map(|(_, low, high)| (*low, *high)),
        };
        frozen(&signal.name, signals.time, readings, channel)
    };
    sensors.flat_map(of).collect()
}

/// A measured state for which neither the study nor the model says where it starts begins at its
/// sensor's first reading.
fn start_at_readings(prepared: &Prepared<'_>, signals: &Signals<'_>, design: &mut Design) {
    let extended = prepared.extended();
    let initial = &prepared.study().observer.tuning.initial;
    let number = |node| extended.graph().constant_value(node);
    for (output, readings) in extended.outputs.iter().zip(&signals.readings) {
        let Some((i, slope, offset)) = output.state else {
            continue;
        };
        let state = &extended.states[i];
        let array = state.name.split('[').next().unwrap_or_default();
        let is_given = state.start.is_some()
            || initial.default.is_some()
            || [state.name.as_str(), array]
                .iter()
                .any(|name| initial.values.contains_key(*name));
        let first = readings.iter().find(|y| y.is_finite());
        let (Some(slope), Some(offset), Some(y)) = (number(slope), number(offset), first) else {
            continue;
        };
        let start = (y - offset) / slope;
        if let (false, true, Some(own)) = (
            is_given,
            start.is_finite(),
            design.observer.states.get_mut(i),
        ) {
            own.1 = start;
            design.notes.push(format!(
                "{} starts at its first reading, {}: neither `initial` nor the model's `start` says where",
                state.name,
                lynkeus_structure::short(start)
            ));
        }
    }
}

/// The columns of a log that an observer reads.
struct Signals<'t> {
    time: &'t [f64],
    readings: Vec<&'t [f64]>,
    inputs: Vec<Cow<'t, [f64]>>,
}

impl<'t> Signals<'t> {
    fn of(
        table: &'t Table,
        time_header: &str,
        settings: &EstimateSettings,
        observer: &Observer,
    ) -> Result<Self, Error> {
        let reading = |name: &str| match settings.strict {
            true => table.column(header(settings, name)),
            false => table.readings(header(settings, name)),
        };
        let readings = observer.measured.iter().map(|s| reading(&s.name));
        let inputs = observer.inputs.iter();
        let inputs = inputs.map(|s| signal(table, settings, observer, &s.name));
        Ok(Self {
            time: table.time(time_header)?,
            readings: readings.collect::<Result<_, _>>()?,
            inputs: inputs.collect::<Result<_, _>>()?,
        })
    }

    fn samples(&self) -> Samples<'_> {
        Samples {
            time: self.time,
            readings: self.readings.clone(),
            inputs: self.inputs.iter().map(|u| &**u).collect(),
        }
    }
}

/// The observer's run over samples: a filter takes readings when they are there; an observer
/// whose correction is in its flow needs a stand-in for those that are not.
pub(crate) fn course(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Course, Error> {
    course_of(prepared, design, samples, &mut Watch::only(watch))
}

fn course_of(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let study = prepared.study();
    let settings = &study.estimate;
    let run = run_settings(settings);
    if design.observer.filter.is_some() {
        return filter::run(study, prepared.extended(), design, samples, run, watch);
    }
    if settings.smoothing.is_some() {
        return Err(Error::input("`smooth` and `lag` of [estimate] need a filter (\"ekf\", \"ukf\" or \"mhe\"): this observer has no covariance to smooth with").at(&study.file));
    }
    let is_linear = settings.between_samples == BetweenSamples::Linear;
    if is_linear && samples.have_gaps() && !settings.deviations {
        return across_gaps(prepared, design, samples, run, watch);
    }
    let stands_in = samples.have_gaps() || settings.deviations;
    if stands_in || settings.between_samples == BetweenSamples::Predict {
        let mut course = sampled::run(prepared, design, samples, run.method, watch)?;
        if is_linear {
            course.notes.push("with `sd` the measurements are held between samples, not linear: standard deviations are those of a causal observer".to_owned());
        }
        return Ok(course);
    }
    plain(prepared, design, samples, run, watch)
}

/// Lines between the samples reach across those that are missing.
fn across_gaps(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let filled = |columns: &[&[f64]]| -> Vec<Vec<f64>> {
        columns.iter().map(|c| on_lines(samples.time, c)).collect()
    };
    let (readings, inputs) = (filled(&samples.readings), filled(&samples.inputs));
    let whole = Samples {
        time: samples.time,
        readings: readings.iter().map(Vec::as_slice).collect(),
        inputs: inputs.iter().map(Vec::as_slice).collect(),
    };
    let mut course = plain(prepared, design, &whole, run, watch)?;
    course
        .notes
        .push("readings that are missing lie on the line between their neighbours".to_owned());
    Ok(course)
}

/// Values with those that are not finite on the line between their neighbours; before the first
/// and after the last the nearest one.
fn on_lines(time: &[f64], values: &[f64]) -> Vec<f64> {
    let known: Vec<usize> = (0..values.len())
        .filter(|&k| values[k].is_finite())
        .collect();
    let at = |k: usize| {
        let next = known.partition_point(|&i| i < k);
        match (next.checked_sub(1).map(|i| known[i]), known.get(next)) {
            (_, Some(&j)) if j == k => values[k],
            (Some(i), Some(&j)) => {
                let share = (time[k] - time[i]) / (time[j] - time[i]);
                values[i] + share * (values[j] - values[i])
            }
            (Some(i), None) => values[i],
            (None, Some(&j)) => values[j],
            (None, None) => values[k],
        }
    };
    (0..values.len()).map(at).collect()
}

fn plain(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let observer = systems::observer(prepared.plant(), &design.observer)?;
    let mut estimator = Estimator::new(&observer, run).map_err(Error::from_source)?;
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

/// A log has no derivatives of the inputs.
pub(crate) fn refuse_derivatives(study: &Study, design: &Design) -> Result<(), Error> {
    let Some(needed) = design.observer.input_derivatives.first() else {
        return Ok(());
    };
    Err(Error::input(format!(
        "this observer reads {}, the derivative of order {} of the input \"{}\", which no log holds",
        needed.signal.name, needed.order, needed.input
    ))
    .at(&study.file)
    .hint("set variant = \"practical\" in [observer], which estimates it"))
}

/// The header under which the log has a signal of the plant.
pub(crate) fn header<'a>(settings: &'a EstimateSettings, name: &'a str) -> &'a str {
    let given = settings
        .columns
        .iter()
        .find(|(plant, _)| plant.text == name);
    given.map_or(name, |(_, header)| header)
}

pub(crate) fn refuse_stray_columns(
    plant: &Plant,
    settings: &EstimateSettings,
) -> Result<(), Error> {
    let names = || {
        plant
            .outputs
            .iter()
            .chain(&plant.inputs)
            .map(|v| v.name.as_str())
    };
    match settings
        .columns
        .iter()
        .find(|(name, _)| !names().any(|n| n == name.text))
    {
        None => Ok(()),
        Some((name, _)) => Err(name.blame(
            Error::input(format!(
                "columns: the plant '{}' has no output or input named \"{name}\"",
                plant.name
            ))
            .hint(crate::near::suggest(&name.text, names())),
        )),
    }
}

/// What the observer reads under a plant's name: an input's last value stands where its cell is
/// missing, unless the study is strict.
pub(crate) fn signal<'t>(
    table: &'t Table,
    settings: &EstimateSettings,
    observer: &Observer,
    name: &str,
) -> Result<Cow<'t, [f64]>, Error> {
    let header = header(settings, name);
    let is_input = observer.inputs.iter().any(|input| input.name == name);
    match is_input && !settings.strict {
        true => table.held(header),
        false => table.column(header).map(Cow::Borrowed),
    }
}

/// What the log lacks in words, and where its times count from.
fn gaps(table: &Table, settings: &EstimateSettings, time: &str, design: &Design) -> Vec<String> {
    let origin = table.origin(time);
    let mut notes: Vec<String> = origin
        .map(|origin| format!("times are seconds since {origin}"))
        .into_iter()
        .collect();
    let observer = &design.observer;
    for signal in observer.inputs.iter().chain(&observer.measured) {
        let header = header(settings, &signal.name);
        let places: Vec<String> = table
            .faults(header)
            .iter()
            .map(|fault| format!("{fault} in line {}", fault.line))
            .collect();
        if !places.is_empty() {
            notes.push(format!(
                "column \"{header}\": {} of {} cells are missing, first {}",
                table.missing(header),
                table.rows(),
                places.join(", ")
            ));
        }
    }
    notes
}

/// A column of the log, if it has one with numbers, and only one, that is not the one of time.
fn logged<'t>(
    table: &'t Table,
    settings: &EstimateSettings,
    time: &str,
    name: &str,
) -> Option<&'t [f64]> {
    let header = header(settings, name);
    let mut named = table.names().filter(|name| *name == header);
    let is_own = named.next().is_some() && named.next().is_none() && header != time;
    let values = table.get(header).filter(|_| is_own)?;
    values.iter().any(|x| x.is_finite()).then_some(values)
}

#[cfg(test)]
mod tests {
    use super::on_lines;

    #[test]
    fn gaps_lie_on_the_line_between_their_neighbours() {
        let nan = f64::NAN;
        let found = on_lines(
            &[0.0, 1.0, 2.0, 4.0, 5.0, 6.0],
            &[nan, 1.0, nan, 7.0, nan, nan],
        );
        assert_eq!(found, [1.0, 1.0, 3.0, 7.0, 7.0, 7.0]);
    }
}
