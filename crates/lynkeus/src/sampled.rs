//! A log through an observer of the five families, where sensors report when they do.

use lynkeus_expr::{Graph, Node};
use lynkeus_observers::{Design, Sampled, Signal, Tunable};
use lynkeus_run::{ErrorModel, ErrorNoise, Estimator, Method, SampledObserver, System, Tuned};

use crate::course::{Course, Samples};
use crate::filter::noise;
use crate::prepare::Prepared;
use crate::replay::{Watch, replay};
use crate::study::BetweenSamples;
use crate::{Error, Study};

/// Runs the design's observer over samples.
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
    let mut course = Course::default();
    let observer = observer(prepared, design, samples, &mut course.notes)?;
    let mut estimator = Estimator::sampled(&observer, method).map_err(Error::from_source)?;
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

/// The design's observer with its measurements as states.
///
/// # Errors
/// Noises of the study that do not fit.
pub(crate) fn observer(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Result<SampledObserver, Error> {
    let (study, extended) = (prepared.study(), prepared.extended());
    let sampled = design.observer.sampled(extended);
    let mut sampled = sampled.map_err(Error::from_source)?;
    let tuned = tuned(extended.graph(), &mut sampled)?;
    let Sampled { observer, outputs } = sampled;
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
    let outputs = sensors.iter().cloned().zip(outputs);
    let reported: Vec<(String, Node)> = told.chain(monitors).chain(outputs).collect();
    let graph = extended.graph();
    let system = System::new(
        graph,
        observer.time,
        &states,
        &signals,
        &observer.derivatives,
        &reported,
    )
    .map_err(Error::from_source)?;
    let errors = match study.estimate.deviations {
        false => None,
        true => {
            let noise = error_noise(study, prepared, &states, samples, notes)?;
            let model = ErrorModel::new(
                graph,
                observer.time,
                &states,
                &signals,
                &observer.derivatives,
                &estimates,
                noise,
            );
            Some(model.map_err(Error::from_source)?)
        }
    };
    Ok(SampledObserver {
        system,
        sensors,
        predict: study.estimate.between_samples == BetweenSamples::Predict,
        errors,
        tuned,
    })
}

/// What the equations make of the numbers that may be changed, as inputs of the observer after all
/// others; none where there are no such numbers.
fn tuned(
    graph: &Graph,
    Sampled { observer, outputs }: &mut Sampled,
) -> Result<Option<Tuned>, Error> {
    let numbers = &observer.tunables.numbers;
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
    if hoisted.parts.is_empty() {
        return Ok(None);
    }
    for (place, root) in places.into_iter().zip(hoisted.roots) {
        *place = root;
    }
    let (mut made, mut read) = (vec![], vec![]);
    for (i, part) in hoisted.parts.iter().enumerate() {
        let name = format!("tuned {}", i + 1);
        made.push((name.clone(), part.value));
        let symbol = part.symbol;
        read.push(Signal { name, symbol });
    }
    observer.inputs.extend(read);
    let system = System::new(graph, observer.time, &[], &signals, &[], &made);
    Ok(Some(Tuned {
        system: system.map_err(Error::from_source)?,
        values,
    }))
}

fn measured(design: &Design) -> Vec<String> {
    let measured = design.observer.measured.iter();
    measured.map(|signal| signal.name.clone()).collect()
}

/// The noises on the observer's states: those of the plant on its estimate, which comes first,
/// and none on what the gain needs.
fn error_noise(
    study: &Study,
    prepared: &Prepared<'_>,
    states: &[(String, Node, f64)],
    samples: &Samples,
    notes: &mut Vec<String>,
) -> Result<ErrorNoise, Error> {
    let extended = prepared.extended();
    let declared = noise::declared(study, extended)?;
    let mut process: Vec<f64> = declared.iter().map(|q| q.unwrap_or(0.0)).collect();
    let quarter = |variable: &lynkeus_model::Variable| {
        let width = variable.max - variable.min;
        if width.is_finite() {
            (width / 4.0).powi(2)
        } else {
            0.0
        }
    };
    let mut initial: Vec<f64> = extended.states.iter().map(quarter).collect();
    process.resize(states.len(), 0.0);
    initial.resize(states.len(), 0.0);
    Ok(ErrorNoise {
        process,
        initial,
        sensors: noise::levels(study, extended, samples, notes)?,
    })
}
