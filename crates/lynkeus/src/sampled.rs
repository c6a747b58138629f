//! A log through an observer of the five families, where sensors report when they do.

use std::ops::ControlFlow;

use lynkeus_expr::Node;
use lynkeus_observers::{Design, Sampled};
use lynkeus_run::{
    Error as RunError, ErrorModel, ErrorNoise, Method, SampledEstimator, SampledObserver, System,
};

use crate::course::{Course, Samples, add_row};
use crate::filter::noise;
use crate::prepare::Prepared;
use crate::study::BetweenSamples;
use crate::{Error, Study};

/// Runs the design's observer over samples; `watch` is told the fraction done.
///
/// # Errors
/// Noises of the study that do not fit.
pub(crate) fn run(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
    method: Method,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Course, Error> {
    let mut course = Course::default();
    let observer = observer(prepared, design, samples, &mut course.notes)?;
    let mut estimator = SampledEstimator::new(&observer, method).map_err(Error::from_source)?;
    let count = design.observer.estimates.len();
    course.estimates = vec![vec![]; count];
    course.monitors = vec![vec![]; design.observer.monitors.len()];
    course.deviations = observer.errors.is_some().then(|| vec![vec![]; count]);
    course.ended = replay(&mut estimator, samples, &mut course, watch).err();
    let missing = estimator.missing().iter().zip(&design.observer.measured);
    for (missing, signal) in missing.filter(|(missing, _)| **missing > 0) {
        course.notes.push(format!(
            "{} has no reading in {missing} of {} rows: there the model stands in for the sensor",
            signal.name,
            samples.time.len()
        ));
    }
    Ok(course)
}

fn replay(
    estimator: &mut SampledEstimator,
    samples: &Samples<'_>,
    course: &mut Course,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(), RunError> {
    let count = course.estimates.len();
    for (k, &t) in samples.time.iter().enumerate() {
        let readings = Samples::row(&samples.readings, k);
        let reported = estimator.push(t, &readings, &Samples::row(&samples.inputs, k))?;
        add_row(&mut course.estimates, reported[..count].iter().copied());
        add_row(&mut course.monitors, reported[count..].iter().copied());
        if let (Some(columns), Some(row)) = (&mut course.deviations, estimator.deviations()) {
            add_row(columns, row.iter().copied());
        }
        if watch((k + 1) as f64 / samples.time.len() as f64).is_break() {
            return Err(RunError::Cancelled { time: t });
        }
    }
    Ok(())
}

fn observer(
    prepared: &Prepared<'_>,
    design: &Design,
    samples: &Samples<'_>,
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
    let monitors = observer.monitors.iter().map(|m| m.node);
    let reported = estimates.iter().copied().chain(monitors).chain(outputs);
    let reported: Vec<(String, Node)> = reported.map(|node| (String::new(), node)).collect();
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
        sensors: design.observer.measured.len(),
        predict: study.estimate.between_samples == BetweenSamples::Predict,
        errors,
    })
}

/// The noises on the observer's states: those of the plant on its estimate, which comes first,
/// and none on what the gain needs.
fn error_noise(
    study: &Study,
    prepared: &Prepared<'_>,
    states: &[(String, Node, f64)],
    samples: &Samples<'_>,
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
