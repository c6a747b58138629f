//! What a simulation or a replay gives.

use lynkeus_model::Plant;
use lynkeus_observers::{Design, Monitor};
use lynkeus_run::{Error as RunError, Trajectory};

use crate::Error;
use crate::systems::hat;

/// One quantity of the result with everything that is known of it.
#[derive(Clone, Debug, Default)]
pub struct Quantity {
    /// name in the plant
    pub name: String,
    /// unit, if declared
    pub unit: Option<String>,
    /// description, if declared
    pub description: Option<String>,
    /// what it truly is: simulated, or logged although it is not used
    pub truth: Option<Vec<f64>>,
    /// what the sensor reads
    pub measured: Option<Vec<f64>>,
    /// what the observer makes of it
    pub estimate: Option<Vec<f64>>,
    /// an input that nobody measures
    pub unknown_input: bool,
    /// an input of the plant
    pub is_input: bool,
}

impl Quantity {
    /// √(mean (estimate − truth)²) over the last half of the rows.
    pub fn settled_error(&self) -> Option<f64> {
        let (truth, estimate) = (self.truth.as_ref()?, self.estimate.as_ref()?);
        let half = truth.len() / 2;
        let pairs = truth.iter().zip(estimate).skip(half);
        let squares: Vec<f64> = pairs.map(|(x, hat)| (hat - x).powi(2)).collect();
        let mean = squares.iter().sum::<f64>() / squares.len().max(1) as f64;
        Some(mean.sqrt())
    }
}

/// The trust in an estimate over time, and whether it was ever lost.
#[derive(Clone, Debug)]
pub struct Watch {
    /// the monitor
    pub monitor: Monitor,
    /// its values
    pub values: Vec<f64>,
    /// first time at which it was below its alarm
    pub alarm: Option<f64>,
}

/// Rows over time.
#[derive(Debug)]
pub struct Outcome {
    /// name of the plant
    pub plant: String,
    /// the observer that ran
    pub design: Design,
    /// times of the rows
    pub time: Vec<f64>,
    /// every state, input and measured output
    pub quantities: Vec<Quantity>,
    /// the measured outputs by name, noise included, where they are known
    pub measurements: Vec<(String, Vec<f64>)>,
    /// the observer's monitors
    pub watches: Vec<Watch>,
    /// what the user should know
    pub notes: Vec<String>,
}

impl Outcome {
    /// The columns of the CSV: `t`; true states and inputs where they were
    /// simulated; `<name>_hat` for everything estimated; monitors.
    pub fn columns(&self, with_truth: bool) -> Vec<(String, &[f64])> {
        let mut columns: Vec<(String, &[f64])> = vec![("t".to_owned(), &self.time)];
        for quantity in self.quantities.iter().filter(|_| with_truth) {
            if let Some(truth) = &quantity.truth {
                columns.push((quantity.name.clone(), truth));
            }
        }
        for quantity in &self.quantities {
            if let Some(estimate) = &quantity.estimate {
                columns.push((hat(&quantity.name), estimate));
            }
        }
        let watches = self.watches.iter();
        columns.extend(watches.map(|w| (w.monitor.name.clone(), &w.values[..])));
        columns
    }
}

/// The observer's monitors as they went.
pub(crate) fn watches(design: &Design, trajectory: &Trajectory) -> Vec<Watch> {
    let watch = |monitor: &Monitor| {
        let values = trajectory.column(&monitor.name).unwrap_or_default();
        let low = values.iter().position(|x| *x < monitor.alarm_below);
        let alarm = low.and_then(|row| trajectory.times().get(row).copied());
        Watch {
            monitor: monitor.clone(),
            values,
            alarm,
        }
    };
    design.observer.monitors.iter().map(watch).collect()
}

/// Alarms in words.
pub(crate) fn alarms(watches: &[Watch]) -> Vec<String> {
    let raised = watches.iter().filter_map(|w| Some((w, w.alarm?)));
    raised
        .map(|(w, t)| {
            let Monitor {
                name,
                alarm_below,
                meaning,
                ..
            } = &w.monitor;
            format!("{meaning}: {name} fell below {alarm_below} first at t = {t}")
        })
        .collect()
}

/// A run on a log that ended early; what is wrong with a setting is the study's fault, not the log's.
pub(crate) fn interrupted_on(error: RunError, log: &str, study: &str) -> Error {
    let is_setting = matches!(error, RunError::Setting { .. } | RunError::TooStiff { .. });
    interrupted(error, if is_setting { study } else { log })
}

/// A run that ended early: no result; an estimate that left every bound is an
/// answer, everything else is a fault of the input.
pub(crate) fn interrupted(error: RunError, place: &str) -> Error {
    let text = error.to_string();
    let told = match error {
        RunError::Diverged { .. } | RunError::NotFinite { .. } | RunError::StepUnderflow { .. } => {
            Error::refused(text)
        }
        _ => Error::input(text),
    };
    told.caused_by(error).at(place)
}

/// The measured outputs of which `values` knows the values.
pub(crate) fn measurements(
    design: &Design,
    values: impl Fn(&str) -> Option<Vec<f64>>,
) -> Vec<(String, Vec<f64>)> {
    let measured = design.observer.measured.iter();
    measured
        .filter_map(|signal| Some((signal.name.clone(), values(&signal.name)?)))
        .collect()
}

/// Puts each measurement beside the state it shows; one that shows none becomes
/// a quantity of its own.
pub(crate) fn show_measurements(
    plant: &Plant,
    measurements: &[(String, Vec<f64>)],
    quantities: &mut Vec<Quantity>,
) {
    for (name, values) in measurements {
        let Some(output) = plant.outputs.iter().find(|o| o.name == *name) else {
            continue;
        };
        let state = plant.states.iter().find(|s| s.node == output.node);
        let shown = state.and_then(|s| quantities.iter_mut().find(|q| q.name == s.name));
        match shown {
            Some(quantity) => quantity.measured = Some(values.clone()),
            None => quantities.push(Quantity {
                name: output.name.clone(),
                unit: output.unit.clone(),
                description: output.description.clone(),
                measured: Some(values.clone()),
                ..Quantity::default()
            }),
        }
    }
}
