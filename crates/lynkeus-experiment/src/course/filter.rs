//! A log through a Kalman filter.

use std::ops::ControlFlow;
use std::sync::{Arc, Mutex, PoisonError};

use lynkeus_expr::{Graph, Node};
use lynkeus_model::{Home, Variable};
use lynkeus_observers::{Design, FilterTuning, Signal};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Health, Limits, NoisyModel, NoisyPlant, Sensor, Smoothed,
};
use lynkeus_run::{Blueprint, EstimatorSettings, Fleet, Updates};
use lynkeus_structure::AugmentedPlant;
use lynkeus_words::short;

use crate::course::replay::{Watch, replay, replay_together};
use crate::course::{Course, Samples};
use crate::prepare::systems::run_settings;
use crate::prepare::{Prepared, manifold};
use crate::words::explain;
use crate::{Error, Series, Study};
use lynkeus_study::{Records, Smoothing};
use lynkeus_table::series::Store;

pub mod noise;
mod particles;

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
        keeps_effective: study.estimate.effective,
        records: study.records,
        ..Course::default()
    };
    let notes = &mut course.notes;
    let filter = blueprint(prepared, design, samples, settings, notes)?;
    let densities = match &filter.updates {
        Updates::Filter { model, .. } => model.process_noise.clone(),
        Updates::Jumps { .. } => vec![],
    };
    let mut filter = filter.estimator().map_err(explain)?;
    if study.records != Records::Nothing {
        filter.keep_record();
    }
    let n = filter.names().len();
    replay(&mut filter, samples, n, &mut course, watch)?;
    tell(filter.health(), samples, &mut course);
    particles::tell(prepared, design, &densities, filter.health(), &mut course);
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

/// What a filter's user should know of its run.
fn tell(health: &Health, samples: &Samples, course: &mut Course) {
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
}

/// Fewer rows are over before there is machine code for them.
const WORTHWHILE: usize = 1_000;

