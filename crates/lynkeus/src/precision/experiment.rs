//! From a study to the experiment that is judged.

use std::ops::ControlFlow;

use lynkeus_expr::Node;
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_observability::precision::{Deviation, Experiment, Quantity, Sensor, Window};
use lynkeus_run::{Method, Tolerances};
use lynkeus_structure::AugmentedPlant;

use crate::{Error, Study};
use lynkeus_experiment::course::plant::{alone, open_loop};
use lynkeus_experiment::course::recorded::Recorded;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::Declared;
use lynkeus_experiment::prepare::systems;
use lynkeus_experiment::words::number;
use lynkeus_study::{Noise, SimulateSettings};

/// Horizons at which the errors are computed.
const POINTS: usize = 25;

/// What else is asked.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Options {
    /// Length of the longest horizon in the plant's unit of time; the whole run where left out.
    pub horizon: Option<f64>,
    /// Which sensors to try beside the study's.
    pub sensors: Option<Candidates>,
}

/// Sensors that could be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Candidates {
    /// Every output of the model.
    Outputs,
    /// Every output and every state of the model.
    All,
}

/// A sensor as it was assumed.
#[derive(Clone, Debug, PartialEq)]
pub struct Assumed {
    /// Its name.
    pub name: String,
    /// Its noise in words.
    pub noise: String,
    /// Whether the study states the noise.
    pub is_stated: bool,
}

/// What ended the work, if anything did.
pub(super) fn ended(study: &Study) -> Option<Error> {
    let spent = study.budget.spent()?;
    Some(Error::ended(spent).at(&study.file))
}

/// Noise where the study states none, as a share of the range.
const SHARE: f64 = 0.01;

/// A noise relative to the value does not fall below this share of what it is at the greatest value.
const LEAST: f64 = 1e-3;

/// The experiment, with what was assumed for it.
pub(super) struct Setup<'p> {
    pub experiment: Experiment<'p>,
    /// of every sensor
    pub assumed: Vec<Assumed>,
    /// how many of the sensors are the study's; they come first
    pub measured: usize,
}

impl<'p> Setup<'p> {
    pub fn new(
        prepared: &Prepared<'p>,
        settings: &SimulateSettings,
        options: &Options,
    ) -> Result<Self, Error> {
        let (study, augmented) = (prepared.study(), prepared.augmented());
        let plant = augmented.plant;
        let mut run = open_loop(study, settings, plant)?;
        let step = settings.sample_step.unwrap_or(run.output_step);
        let span = horizon(study, settings, options, step)?;
        run.until = run.start + span;
        run.noise = lynkeus_run::Noise::default();
        let go_on = &mut |_| ControlFlow::Continue(());
        let run_alone = alone(study, &run, go_on)?;
        let reach = Reach {
            plant,
            run: run_alone,
        };
        let measured: Vec<Variable> = augmented
            .outputs
            .iter()
            .filter_map(|o| plant.outputs.iter().find(|p| p.name == o.variable.name))
            .cloned()
            .collect();
        let sensors = Sensors::new(prepared.declared(), augmented, &measured, &reach);
        let others = candidates(plant, &measured, options.sensors);
        let all = measured.iter().chain(&others).map(|v| sensors.sensor(v));
        let (judged, assumed): (Vec<Sensor>, Vec<Assumed>) = all.unzip();
        let start = |name: &str| {
            let place = run.plant.states().iter().position(|s| s == name);
            place.map_or(0.0, |i| run.plant.start()[i])
        };
        let quantity = |v: &Variable| Quantity {
            name: v.name.clone(),
            node: v.node,
            start: start(&v.name),
            scale: reach.scale(v),
            is_known: v.discrete,
        };
        let inputs: Vec<Node> = plant.inputs.iter().map(|i| i.node).collect();
        let courses = systems::input_expressions(study, plant, settings)?;
        let (states, unknown) = augmented.states.split_at(augmented.plant_states());
        let window = Window::log_spaced(run.start, span, step, POINTS);
        Ok(Self {
            experiment: Experiment {
                states: states.iter().map(quantity).collect(),
                derivatives: plant.derivatives.clone(),
                whens: plant.whens.clone(),
                unknown: unknown.iter().map(quantity).collect(),
                inputs: inputs
                    .into_iter()
                    .zip(courses.into_iter().map(|c| c.1))
                    .collect(),
                sensors: judged,
                method: sharp(run.method),
                ..Experiment::new(&plant.graph, plant.time, window)
            },
            assumed,
            measured: measured.len(),
        })
    }
}

/// Sensitivities have an accuracy of their own, however coarse the run is: what is seen hangs on it.
fn sharp(method: Method) -> Method {
    let sharper = |t: Tolerances| Tolerances {
        relative: t.relative.min(1e-10),
        absolute: t.absolute.min(1e-12),
        ..t
    };
    match method {
        Method::Adaptive(t) => Method::Adaptive(sharper(t)),
        Method::Explicit(t) => Method::Explicit(sharper(t)),
        Method::Stiff(t) => Method::Stiff(sharper(t)),
        Method::Rk4(step) => Method::Rk4(step),
    }
}

/// The longest horizon.
fn horizon(
    study: &Study,
    settings: &SimulateSettings,
    options: &Options,
    step: f64,
) -> Result<f64, Error> {
    let span = settings.until - settings.start;
    let asked = options.horizon.unwrap_or(span);
    // a horizon that is the whole run up to rounding is the whole run
    if asked >= step && asked <= span * (1.0 + 1e-9) {
        return Ok(asked.min(span));
    }
    let message = format!(
        "the horizon: expected a time from one sample step, {}, to the length of the run, {}, found {asked}",
        number(step),
        number(span)
    );
    Err(Error::input(message)
        .at(&study.file)
        .hint("choose another --horizon, or `until` and `sample_step` of [simulate]"))
}

