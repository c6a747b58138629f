//! A log through an observer of the five families, where sensors report when they do.

use lynkeus_expr::{Graph, Node};
use lynkeus_observers::{Design, Sampled, Signal, Tunable, kalman::prior_variance};
use lynkeus_run::filter::{NoisyModel, NoisyPlant, Sensor};
use lynkeus_run::{
    BetweenSamples as Between, Blueprint, Error as RunError, EstimatorSettings, Lag, Method,
    System, Tuned, Updates,
};

use crate::Error;
use crate::course::filter::noise;
use crate::course::replay::{Watch, replay};
use crate::course::trace::Trace;
use crate::course::{Course, Samples};
use crate::prepare::Prepared;
use crate::prepare::systems::margins;
use crate::words::explain;
use lynkeus_study::BetweenSamples;

/// Runs the design's observer over samples; its errors are followed where the study tells deviations
/// or innovations.
///
/// # Errors
/// Noises of the study that do not fit, or a checkpoint.
pub(crate) fn run(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    method: Method,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let mut course = Course {
        keeps_innovations: prepared.study().estimate.innovations,
        ..Course::default()
    };
    let follows = prepared.study().estimate.follows_errors();
    let mut observer = observer(prepared, design, samples, follows, &mut course.notes)?;
    // what the log's scatter gives judges nobody
    observer.judges = !prepared.study().sensors.noise.is_empty() || course.keeps_innovations;
    observer.run.method = method;
    let mut estimator = observer.estimator().map_err(explain)?;
    let count = design.observer.estimates.len();
    replay(&mut estimator, samples, count, &mut course, watch)?;
    let sensors = estimator.health().sensors.iter();
    for (sensor, signal) in sensors.zip(&design.observer.measured) {
        if sensor.missing > 0 {
            course.notes.push(format!(
                "{} has no reading in {} of {} rows: there the model stands in for the sensor",
                signal.name,
                sensor.missing,
                samples.time.len()
            ));
        }
    }
    Ok(course)
}

/// Judges the readings of a run whose errors nobody follows: the observer runs once more, with its
/// errors and with held measurements, and the run's course has from it what is expected of the readings,
/// and the deviations. Where it ends early, the readings before are judged so. Readings that contradict
/// known inputs which are held may be those of inputs that move between rows: what explains more counts.
///
/// # Errors
/// Noises of the study that do not fit, or a checkpoint.
pub(crate) fn judge(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
    course: &mut Course,
) -> Result<(), Error> {
    let mut beside = followed(prepared, design, samples, run, watch)?;
    let is_held = run.between == Between::Hold && !samples.inputs.is_empty();
    if is_held && beside.ended.is_none() && excess(&beside) > DOUBTFUL {
        let moving = EstimatorSettings {
            between: Between::Linear,
            ..run
        };
        let watch = &mut Watch::only(&mut *watch.watch);
        let lines = followed(prepared, design, samples, moving, watch)?;
        match lines.ended {
            None if excess(&lines) < excess(&beside) => beside = lines,
            Some(error @ RunError::Cancelled { .. }) => beside.ended = Some(error),
            _ => {}
        }
    }
    course.deviations = beside.deviations;
    course.sensors = beside.sensors;
    course.late = beside.late;
    course.traces = beside.traces;
    course.settled = beside.settled;
    // a run that nobody judged to its end is not whole
    course.ended = beside
        .ended
        .filter(|error| matches!(error, RunError::Cancelled { .. }));
    Ok(())
}

/// From this [`excess`] on known inputs may not be what they are held at.
const DOUBTFUL: f64 = 1.5;

/// The mean square of the innovations, in what is expected of them.
fn excess(course: &Course) -> f64 {
    let all = || course.traces.iter().map(Trace::whole);
    let taken: usize = all().map(|stretch| stretch.taken).sum();
    all().map(|stretch| stretch.clipped).sum::<f64>() / taken.max(1) as f64
}

/// The run of an observer whose errors are followed.
fn followed(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    run: EstimatorSettings,
    watch: &mut Watch<'_>,
) -> Result<Course, Error> {
    let mut course = Course::default();
    let mut observer = observer(prepared, design, samples, true, &mut course.notes)?;
    observer.run = run;
    let mut estimator = observer.estimator().map_err(explain)?;
    let count = design.observer.estimates.len();
    replay(&mut estimator, samples, count, &mut course, watch)?;
    Ok(course)
}