/// Runs the filters of designs side by side, each over samples of its own, where that gives what each gives alone to the
/// bit; none where it does not, or does not pay.
pub(crate) fn together(
    prepared: &Prepared<'_>,
    runs: &[(&Design, &Samples)],
    settings: EstimatorSettings,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Option<Vec<Result<Course, Error>>> {
    let study = prepared.study();
    let rows: usize = runs.iter().map(|(_, samples)| samples.time.len()).sum();
    if study.records != Records::Nothing || runs.len() < 2 || rows < WORTHWHILE {
        return None;
    }
    let (mut filters, mut courses) = (vec![], vec![]);
    for (design, samples) in runs {
        let mut course = Course {
            keeps_innovations: study.estimate.innovations,
            ..Course::default()
        };
        let filter = blueprint(prepared, design, samples, settings, &mut course.notes);
        filters.push(filter.ok()?);
        courses.push(course);
    }
    let mut fleet = Fleet::new(&filters).ok()?;
    if !fleet.is_exact() {
        return None;
    }
    let samples: Vec<&Samples> = runs.iter().map(|run| run.1).collect();
    let done = replay_together(&mut fleet, &samples, &mut courses, watch);
    let all = done.into_iter().zip(courses).enumerate();
    let all = all.map(|(place, (done, mut course))| {
        tell(fleet.health(place), samples[place], &mut course);
        done.map(|()| course)
    });
    Some(all.collect())
}

/// The standard deviations of the design's filter on readings that stand for those that will come.
///
/// # Errors
/// Noises of the study that do not fit.
pub fn foreseen(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Vec<Series>, Error> {
    let run = run_settings(&prepared.study().estimate);
    let mut blueprint = blueprint(prepared, design, samples, run, &mut vec![])?;
    if let Updates::Filter { settings, .. } = &mut blueprint.updates {
        settings.foresees = true;
    }
    let mut filter = blueprint.estimator().map_err(explain)?;
    let mut course = Course::default();
    let count = filter.names().len();
    let watch = &mut Watch::only(watch);
    replay(&mut filter, samples, count, &mut course, watch)?;
    Ok(course.deviations.unwrap_or_default())
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
    particles::refuse(prepared, &tuning.kind)?;
    let model = model(prepared, design, tuning, samples, notes)?;
    let kept = FilterSettings {
        gate: tuning.gate,
        patience: tuning.patience,
        projects: tuning.projects,
        iterations: tuning.iterations,
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
    let states = observer.states.iter();
    let mut starts: Vec<f64> = states.map(|(_, start)| *start).collect();
    let started = manifold::started(&augmented.states, &mut starts, "estimate");
    started.map_err(|error| error.at(&prepared.study().file))?;
    let states = observer.states.iter().zip(starts);
    let states = states.map(|((s, _), start)| (s.name.clone(), s.symbol, start));
    let named = |s: &Signal| (s.name.clone(), s.symbol);
    let span = samples.span();
    let levels = noise::levels(declared, augmented, samples, notes);
    let sensors = observer.measured.iter().zip(&tuning.outputs).zip(levels);
    let range = |state: &Variable| match state.home {
        Home::Rotation { .. } => Limits {
            low: f64::NEG_INFINITY,
            high: f64::INFINITY,
        },
        _ => Limits {
            low: state.min,
            high: state.max,
        },
    };
    let mut densities = noise::densities(prepared, span, notes);
    quartered(prepared, "[process_noise]", &mut densities)?;
    let mut variances = tuning.initial_variance.clone();
    let key = "`initial_variance` of [observer]";
    quartered(prepared, key, &mut variances)?;
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
        process_noise: densities,
        initial_variance: variances,
        ranges: augmented.states.iter().map(range).collect(),
        confined: tuning.whens.is_empty().then(|| tuning.confined.clone()),
        whens: tuning.whens.clone(),
    };
    let drawn = noise::drawn(declared, augmented, &plant.inputs);
    let plant = match &drawn {
        Some(drawn) => plant.drawing(drawn),
        None => plant,
    };
    let model = compiled(&plant).map_err(explain)?;
    let model = model.drawing(drawn.map_or(0, |drawn| drawn.count()));
    Ok(model.on(manifold::of(augmented)))
}

/// One number for the four of each quaternion, as a quarter of what it is for the vector of a small rotation.
///
/// # Errors
/// Numbers that differ.
fn quartered(prepared: &Prepared<'_>, what: &str, values: &mut [f64]) -> Result<(), Error> {
    for (place, name) in manifold::firsts(&prepared.augmented().states) {
        let own = &mut values[place..place + 4];
        if own.iter().any(|value| *value != own[0]) {
            let message = format!(
                "{what}: expected one number for the quaternion {name}, that of the vector of a small rotation, found different ones for its elements"
            );
            let hint = format!("write {name} = …");
            return Err(Error::input(message).at(&prepared.study().file).hint(hint));
        }
        own.iter_mut().for_each(|value| *value *= 0.25);
    }
    Ok(())
}

/// The filter of a plant that is kept for many logs: compiled once, it has the numbers of each. The plant's graph has
/// it, and so have its copies.
#[derive(Debug, Default)]
struct Compiled(Mutex<Option<(Asked, NoisyModel)>>);

/// What a filter is compiled from.
#[derive(Debug, PartialEq)]
struct Asked {
    nodes: Vec<Vec<Node>>,
    names: Vec<Vec<String>>,
}

/// What is asked of a graph.
#[derive(Clone, PartialEq, Eq, Hash)]
struct ForAll;

/// From now on filters of this graph and its copies are compiled once.
pub(crate) fn keep_compiled(graph: &Graph) {
    graph.note(ForAll, Arc::<Compiled>::default());
}

fn compiled(plant: &NoisyPlant<'_>) -> Result<NoisyModel, lynkeus_run::Error> {
    let Some(known) = plant.graph.noted::<_, Arc<Compiled>>(&ForAll) else {
        return NoisyModel::new(plant);
    };
    let signals = plant.inputs.iter().map(|input| (&input.0, input.1));
    let states = plant.states.iter().map(|state| (&state.0, state.1));
    let sensors = plant.sensors.iter().map(|s| (&s.name, s.output));
    let named = states.map(|(name, node)| (name.clone(), node)).unzip();
    let read = signals.map(|(name, node)| (name.clone(), node)).unzip();
    let seen = sensors.map(|(name, node)| (name.clone(), node)).unzip();
    let parts: [(Vec<String>, Vec<Node>); 3] = [named, read, seen];
    let (names, mut nodes): (Vec<_>, Vec<_>) = parts.into_iter().unzip();
    nodes.push(vec![plant.time]);
    nodes.push(plant.derivatives.clone());
    nodes.extend(plant.confined.clone());
    for clause in &plant.whens.clauses {
        let (changed, values) = clause.changes.iter().copied().unzip();
        nodes.extend([clause.conditions.clone(), changed, values]);
    }
    let asked = Asked { nodes, names };
    let mut known = known.0.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some((own, model)) = &*known
        && *own == asked
    {
        return model.with_numbers(plant);
    }
    let model = NoisyModel::new(plant)?;
    *known = Some((asked, model.clone()));
    Ok(model)
}
