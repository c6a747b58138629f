//! A log through an observer of the five families, where sensors report when they do.

use lynkeus_expr::Node;
use lynkeus_observers::{Design, Sampled};
use lynkeus_run::{ErrorModel, ErrorNoise, Estimator, Method, SampledObserver, System};

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
    let Sampled { observer, outputs } = design
        .observer
        .sampled(extended)
        .map_err(Error::from_source)?;
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
    })
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