/// The design's observer with its measurements as states; whether its errors are followed.
///
/// # Errors
/// Noises of the study that do not fit.
pub(crate) fn observer(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    follows: bool,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    let (study, augmented) = (prepared.study(), prepared.augmented());
    let sampled = design.observer.sampled(augmented);
    let mut sampled = sampled.map_err(explain)?;
    let tuned = tuned(augmented.graph(), &mut sampled)?;
    let predict = study.estimate.between_samples == BetweenSamples::Predict;
    let lag = (follows && !predict).then(|| sampled.push_lag(augmented.graph()));
    let inputs = sampled.observer.inputs.iter();
    let inputs: Vec<(String, Node)> = inputs.map(|s| (s.name.clone(), s.symbol)).collect();
    let drawn = noise::misread(prepared.declared(), augmented, &inputs).filter(|_| follows);
    if let Some(drawn) = &drawn {
        sampled.push_drawn(augmented.graph(), drawn);
    }
    let Sampled {
        observer,
        outputs: expected,
        rates,
    } = sampled;
    let states: Vec<(String, Node, f64)> = observer
        .states
        .iter()
        .map(|(s, start)| (s.name.clone(), s.symbol, *start))
        .collect();
    let signals: Vec<(String, Node)> = observer
        .inputs
        .iter()
        .map(|s| (s.name.clone(), s.symbol))
        .collect();
    let estimates: Vec<Node> = observer.estimates.iter().map(|e| e.node).collect();
    let told = observer.estimates.iter();
    let told = told.map(|e| (e.variable.name.clone(), e.node));
    let monitors = observer.monitors.iter().map(|m| (m.name.clone(), m.node));
    let sensors: Vec<String> = measured(design);
    let outputs = sensors.iter().cloned().zip(expected.iter().copied());
    let reported: Vec<(String, Node)> = told.chain(monitors).chain(outputs).collect();
    let graph = augmented.graph();
    let system = System::new(
        graph,
        observer.time,
        &states,
        &signals,
        &observer.derivatives,
        &reported,
    )
    .map_err(explain)?
    .with_margins(margins(&observer));
    let errors = match follows {
        false => None,
        true => {
            let (process_noise, mut initial_variance) =
                error_noise(prepared, &states, samples, notes);
            let lag = lag.map(|state| Lag {
                state,
                rates: &rates,
            });
            if let Some(lag) = &lag {
                initial_variance[lag.state] = 1.0;
            }
            let count = drawn.map_or(0, |drawn| drawn.count());
            let measured = states.len() - sensors.len();
            initial_variance[measured - count..measured].fill(1.0);
            let levels = noise::levels(prepared.declared(), augmented, samples, notes);
            let each = sensors.iter().zip(&expected).zip(levels);
            let sensors = each.map(|((name, output), noise)| Sensor {
                name: name.clone(),
                output: *output,
                noise,
                limits: None,
            });
            let observer = NoisyPlant {
                graph,
                time: observer.time,
                states,
                derivatives: observer.derivatives.clone(),
                inputs: signals,
                sensors: sensors.collect(),
                process_noise,
                initial_variance,
                ranges: vec![],
                confined: None,
                whens: Default::default(),
            };
            let errors = NoisyModel::of_observer(&observer, &estimates, lag);
            Some(Box::new(errors.map_err(explain)?.drawing(count)))
        }
    };
    Ok(Blueprint {
        sensors: measured(design),
        updates: Updates::Jumps {
            predict,
            errors,
            tuned,
        },
        judges: true,
        ..Blueprint::new(&system, EstimatorSettings::default())
    })
}

/// What the equations make of the numbers that may be changed, as inputs of the observer after all
/// others; none where there are no such numbers.
fn tuned(
    graph: &Graph,
    Sampled {
        observer, outputs, ..
    }: &mut Sampled,
) -> Result<Option<Tuned>, Error> {
    let numbers = &observer.tunables;
    let named = |tunable: &Tunable| (tunable.name.clone(), tunable.symbol);
    let signals: Vec<(String, Node)> = numbers.iter().map(named).collect();
    let values = numbers.iter().map(|tunable| tunable.value).collect();
    let mut places: Vec<&mut Node> = observer.derivatives.iter_mut().chain(outputs).collect();
    places.extend(observer.estimates.iter_mut().map(|e| &mut e.node));
    // a condition number is found along with the solution, which a gain is part of
    places.extend(observer.monitors.iter_mut().map(|m| &mut m.node));
    let roots: Vec<Node> = places.iter().map(|place| **place).collect();
    let symbols: Vec<Node> = signals.iter().map(|signal| signal.1).collect();
    let hoisted = graph.hoisted(&roots, &symbols);
    if hoisted.values.is_empty() {
        return Ok(None);
    }
    for (place, root) in places.into_iter().zip(hoisted.roots) {
        *place = root;
    }
    let (mut made, mut read) = (vec![], vec![]);
    for (i, (value, symbol)) in hoisted.values.into_iter().zip(hoisted.symbols).enumerate() {
        let name = format!("tuned {}", i + 1);
        made.push((name.clone(), value));
        read.push(Signal { name, symbol });
    }
    observer.inputs.extend(read);
    let system = System::new(graph, observer.time, &[], &signals, &[], &made);
    Ok(Some(Tuned {
        system: system.map_err(explain)?,
        values,
    }))
}

fn measured(design: &Design) -> Vec<String> {
    let measured = design.observer.measured.iter();
    measured.map(|signal| signal.name.clone()).collect()
}

/// Densities and variances of the observer's states: those of the plant's estimate, which comes first,
/// and none of what the gain needs.
fn error_noise(
    prepared: &Prepared<'_>,
    states: &[(String, Node, f64)],
    samples: &Samples,
    notes: &mut Vec<String>,
) -> (Vec<f64>, Vec<f64>) {
    let augmented = prepared.augmented();
    let mut process = noise::of_families(prepared, samples.span(), notes);
    let starts = augmented.states.iter().zip(states);
    let mut initial: Vec<f64> = starts
        .map(|(s, (.., start))| prior_variance(s, *start))
        .collect();
    process.resize(states.len(), 0.0);
    initial.resize(states.len(), 0.0);
    (process, initial)
}
