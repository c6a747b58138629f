//! A log through a Kalman filter.

use std::ops::ControlFlow;

use lynkeus_model::Variable;
use lynkeus_observers::{Design, FilterTuning, Signal};
use lynkeus_run::filter::{
    Bounds, Confined, Filter, FilterKind, FilterModel, FilterPlant, FilterSettings, Limits, Sensor,
    SensorHealth, Smoothed,
};
use lynkeus_run::{Error as RunError, EstimatorSettings};
use lynkeus_structure::Extended;

use crate::course::{Course, Samples, add_row};
use crate::study::{Name, Smoothing};
use crate::{Error, Study};

pub(crate) mod noise;

/// Runs the design's filter over samples; `watch` is told the fraction done.
///
/// # Errors
/// Noises of the study that do not fit, or that are missing.
pub(crate) fn run(
    study: &Study,
    extended: &Extended<'_>,
    design: &Design,
    samples: &Samples<'_>,
    settings: EstimatorSettings,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Course, Error> {
    let Some(tuning) = &design.observer.filter else {
        return Err(Error::input("this observer is no filter").at(&study.file));
    };
    if study.estimate.smoothing.is_some() && matches!(tuning.kind, FilterKind::MovingHorizon(..)) {
        let message = "`smooth` and `lag` of [estimate] need family = \"ekf\" or \"ukf\"";
        return Err(Error::input(message).at(&study.file));
    }
    let mut notes = vec![];
    let model = model(study, extended, design, tuning, samples, &mut notes)?;
    let settings_of_filter = FilterSettings {
        kind: tuning.kind.clone(),
        gate: tuning.gate,
        keep_history: study.estimate.smoothing.is_some(),
    };
    let mut filter =
        Filter::new(&model, settings_of_filter, settings).map_err(Error::from_source)?;
    let n = model.dimension();
    let mut course = Course {
        estimates: vec![vec![]; n],
        deviations: Some(vec![vec![]; n]),
        notes,
        ..Course::default()
    };
    course.ended = replay(&mut filter, samples, &mut course, watch).err();
    course.inputs_held = filter.health().inputs_held;
    if filter.health().confined > 0 {
        course.notes.push(format!(
            "the model has no value where the estimate was: at {} samples it was put back into its declared range; family = \"mhe\" keeps it there",
            filter.health().confined
        ));
    }
    let smoothed = match study.estimate.smoothing {
        None => None,
        Some(Smoothing::Interval) => filter.smoothed(false),
        Some(Smoothing::Lag(lag)) => filter.smoothed_with_lag(lag, false),
    };
    course.smoothed = smoothed.map(|rows| columns(n, &rows));
    Ok(course)
}

fn columns(count: usize, rows: &[Smoothed]) -> Vec<Vec<f64>> {
    let column = |i: usize| rows.iter().map(|row| row.estimate[i]).collect();
    (0..count).map(column).collect()
}

fn replay(
    filter: &mut Filter,
    samples: &Samples<'_>,
    course: &mut Course,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(), RunError> {
    let mut half = vec![];
    let result = samples.time.iter().enumerate().try_for_each(|(k, &t)| {
        let readings = Samples::row(&samples.readings, k);
        filter.push(t, &readings, &Samples::row(&samples.inputs, k))?;
        add_row(&mut course.estimates, filter.estimate().iter().copied());
        if let Some(columns) = &mut course.deviations {
            add_row(columns, filter.deviations().iter().copied());
        }
        if k == samples.time.len() / 2 {
            half = filter.health().sensors.clone();
        }
        match watch((k + 1) as f64 / samples.time.len() as f64).is_break() {
            true => Err(RunError::Cancelled { time: t }),
            false => Ok(()),
        }
    });
    course.sensors = filter.health().sensors.clone();
    let late = course.sensors.iter().zip(&half);
    course.late = late
        .map(|(all, half): (&SensorHealth, _)| all.since(half))
        .collect();
    result
}

/// The plant with the study's noises.
fn model(
    study: &Study,
    extended: &Extended<'_>,
    design: &Design,
    tuning: &FilterTuning,
    samples: &Samples<'_>,
    notes: &mut Vec<String>,
) -> Result<FilterModel, Error> {
    let observer = &design.observer;
    let states = observer
        .states
        .iter()
        .map(|(s, start)| (s.name.clone(), s.symbol, *start));
    let named = |s: &Signal| (s.name.clone(), s.symbol);
    let span = samples.time.last().unwrap_or(&0.0) - samples.time.first().unwrap_or(&0.0);
    let limits = limits(study, extended)?;
    let levels = noise::levels(study, extended, samples, notes)?;
    let sensors = observer
        .measured
        .iter()
        .zip(&tuning.outputs)
        .zip(levels)
        .zip(limits);
    let plant = FilterPlant {
        graph: extended.graph(),
        time: observer.time,
        states: states.collect(),
        derivatives: observer.derivatives.clone(),
        inputs: observer.inputs.iter().map(named).collect(),
        sensors: sensors
            .map(|(((signal, output), noise), limits)| Sensor {
                name: signal.name.clone(),
                output: *output,
                noise,
                limits,
            })
            .collect(),
        process_noise: noise::densities(study, extended, span, notes)?,
        initial_variance: tuning.initial_variance.clone(),
        confined: Some(Confined {
            derivatives: tuning.confined.clone(),
            bounds: extended.states.iter().map(bounds).collect(),
        }),
    };
    FilterModel::new(&plant).map_err(Error::from_source)
}

fn bounds(state: &Variable) -> Bounds {
    Bounds {
        low: state.min,
        high: state.max,
    }
}

/// `limits` of `[sensors]`, by measured output.
fn limits(study: &Study, extended: &Extended<'_>) -> Result<Vec<Option<Limits>>, Error> {
    let mut found = vec![None; extended.outputs.len()];
    for (name, low, high) in &study.sensors.limits {
        let place = output(extended, name, "limits")?;
        found[place] = Some(Limits {
            low: *low,
            high: *high,
        });
    }
    Ok(found)
}

/// The measured output of that name.
fn output(extended: &Extended<'_>, name: &Name, key: &str) -> Result<usize, Error> {
    let names = || extended.outputs.iter().map(|o| o.variable.name.as_str());
    names().position(|n| n == name.text).ok_or_else(|| {
        let message = format!("{key} of [sensors]: no measured output is called \"{name}\"");
        name.blame(Error::input(message).hint(crate::near::suggest(&name.text, names())))
    })
}