/// The model's outputs that the study does not measure, and its states that no output shows.
fn candidates(plant: &Plant, measured: &[Variable], asked: Option<Candidates>) -> Vec<Variable> {
    let outputs = plant.outputs.iter().filter(|o| !measured.contains(o));
    let shown = |s: &&Variable| plant.outputs.iter().any(|o| o.node == s.node);
    let states = plant.states.iter().filter(|s| !shown(s));
    match asked {
        None => vec![],
        Some(Candidates::Outputs) => outputs.cloned().collect(),
        Some(Candidates::All) => outputs.chain(states).cloned().collect(),
    }
}

/// How far values go along the run.
struct Reach<'p> {
    plant: &'p Plant,
    run: Recorded,
}

impl Reach<'_> {
    /// The greatest magnitude of a state, an input or an output.
    fn magnitude(&self, variable: &Variable) -> f64 {
        let column = systems::column_of(self.plant, variable);
        let values = column.and_then(|column| self.run.column(column));
        values
            .into_iter()
            .flatten()
            .map(f64::abs)
            .fold(0.0, f64::max)
    }

    /// The declared range, else the greatest magnitude, else 1.
    fn scale(&self, variable: &Variable) -> f64 {
        let range = match variable.home {
            Home::Circle { .. } => std::f64::consts::TAU,
            _ => variable.max - variable.min,
        };
        if range.is_finite() && range > 0.0 {
            return range;
        }
        match self.magnitude(variable) {
            0.0 => 1.0,
            magnitude => magnitude,
        }
    }
}

/// √(a²/3): the standard deviation of an error that is equally likely from −a to a.
fn deviation_of_uniform(bound: f64) -> f64 {
    bound / 3f64.sqrt()
}

/// How noisy sensors are.
struct Sensors<'a> {
    declared: &'a Declared,
    states: &'a [Variable],
    reach: &'a Reach<'a>,
    /// of a sensor that the study says nothing of
    usual: Noise,
}

impl<'a> Sensors<'a> {
    /// A sensor of unknown noise is as noisy as the measured ones are on average (geometric mean):
    /// relative to its value where all of these are, else to its range.
    fn new(
        declared: &'a Declared,
        augmented: &'a AugmentedPlant<'_>,
        measured: &[Variable],
        reach: &'a Reach<'a>,
    ) -> Self {
        let mut sensors = Self {
            declared,
            states: &augmented.states,
            reach,
            usual: Noise::Absolute(SHARE),
        };
        let stated: Vec<Option<Noise>> = measured.iter().map(|v| sensors.stated(v)).collect();
        let share = |(v, noise): (&Variable, &Option<Noise>)| match noise {
            Some(Noise::Relative(share)) => *share,
            Some(Noise::Absolute(deviation)) => deviation / sensors.scale(v),
            Some(Noise::Uniform(bound)) => deviation_of_uniform(*bound) / sensors.scale(v),
            None => SHARE,
        };
        let logs: f64 = measured.iter().zip(&stated).map(share).map(f64::ln).sum();
        let mean = (logs / measured.len().max(1) as f64).exp();
        let is_relative = |noise: &Option<Noise>| matches!(noise, Some(Noise::Relative(_)));
        sensors.usual = match stated.iter().all(is_relative) {
            true => Noise::Relative(mean),
            false if stated.iter().all(Option::is_none) => Noise::Absolute(SHARE),
            false => Noise::Absolute(mean),
        };
        sensors
    }

    /// The noise in the study; one of zero would tell everything and counts as not stated.
    fn stated(&self, variable: &Variable) -> Option<Noise> {
        let noise = self.declared.noise.of(&variable.name).copied();
        noise.filter(|noise| noise.size() > 0.0)
    }

    /// The range of an output, else that of the state that it shows.
    fn scale(&self, variable: &Variable) -> f64 {
        let state = self.states.iter().find(|s| s.node == variable.node);
        let is_bounded = (variable.max - variable.min).is_finite();
        match state {
            Some(state) if !is_bounded => self.reach.scale(state),
            _ => self.reach.scale(variable),
        }
    }

    fn sensor(&self, variable: &Variable) -> (Sensor, Assumed) {
        let limits = self.declared.limits.of(&variable.name).copied();
        let stated = self.stated(variable);
        let noise = match (stated, self.usual) {
            (Some(noise), _) => noise,
            (None, Noise::Absolute(share)) => Noise::Absolute(share * self.scale(variable)),
            (None, relative) => relative,
        };
        let (deviation, mut words) = match noise {
            Noise::Absolute(deviation) => (
                Deviation::Absolute(deviation),
                format!("±{}", number(deviation)),
            ),
            Noise::Uniform(bound) => {
                let deviation = deviation_of_uniform(bound);
                let words = format!("±{} (even within ±{})", number(deviation), number(bound));
                (Deviation::Absolute(deviation), words)
            }
            Noise::Relative(share) => {
                let greatest = match self.reach.magnitude(variable) {
                    0.0 => self.scale(variable),
                    magnitude => magnitude,
                };
                let least = LEAST * share * greatest;
                let words = format!("±{} % of its value", number(100.0 * share));
                (Deviation::Relative { share, least }, words)
            }
        };
        let sensor = Sensor {
            name: variable.name.clone(),
            node: variable.node,
            noise: deviation,
            limits,
        };
        if let Some(limits) = limits {
            words += &format!(", from {} to {}", number(limits.low), number(limits.high));
        }
        let assumed = Assumed {
            name: variable.name.clone(),
            noise: words,
            is_stated: stated.is_some(),
        };
        (sensor, assumed)
    }
}
