//! A log through a Kalman filter.

use lynkeus_model::Variable;
use lynkeus_observers::{Design, FilterTuning, Signal};
use lynkeus_run::filter::{
    Bounds, Confined, FilterKind, FilterModel, FilterPlant, FilterSettings, Limits, Sensor,
    Smoothed,
};
use lynkeus_run::{Blueprint, EstimatorSettings};
use lynkeus_structure::{Extended, short};

use crate::course::{Course, Samples};
use crate::replay::{Watch, replay};
use crate::series::Store;
use crate::study::{Name, Smoothing};
use crate::{Error, Series, Study};

pub(crate) mod noise;

/// Runs the design's filter over samples.
///
/// # Errors
/// Noises of the study that do not fit, or that are missing, or a checkpoint.
pub(crate) fn run(
    study: &Study,
    extended: &Extended<'_>,
    design: &Design,
    samples: &Samples,
    settings: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let mut course = Course::default();
    let notes = &mut course.notes;
    let filter = blueprint(study, extended, design, samples, settings, notes)?;
    let mut filter = filter.estimator().map_err(Error::from_source)?;
    let n = filter.names().len();
    replay(&mut filter, samples, n, &mut course, watch)?;
    let health = filter.health();
    course.inputs_held = health.inputs_held;
    if health.confined > 0 {
        course.notes.push(format!(
            "the model has no value where the estimate was: at {} samples it was put back into its declared range; family = \"mhe\" keeps it there",
            health.confined
        ));
    }
    let smoothed = match study.estimate.smoothing {
        None => None,
        Some(Smoothing::Interval) => filter.smoothed(None, false),
        Some(Smoothing::Lag(lag)) => filter.smoothed(Some(lag), false),
    };
    if is_window(design) {
        let held = held_at_an_end(extended, &course.estimates);
        course.notes.extend(held);
    }
    if study.estimate.smoothing.is_some() && smoothed.is_none() {
        let note = "nothing is smoothed: the model has no value along the last window";
        course.notes.push(note.to_owned());
    }
    course.smoothed = smoothed.map(|rows| columns(&course.store, n, &rows));
    Ok(course)
}

/// What the design's filter is made of.
///
/// # Errors
/// Noises of the study that do not fit.
pub(crate) fn blueprint(
    study: &Study,
    extended: &Extended<'_>,
    design: &Design,
    samples: &Samples,
    settings: EstimatorSettings,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    let Some(tuning) = &design.observer.filter else {
        return Err(Error::input("this observer is no filter").at(&study.file));
    };
    refuse_longer_lag(study, &tuning.kind)?;
    let model = model(study, extended, design, tuning, samples, notes)?;
    Ok(Blueprint::Filter {
        model: Box::new(model),
        settings: FilterSettings {
            kind: tuning.kind.clone(),
            gate: tuning.gate,
            keep_history: study.estimate.smoothing.is_some(),
        },
        run: settings,
    })
}

fn is_window(design: &Design) -> bool {
    let filter = design.observer.filter.as_ref();
    filter.is_some_and(|filter| matches!(filter.kind, FilterKind::MovingHorizon(..)))
}

/// A share of the rows in which an estimate at an end of its range is worth a word.
const HELD: f64 = 0.01;

/// The quantity that the moving horizon keeps at an end of its range in most rows.
fn held_at_an_end(extended: &Extended<'_>, estimates: &[Series]) -> Option<String> {
    let share = |(state, column): &(&Variable, &Series)| {
        let at_end = column.iter().filter(|x| *x <= state.min || *x >= state.max);
        at_end.count() as f64 / column.len().max(1) as f64
    };
    let all = extended.states.iter().zip(estimates);
    let held = all.map(|pair| (share(&pair), pair.0));
    let (share, state) = held.max_by(|a, b| a.0.total_cmp(&b.0))?;
    (share >= HELD).then(|| {
        format!(
            "{} is kept at an end of its range [{}, {}] in {} % of the rows: if the plant goes further, declare a wider one",
            state.name,
            short(state.min),
            short(state.max),
            short((100.0 * share).round())
        )
    })
}

/// A window has no row older than its horizon.
fn refuse_longer_lag(study: &Study, kind: &FilterKind) -> Result<(), Error> {
    let (Some(Smoothing::Lag(lag)), FilterKind::MovingHorizon(horizon, _)) =
        (study.estimate.smoothing, kind)
    else {
        return Ok(());
    };
    if lag <= *horizon {
        return Ok(());
    }
    let message = format!(
        "`lag` of [estimate]: expected at most the {horizon} samples of the window of family = \"mhe\", found {lag}"
    );
    Err(Error::input(message)
        .at(&study.file)
        .hint("raise `horizon` of [observer], or take smooth = true"))
}

fn columns(store: &Store, count: usize, rows: &[Smoothed]) -> Vec<Series> {
    let column = |i: usize| Series::gathered(store, rows.iter().map(|row| row.estimate[i]));
    (0..count).map(column).collect()
}

/// The plant with the study's noises.
fn model(
    study: &Study,
    extended: &Extended<'_>,
    design: &Design,
    tuning: &FilterTuning,
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Result<FilterModel, Error> {
    let observer = &design.observer;
    let states = observer
        .states
        .iter()
        .map(|(s, start)| (s.name.clone(), s.symbol, *start));
    let named = |s: &Signal| (s.name.clone(), s.symbol);
    let span = samples.time.last().unwrap_or(0.0) - samples.time.first().unwrap_or(0.0);
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
pub(crate) fn limits(study: &Study, extended: &Extended<'_>) -> Result<Vec<Option<Limits>>, Error> {
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
