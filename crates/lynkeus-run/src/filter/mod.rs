//! Kalman filters: estimates that are corrected when sensors report.
//!
//! Between samples a [`Filter`] lets the plant's own equations run; at a sample every sensor
//! that reports corrects the estimate, by as much as its noise and the estimate's
//! covariance P say. P is held as a root S, P = S Sᵀ, and only ever changed as a root:
//! rounding cannot make it indefinite.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_run::filter::{Filter, FilterKind, FilterModel, FilterPlant, FilterSettings, Sensor};
//! use lynkeus_run::{EstimatorSettings, Level};
//!
//! // a level that nobody moves, measured with noise of standard deviation 1
//! let g = Graph::new();
//! let [time, x] = ["time", "x"].map(|name| g.symbol(name));
//! let model = FilterModel::new(&FilterPlant {
//!     graph: &g,
//!     time: time.node(),
//!     states: vec![("x".into(), x.node(), 0.0)],
//!     derivatives: vec![g.constant(0.0).node()],
//!     inputs: vec![],
//!     sensors: vec![Sensor { name: "y".into(), output: x.node(), noise: Level::Absolute(1.0), limits: None }],
//!     process_noise: vec![0.0],
//!     initial_variance: vec![1.0],
//!     confined: None,
//! })?;
//! let mut filter = Filter::new(&model, FilterSettings::of(FilterKind::Extended), EstimatorSettings::default())?;
//! filter.push(0.0, &[3.0], &[])?;
//! assert!((filter.estimate()[0] - 1.5).abs() < 1e-12);
//! // no reading, no correction
//! filter.push(1.0, &[f64::NAN], &[])?;
//! filter.push(2.0, &[4.5], &[])?;
//! assert!((filter.estimate()[0] - 2.5).abs() < 1e-12);
//! assert!((filter.deviations()[0] - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12);
//! # Ok::<(), lynkeus_run::Error>(())
//! ```

mod doubling;
pub(crate) mod extended;
mod flow;
mod health;
mod horizon;
mod model;
mod nodes;
pub(crate) mod root;
mod sensing;
mod smooth;
mod spanned;
mod taylor;
mod unscented;
mod variation;

pub use health::{Health, Innovation, Reading, SensorHealth};
pub use model::{Confined, FilterModel, FilterPlant, Limits, Sensor};
pub use smooth::Smoothed;
pub use unscented::SigmaPoints;

use crate::divergence::Bound;
use crate::{Error, EstimatorSettings};
use extended::Extended;
use horizon::Horizon;
use model::ConfinedFlow;
use root::{Packed, Root};
use sensing::Sensing;
use smooth::{History, Step};
use spanned::Rows;
use unscented::Unscented;

/// Which filter.
#[derive(Clone, Debug, PartialEq)]
pub enum FilterKind {
    /// the extended Kalman filter, continuous-discrete: the covariance follows the plant's
    /// linearisation along the estimate
    Extended,
    /// the unscented Kalman filter: sigma points follow the plant
    Unscented(SigmaPoints),
    /// moving-horizon estimation over so many samples, the states within bounds (one pair per
    /// state)
    MovingHorizon(usize, Vec<Bounds>),
}

/// Where a state can be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bounds {
    /// smallest value
    pub low: f64,
    /// largest value
    pub high: f64,
}

/// How a filter works.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterSettings {
    /// which filter
    pub kind: FilterKind,
    /// a reading whose innovation exceeds so many of its standard deviations is rejected
    pub gate: Option<f64>,
    /// keep what a smoother needs
    pub keep_history: bool,
}

impl FilterSettings {
    /// No gate, no history.
    #[must_use]
    pub fn of(kind: FilterKind) -> Self {
        Self {
            kind,
            gate: None,
            keep_history: false,
        }
    }
}

/// What is believed of the state: its mean and a root of its covariance.
#[derive(Clone, Debug)]
pub(crate) struct Belief {
    pub(crate) x: Vec<f64>,
    pub(crate) root: Root,
}

#[derive(Clone, Debug)]
enum Engine {
    Extended(Box<Extended>),
    Unscented(Box<Unscented>),
    MovingHorizon(Box<Horizon>),
}

/// For intervals on which the plant has no value where the estimate is.
#[derive(Clone, Debug)]
struct Spare {
    engine: Extended,
    bounds: Vec<Bounds>,
}

/// A filter that takes one sample after the other, live or from a log.
#[derive(Clone, Debug)]
pub struct Filter {
    engine: Engine,
    /// the same inside the declared ranges
    spare: Option<Spare>,
    belief: Belief,
    sensing: Sensing,
    inputs: Vec<f64>,
    deviations: Vec<f64>,
    time: Option<f64>,
    samples: usize,
    bound: Bound,
    history: Option<History>,
}

