//! A log through a Kalman filter.

use std::ops::ControlFlow;

use lynkeus_observers::{Design, FilterTuning, Signal};
use lynkeus_run::filter::{
    Filter, FilterModel, FilterPlant, FilterSettings, Health, Limits, Sensor, Smoothed,
};
use lynkeus_run::{Error as RunError, EstimatorSettings};
use lynkeus_structure::Extended;

use crate::study::{Name, Smoothing};
use crate::{Error, Study};

mod noise;

/// Samples for a filter: what each sensor and each known input reads, NaN where it does not.
pub(crate) struct Samples<'a> {
    pub time: &'a [f64],
    /// one per measured output
    pub readings: Vec<&'a [f64]>,
    /// one per known input
    pub inputs: Vec<&'a [f64]>,
}

/// What a filter makes of its samples.
pub(crate) struct Filtered {
    /// by estimate, then by row
    pub estimates: Vec<Vec<f64>>,
    /// their standard deviations
    pub deviations: Vec<Vec<f64>>,
    /// the smoother's, where it was asked for
    pub smoothed: Option<Vec<Smoothed>>,
    /// what the model expects of each sensor, before the correction
    pub predicted: Vec<Vec<f64>>,
    pub health: Health,
    /// what was chosen for the user
    pub notes: Vec<String>,
    /// why the run ended early, with the rows before
    pub ended: Option<RunError>,
}

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
) -> Result<Filtered, Error> {
    let Some(tuning) = &design.observer.filter else {
        return Err(Error::input("this observer is no filter").at(&study.file));
    };
    let mut notes = vec![];
    let model = model(study, extended, design, tuning, samples, &mut notes)?;
    let settings_of_filter = FilterSettings {
        kind: tuning.kind,
        gate: tuning.gate,
        keep_history: study.estimate.smoothing.is_some(),
    };
    let mut filter =
        Filter::new(&model, settings_of_filter, settings).map_err(Error::from_source)?;
    let n = model.dimension();
    let mut found = Filtered {
        estimates: vec![vec![]; n],
        deviations: vec![vec![]; n],
        smoothed: None,
        predicted: vec![vec![]; model.sensors().len()],
        health: Health::default(),
        notes,
        ended: None,
    };
    found.ended = replay(&mut filter, samples, &mut found, watch).err();
    found.health = filter.health().clone();
    found.smoothed = match study.estimate.smoothing {
        None => None,
        Some(Smoothing::Interval) => filter.smoothed(),
        Some(Smoothing::Lag(lag)) => filter.smoothed_with_lag(lag),
    };
    Ok(found)
}

fn replay(
    filter: &mut Filter,
    samples: &Samples<'_>,
    found: &mut Filtered,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<(), RunError> {
    let row = |columns: &[&[f64]], k: usize| columns.iter().map(|c| c[k]).collect::<Vec<f64>>();
    for (k, &t) in samples.time.iter().enumerate() {
        filter.push(t, &row(&samples.readings, k), &row(&samples.inputs, k))?;
        let push = |into: &mut [Vec<f64>], values: &mut dyn Iterator<Item = f64>| {
            into.iter_mut()
                .zip(values)
                .for_each(|(column, x)| column.push(x));
        };
        push(&mut found.estimates, &mut filter.estimate().iter().copied());
        push(
            &mut found.deviations,
            &mut filter.deviations().iter().copied(),
        );
        let expected = filter.innovations().iter().map(|i| i.predicted);
        push(&mut found.predicted, &mut expected.into_iter());
        if watch((k + 1) as f64 / samples.time.len() as f64).is_break() {
            return Err(RunError::Cancelled { time: t });
        }
    }
    Ok(())
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
    };
    FilterModel::new(&plant).map_err(Error::from_source)
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
