//! A log through a Kalman filter.

use lynkeus_model::Variable;
use lynkeus_observers::{Design, FilterTuning, Signal};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor, Smoothed,
};
use lynkeus_run::{Blueprint, EstimatorSettings};
use lynkeus_structure::AugmentedPlant;
use lynkeus_words::short;

use crate::course::replay::{Watch, replay};
use crate::course::{Course, Samples};
use crate::prepare::Prepared;
use crate::words::explain;
use crate::{Error, Series, Study};
use lynkeus_study::{Records, Smoothing};
use lynkeus_table::series::Store;

pub(crate) mod noise;

/// Runs the design's filter over samples.
///
/// # Errors
/// A window shorter than the lag that is asked for, or a checkpoint.
pub(crate) fn run(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    settings: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let (study, augmented) = (prepared.study(), prepared.augmented());
    let mut course = Course {
        keeps_innovations: study.estimate.innovations,
        records: study.records,
        ..Course::default()
    };
    let notes = &mut course.notes;
    let filter = blueprint(prepared, design, samples, settings, notes)?;
    let mut filter = filter.estimator().map_err(explain)?;
    if study.records != Records::Nothing {
        filter.keep_record();
    }
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
    if health.projected > 0 {
        course.notes.push(format!(
            "bounds = \"project\": {} times the estimate was put back into the declared ranges",
            health.projected
        ));
    }
    if health.unsolved > 0 {
        course.notes.push(format!(
            "at {} of {} samples the iteration did not converge: these estimates are not the minimum over their window; a shorter `horizon`, wider ranges or a better start may help",
            health.unsolved,
            samples.time.len()
        ));
    }
    let smoothed = match study.estimate.smoothing {
        None => None,
        Some(Smoothing::Interval) => filter.smoothed(None, study.estimate.deviations),
        Some(Smoothing::Lag(lag)) => filter.smoothed(Some(lag), study.estimate.deviations),
    };
    if is_window(design) {
        let held = held_at_an_end(augmented, &course.estimates);
        course.notes.extend(held);
    }
    if study.estimate.smoothing.is_some() && smoothed.is_none() {
        let note = "nothing is smoothed: the model has no value along the last window";
        course.notes.push(note.to_owned());
    }
    if let Some(rows) = smoothed {
        let of = |values: fn(&Smoothed) -> &[f64]| columns(&course.store, n, &rows, values);
        course.smoothed = Some(of(|row| &row.estimate));
        let asked = study.estimate.deviations;
        course.smoothed_deviations = asked.then(|| of(|row| &row.deviations));
    }
    Ok(course)
}

/// What the design's filter is made of.
///
/// # Errors
/// A window shorter than the lag that is asked for.
pub(crate) fn blueprint(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    settings: EstimatorSettings,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    let study = prepared.study();
    let Some(tuning) = &design.observer.filter else {
        return Err(Error::input("this observer is no filter").at(&study.file));
    };
    refuse_longer_lag(study, &tuning.kind)?;
    refuse_smoothed_bounds(study, tuning)?;
    let model = model(prepared, design, tuning, samples, notes)?;
    let kept = FilterSettings {
        gate: tuning.gate,
        projects: tuning.projects,
        keep_history: study.estimate.smoothing.is_some(),
        ..FilterSettings::of(tuning.kind.clone())
    };
    Ok(Blueprint::filter(model, kept, settings))
}

fn is_window(design: &Design) -> bool {
    let filter = design.observer.filter.as_ref();
    filter.is_some_and(|filter| matches!(filter.kind, FilterKind::MovingHorizon(_)))
}

/// A share of the rows in which an estimate at an end of its range is worth a word.
const HELD: f64 = 0.01;

/// The quantity that the moving horizon keeps at an end of its range in most rows.
fn held_at_an_end(augmented: &AugmentedPlant<'_>, estimates: &[Series]) -> Option<String> {
    let share = |(state, column): &(&Variable, &Series)| {
        let at_end = column.iter().filter(|x| *x <= state.min || *x >= state.max);
        at_end.count() as f64 / column.len().max(1) as f64
    };
    let all = augmented.states.iter().zip(estimates);
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

/// What is projected is no Kalman filter's estimate, and its smoother would not keep to the bounds.
fn refuse_smoothed_bounds(study: &Study, tuning: &FilterTuning) -> Result<(), Error> {
    if study.estimate.smoothing.is_none() || !tuning.projects {
        return Ok(());
    }
    let message = "`bounds = \"project\"` of [observer] has no smoother, and `smooth` or `lag` of [estimate] asks for one";
    Err(Error::input(message).at(&study.file).hint(
        "take family = \"mhe\", whose smoother keeps to the ranges, or leave one of the keys out",
    ))
}

/// A window has no row older than its horizon.
pub(crate) fn refuse_longer_lag(study: &Study, kind: &FilterKind) -> Result<(), Error> {
    let (Some(Smoothing::Lag(lag)), FilterKind::MovingHorizon(horizon)) =
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

/// So many columns of what there is of each row.
fn columns(
    store: &Store,
    count: usize,
    rows: &[Smoothed],
    values: fn(&Smoothed) -> &[f64],
) -> Vec<Series> {
    let at = |row, i| values(row).get(i).copied().unwrap_or(f64::NAN);
    let column = |i: usize| Series::gathered(store, rows.iter().map(|row| at(row, i)));
    (0..count).map(column).collect()
}

/// The plant with the study's noises.
fn model(
    prepared: &Prepared<'_>,
    design: &Design,
    tuning: &FilterTuning,
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Result<NoisyModel, Error> {
    let (augmented, observer) = (prepared.augmented(), &design.observer);
    let declared = prepared.declared();
    let states = observer
        .states
        .iter()
        .map(|(s, start)| (s.name.clone(), s.symbol, *start));
    let named = |s: &Signal| (s.name.clone(), s.symbol);
    let span = samples.span();
    let levels = noise::levels(declared, augmented, samples, notes);
    let sensors = observer.measured.iter().zip(&tuning.outputs).zip(levels);
    let range = |state: &Variable| Limits {
        low: state.min,
        high: state.max,
    };
    let plant = NoisyPlant {
        graph: augmented.graph(),
        time: observer.time,
        states: states.collect(),
        derivatives: observer.derivatives.clone(),
        inputs: observer.inputs.iter().map(named).collect(),
        sensors: sensors
            .map(|((signal, output), noise)| Sensor {
                name: signal.name.clone(),
                output: *output,
                noise,
                limits: declared.limits.of(&signal.name).copied(),
            })
            .collect(),
        process_noise: noise::densities(prepared, span, notes),
        initial_variance: tuning.initial_variance.clone(),
        ranges: augmented.states.iter().map(range).collect(),
        confined: Some(tuning.confined.clone()),
    };
    NoisyModel::new(&plant).map_err(explain)
}
