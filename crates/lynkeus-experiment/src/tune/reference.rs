//! What every value of a sweep in simulation is judged against: scales, jumps, and the noise.

use std::collections::BTreeMap;
use std::ops::ControlFlow;

use lynkeus_expr::Node;
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_run::{Column, Events, Level, Noise, Role};

use crate::course::plant::{alone, open_loop};
use crate::course::recorded::Recorded;
use crate::prepare::Prepared;
use crate::prepare::systems;
use crate::prepare::systems::settings;
use crate::words::explain;
use crate::{Error, Study};

/// Noise where the study states none, as a share of what the output spans in the run.
const DEFAULT_NOISE: f64 = 0.01;

/// By state, input and output: what an error of 1 is, in the quantity's unit.
#[derive(Clone, Debug)]
struct Scales {
    states: Vec<f64>,
    inputs: Vec<f64>,
    outputs: Vec<f64>,
}

/// The same for every value of the sweep.
#[derive(Clone, Debug)]
pub(super) struct Reference {
    scales: Scales,
    /// the start, and every instant at which an input that the observer does not read jumps
    pub starts: Vec<f64>,
    /// from here on, nothing of a start or a jump should be left
    pub tail: f64,
    /// the noise of the noisy run
    pub noise: Noise,
    /// time between two samples of the sensor
    pub sample_step: f64,
    /// what the user should know
    pub notes: Vec<String>,
}

impl Reference {
    /// Runs the plant alone.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn new(prepared: &Prepared<'_>) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let settings = settings(study)?;
        let mut open = open_loop(study, settings, plant)?;
        let stated = std::mem::take(&mut open.noise);
        let truth = alone(study, &open, &mut |_| ControlFlow::Continue(()))?;
        let scales = scales(plant, &truth);
        let starts = starts(study, plant)?;
        let last = starts.last().copied().unwrap_or(settings.start);
        let mut notes = vec![];
        let measured = prepared.augmented().outputs.iter();
        let measured: Vec<&str> = measured.map(|o| o.variable.name.as_str()).collect();
        let noise = noise(stated, plant, &measured, &truth, &mut notes);
        Ok(Self {
            tail: (last + settings.until) / 2.0,
            sample_step: noise.sample_step.unwrap_or(open.output_step),
            scales,
            starts,
            noise,
            notes,
        })
    }

    /// Sensors without noise, which still show no more than their ranges.
    pub fn exact(&self) -> Noise {
        Noise {
            limits: self.noise.limits.clone(),
            ..Noise::default()
        }
    }

    /// What an error of 1 is, of what a column of a run of the plant holds.
    pub fn scale(&self, column: Column) -> f64 {
        let scales = match column.role {
            Role::State => &self.scales.states,
            Role::Input => &self.scales.inputs,
            _ => &self.scales.outputs,
        };
        scales.get(column.index).copied().unwrap_or(1.0)
    }
}

/// The declared range, else the largest magnitude in the run, else 1. An output that shows a
/// state takes that state's.
fn scales(plant: &Plant, truth: &Recorded) -> Scales {
    let scale = |variable: &Variable, column: Column| {
        let range = match variable.home {
            Home::Circle { .. } => std::f64::consts::TAU,
            _ => variable.max - variable.min,
        };
        if range.is_finite() && range > 0.0 {
            return range;
        }
        let values = truth.column(column).into_iter().flatten();
        let largest = values.fold(0.0, |m: f64, x| m.max(x.abs()));
        if largest > 0.0 { largest } else { 1.0 }
    };
    let shown = |output: &Variable, column: Column| {
        let state = plant.states.iter().find(|s| s.node == output.node);
        scale(state.unwrap_or(output), column)
    };
    let of = |variables: &[Variable], role: Role, scale: &dyn Fn(&Variable, Column) -> f64| {
        let places = variables.iter().enumerate();
        places.map(|(i, v)| scale(v, role.at(i))).collect()
    };
    Scales {
        states: of(&plant.states, Role::State, &scale),
        inputs: of(&plant.inputs, Role::Input, &scale),
        outputs: of(&plant.outputs, Role::Output, &shown),
    }
}

/// The start, and where unknown inputs and disturbances jump or have a kink.
fn starts(study: &Study, plant: &Plant) -> Result<Vec<f64>, Error> {
    let settings = settings(study)?;
    let sensors = &study.sensors;
    let unread = |name: &str| {
        let mut names = sensors.unknown.iter().chain(&sensors.disturbances);
        names.any(|n| n.is_or_has(name))
    };
    let inputs = systems::input_expressions(study, plant, settings)?;
    let inputs: Vec<(String, Node)> = inputs.into_iter().filter(|(n, _)| unread(n)).collect();
    let mut instants = vec![settings.start];
    systems::of_time(plant, &inputs)?
        .evaluation()
        .instants(settings.start, settings.until, &mut instants)
        .map_err(|error| explain(error).at(&study.file))?;
    instants.sort_by(f64::total_cmp);
    instants.dedup();
    Ok(instants)
}

/// The study's noise, or 1 % of what each measured output spans.
fn noise(
    stated: Noise,
    plant: &Plant,
    measured: &[&str],
    truth: &Recorded,
    notes: &mut Vec<String>,
) -> Noise {
    let is_noisy = |name: &&str| {
        let level = stated.levels.get(*name);
        level.is_some_and(|level| level.size() > 0.0)
    };
    if measured.iter().any(is_noisy) {
        return stated;
    }
    let outputs = plant.outputs.iter().enumerate();
    let outputs = outputs.filter(|(_, o)| measured.contains(&o.name.as_str()));
    let level = |(place, output): (usize, &Variable)| {
        let values = || truth.column(Role::Output.at(place)).into_iter().flatten();
        let low = values().fold(f64::INFINITY, f64::min);
        let high = values().fold(f64::NEG_INFINITY, f64::max);
        let span = if high > low { high - low } else { high.abs() };
        (output.name.clone(), Level::Absolute(DEFAULT_NOISE * span))
    };
    let levels: BTreeMap<String, Level> = outputs.map(level).collect();
    let words: Vec<String> = levels
        .iter()
        .map(|(name, level)| format!("{name} {:.2e}", level.size()))
        .collect();
    notes.push(format!(
        "the study states no noise: 1 % of what each output spans in the run is taken ({}); set `noise` in [sensors] to state yours",
        words.join(", ")
    ));
    Noise { levels, ..stated }
}