impl Filter {
    /// A filter at the plant's first estimate, waiting for the first sample.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method, the gate or the sigma points.
    pub fn new(
        model: &FilterModel,
        settings: FilterSettings,
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        if let Some(gate) = settings.gate
            && !(gate > 0.0 && gate.is_finite())
        {
            return Err(Error::setting(
                "gate",
                "a number of standard deviations above 0",
                gate,
            ));
        }
        let engine = match settings.kind {
            FilterKind::Extended => Engine::Extended(Box::new(Extended::new(
                &model.flow,
                &model.flow_entries,
                &model.process_noise,
                run,
            )?)),
            FilterKind::Unscented(points) => {
                Engine::Unscented(Box::new(Unscented::new(model, points, run)?))
            }
            FilterKind::MovingHorizon(length, bounds) => {
                Engine::MovingHorizon(Box::new(Horizon::new(model, length, bounds, run)?))
            }
        };
        let x = model.flow.start().to_vec();
        let spare = match &model.confined {
            None => None,
            Some(ConfinedFlow {
                flow,
                entries,
                bounds,
            }) => Some(Spare {
                engine: Extended::new(flow, entries, &model.process_noise, run)?,
                bounds: bounds.clone(),
            }),
        };
        Ok(Self {
            engine,
            spare,
            deviations: model.initial_variance.iter().map(|v| v.sqrt()).collect(),
            belief: Belief {
                root: Root::diagonal(&model.initial_variance),
                x: x.clone(),
            },
            sensing: Sensing::new(model, settings.gate),
            inputs: vec![0.0; model.inputs().len()],
            time: None,
            samples: 0,
            bound: Bound::new(&x),
            history: settings.keep_history.then(History::default),
        })
    }

    /// Takes the readings at `t`, in the order of the sensors, with the known inputs in the
    /// order of [`FilterModel::inputs`], and returns the estimate after its correction. A
    /// reading that is not finite says that this sensor did not report; of an input that is
    /// not finite the last value holds. The first sample corrects the first estimate; one at
    /// the time of the sample before corrects again.
    ///
    /// # Errors
    /// [`Error::TimeOrder`], [`Error::NotANumber`] for the first value of an input,
    /// [`Error::Setting`] for wrong numbers of values; [`Error::Diverged`],
    /// [`Error::NotFinite`] and the errors of the integration.
    pub fn push(&mut self, t: f64, readings: &[f64], inputs: &[f64]) -> Result<&[f64], Error> {
        self.samples += 1;
        let next = self.checked(t, readings, inputs)?;
        self.bound.see(&self.inputs);
        let transition = match self.time {
            Some(before) if t > before => Some(self.predict(before, t, &next)?),
            Some(_) => None,
            None => {
                self.start(&next);
                None
            }
        };
        self.inputs = next;
        self.arrive();
        self.time = Some(t);
        self.correct(t, readings)?;
        let corrections = self.sensing.take_corrections();
        if let Some(history) = &mut self.history {
            history.push(Step {
                transition,
                x: self.belief.x.clone(),
                root: Packed::of(&self.belief.root),
                corrections,
            });
        }
        self.report(t)
    }

    /// The estimate after the last sample.
    #[must_use]
    pub fn estimate(&self) -> &[f64] {
        &self.belief.x
    }

    /// Its standard deviations √P_ii.
    #[must_use]
    pub fn deviations(&self) -> &[f64] {
        &self.deviations
    }

    /// What became of the last readings, one per sensor.
    #[must_use]
    pub fn innovations(&self) -> &[Innovation] {
        &self.sensing.innovations
    }

    /// How readings and estimate went together so far.
    #[must_use]
    pub fn health(&self) -> &Health {
        &self.sensing.health
    }

    /// Time of the last sample.
    #[must_use]
    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// The fixed-interval smoother over everything so far: the estimate at each sample given
    /// all of them, with standard deviations if asked for; none without history.
    #[must_use]
    pub fn smoothed(&self, deviations: bool) -> Option<Vec<Smoothed>> {
        let history = self.history.as_ref()?;
        Some(history.smoothed(None, deviations))
    }

    /// The fixed-lag smoother: the estimate at each sample given those up to `lag` later.
    #[must_use]
    pub fn smoothed_with_lag(&self, lag: usize, deviations: bool) -> Option<Vec<Smoothed>> {
        let history = self.history.as_ref()?;
        Some(history.smoothed(Some(lag), deviations))
    }

    /// The inputs to come, the last value where there is none.
    fn checked(&mut self, t: f64, readings: &[f64], inputs: &[f64]) -> Result<Vec<f64>, Error> {
        let wrong = |what: &str, expected: usize, found: usize| {
            Error::setting(format!("number of {what}"), expected.to_string(), found)
        };
        if readings.len() != self.sensing.count() {
            return Err(wrong("readings", self.sensing.count(), readings.len()));
        }
        if inputs.len() != self.inputs.len() {
            return Err(wrong("known inputs", self.inputs.len(), inputs.len()));
        }
        if !t.is_finite() {
            return Err(Error::NotANumber {
                row: self.samples,
                column: "t".to_owned(),
                value: t,
            });
        }
        if let Some(previous) = self.time.filter(|previous| t < *previous) {
            return Err(Error::TimeOrder {
                row: self.samples,
                previous,
                time: t,
            });
        }
        let mut next = inputs.to_vec();
        for (i, u) in next.iter_mut().enumerate().filter(|(_, u)| !u.is_finite()) {
            if self.time.is_none() {
                return Err(Error::NotANumber {
                    row: self.samples,
                    column: self.sensing.inputs()[i].clone(),
                    value: *u,
                });
            }
            *u = self.inputs[i];
            self.sensing.health.inputs_held += 1;
        }
        Ok(next)
    }

    fn start(&mut self, inputs: &[f64]) {
        match &mut self.engine {
            Engine::Extended(engine) => engine.driven.start(inputs),
            Engine::Unscented(engine) => engine.driven.start(inputs),
            Engine::MovingHorizon(horizon) => horizon.engine.driven.start(inputs),
        }
    }

    fn arrive(&mut self) {
        match &mut self.engine {
            Engine::Extended(engine) => engine.driven.arrive(),
            Engine::Unscented(engine) => engine.driven.arrive(),
            Engine::MovingHorizon(horizon) => horizon.engine.driven.arrive(),
        }
    }

    /// To the next sample; the transition is what the smoother needs of it. Where the plant has no
    /// value on the way, inside the declared ranges.
    fn predict(&mut self, from: f64, to: f64, inputs: &[f64]) -> Result<Rows, Error> {
        match (self.run_flow(from, to, inputs), &mut self.spare) {
            (Err(error), Some(spare)) if is_undefined(&error) => {
                // a flow that failed has left the belief as it was
                self.sensing.health.confined += 1;
                confine(&mut self.belief.x, &spare.bounds);
                let driven = &mut spare.engine.driven;
                driven.start(&self.inputs);
                driven.aim(from, to, inputs);
                let keep = self.history.is_some();
                spare.engine.predict(&mut self.belief, from, to, keep)
            }
            (result, _) => result,
        }
    }

    fn run_flow(&mut self, from: f64, to: f64, inputs: &[f64]) -> Result<Rows, Error> {
        let keep = self.history.is_some();
        match &mut self.engine {
            Engine::Extended(engine) => {
                engine.driven.aim(from, to, inputs);
                engine.predict(&mut self.belief, from, to, keep)
            }
            Engine::Unscented(engine) => {
                engine.driven.aim(from, to, inputs);
                engine.predict(&mut self.belief, from, to, keep)
            }
            Engine::MovingHorizon(horizon) => {
                horizon.engine.driven.aim(from, to, inputs);
                horizon.engine.predict(&mut self.belief, from, to, keep)
            }
        }
    }

    fn correct(&mut self, t: f64, readings: &[f64]) -> Result<(), Error> {
        match self.correct_here(t, readings) {
            // the outputs are evaluated before a reading is counted; a window keeps its states
            // inside anyway
            Err(error)
                if is_undefined(&error) && !matches!(self.engine, Engine::MovingHorizon(_)) =>
            {
                let Some(spare) = &self.spare else {
                    return Err(error);
                };
                self.sensing.health.confined += 1;
                confine(&mut self.belief.x, &spare.bounds);
                self.correct_here(t, readings)
            }
            result => result,
        }
    }

    fn correct_here(&mut self, t: f64, readings: &[f64]) -> Result<(), Error> {
        let Self {
            sensing,
            belief,
            inputs,
            engine,
            ..
        } = self;
        match engine {
            Engine::Extended(_) => extended::correct(sensing, belief, t, readings, inputs),
            Engine::Unscented(engine) => engine.correct(sensing, belief, t, readings, inputs),
            Engine::MovingHorizon(horizon) => horizon.correct(sensing, belief, t, readings, inputs),
        }
    }

    fn report(&mut self, t: f64) -> Result<&[f64], Error> {
        let names = self.sensing.states();
        self.bound.check(t, names, &self.belief.x, String::new)?;
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            *deviation = self.belief.root.deviation(i);
        }
        match self.deviations.iter().position(|d| !d.is_finite()) {
            None => Ok(&self.belief.x),
            Some(i) => Err(Error::Diverged {
                time: t,
                name: format!("standard deviation of {}", names[i]),
                value: self.deviations[i],
                hint: "; give smaller values in initial_variance or [process_noise]".to_owned(),
            }),
        }
    }
}

/// Whether the plant has no value where it was asked for.
fn is_undefined(error: &Error) -> bool {
    matches!(
        error,
        Error::NotFinite { .. } | Error::StepUnderflow { .. } | Error::Diverged { .. }
    )
}

fn confine(x: &mut [f64], bounds: &[Bounds]) {
    for (x, bounds) in x.iter_mut().zip(bounds) {
        *x = x.max(bounds.low).min(bounds.high);
    }
}

#[cfg(test)]
mod tests;
