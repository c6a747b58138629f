//! Kalman filters: estimates that are corrected when sensors report.
//!
//! Between samples a filter lets the plant's own equations run; at a sample every sensor
//! that reports corrects the estimate, by as much as its noise and the estimate's
//! covariance P say. P is held as a root S, P = S Sᵀ, and only ever changed as a root:
//! rounding cannot make it indefinite.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_run::filter::{FilterKind, FilterModel, FilterPlant, FilterSettings, Sensor};
//! use lynkeus_run::{Estimator, EstimatorSettings, Level};
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
//! let settings = FilterSettings::of(FilterKind::Extended);
//! let mut filter = Estimator::filter(&model, settings, EstimatorSettings::default())?;
//! filter.push(0.0, &[3.0])?;
//! assert!((filter.estimate()[0] - 1.5).abs() < 1e-12);
//! // no reading, no correction
//! filter.push(1.0, &[f64::NAN])?;
//! filter.push(2.0, &[4.5])?;
//! assert!((filter.estimate()[0] - 2.5).abs() < 1e-12);
//! let deviation = filter.deviations().map(|deviations| deviations[0]);
//! assert!((deviation.unwrap_or(0.0) - (1.0_f64 / 3.0).sqrt()).abs() < 1e-12);
//! # Ok::<(), lynkeus_run::Error>(())
//! ```

mod along;
mod censored;
mod curvature;
mod doubling;
pub(crate) mod extended;
mod factor;
mod flow;
mod health;
mod hindsight;
mod horizon;
mod model;
mod nodes;
mod persist;
mod project;
pub(crate) mod root;
mod sensing;
mod smooth;
mod spanned;
mod stage;
mod taylor;
mod unscented;
mod variation;

pub use crate::noise::Limits;
pub use health::{Health, Innovation, Reading, SensorHealth};
pub use model::{Confined, ConfinedFlow, FilterModel, FilterPlant, Sensor};
pub use smooth::Smoothed;
pub use unscented::{SigmaPoints, Weights};

use crate::divergence::{Bound, deviation_diverged};
use crate::runner::{Runner, Sample};
use crate::system::Driven;
use crate::{Error, EstimatorSettings};
use extended::Extended;
use horizon::Horizon;
use project::Projection;
use root::Root;
use sensing::Sensing;
use smooth::History;
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
    /// where the estimate is kept, one pair per state: after each prediction and correction it is
    /// put to the nearest such place by the covariance's metric. The covariance stays: a bound says where
    /// the estimate is, and not how sure it is
    pub bounds: Option<Vec<Bounds>>,
    /// readings are what the model shows, and only covariances are asked for: a sensor with limits
    /// counts as its readings do on average (Fisher's information of a clipped normal number)
    pub foresees: bool,
}

impl FilterSettings {
    /// No gate, no history, no bounds.
    #[must_use]
    pub fn of(kind: FilterKind) -> Self {
        Self {
            kind,
            gate: None,
            keep_history: false,
            bounds: None,
            foresees: false,
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

/// A filter under way.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    engine: Engine,
    /// the same inside the declared ranges
    spare: Option<Spare>,
    belief: Belief,
    projection: Option<Projection>,
    sensing: Sensing,
    inputs: Vec<f64>,
    deviations: Vec<f64>,
    bound: Bound,
    history: Option<History>,
    /// the transition since the last update, for the smoother
    pending: Option<Rows>,
}

impl Filter {
    /// At the plant's first estimate.
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
        if let Some(bounds) = &settings.bounds {
            if bounds.len() != model.dimension() {
                let expected = format!("{}, one pair per state", model.dimension());
                return Err(Error::setting("bounds", expected, bounds.len()));
            }
            if settings.keep_history {
                let found = "a smoother beside them";
                return Err(Error::setting("bounds", "no smoother", found));
            }
        }
        let is_window = matches!(settings.kind, FilterKind::MovingHorizon(..));
        let keep_corrections = settings.keep_history && !is_window;
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
                let keep = settings.keep_history;
                let horizon = Horizon::new(model, length, bounds, run, keep)?;
                Engine::MovingHorizon(Box::new(horizon))
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
            projection: settings.bounds.map(Projection::new),
            sensing: Sensing::new(model, settings.gate, keep_corrections, settings.foresees),
            inputs: vec![0.0; model.inputs().len()],
            bound: Bound::new(&x),
            history: settings.keep_history.then(History::default),
            pending: None,
        })
    }

    /// The estimate after the last sample.
    pub fn estimate(&self) -> &[f64] {
        &self.belief.x
    }

    fn driven(&mut self) -> &mut Driven {
        match &mut self.engine {
            Engine::Extended(engine) => &mut engine.driven,
            Engine::Unscented(engine) => &mut engine.driven,
            Engine::MovingHorizon(horizon) => &mut horizon.engine.driven,
        }
    }

    /// To the next sample; the transition is what the smoother needs of it. Where the plant has no
    /// value on the way, inside the declared ranges.
    fn predict(&mut self, from: f64, to: f64, inputs: &[f64]) -> Result<Rows, Error> {
        self.driven().aim(from, to, inputs);
        let keep = self.keeps_transitions();
        let belief = &mut self.belief;
        let result = match &mut self.engine {
            Engine::Extended(engine) => engine.predict(belief, from, to, keep),
            Engine::Unscented(engine) => engine.predict(belief, from, to, keep),
            Engine::MovingHorizon(horizon) => {
                let result = horizon.engine.predict(belief, from, to, keep);
                confine(&mut belief.x, horizon.bounds());
                result
            }
        };
        match (result, &mut self.spare) {
            (Err(error), Some(spare)) if is_undefined(&error) => {
                // a flow that failed has left the belief as it was
                self.sensing.health.confined += 1;
                confine(&mut self.belief.x, &spare.bounds);
                let driven = &mut spare.engine.driven;
                driven.start(&self.inputs);
                driven.aim(from, to, inputs);
                spare.engine.predict(&mut self.belief, from, to, keep)
            }
            (result, _) => result,
        }
    }

    /// The estimate into the bounds where it is to be kept there.
    fn keep_inside(&mut self) {
        if let Some(projection) = &mut self.projection {
            let Belief { x, root } = &mut self.belief;
            self.sensing.health.projected += usize::from(projection.project(x, root));
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
}

impl Runner for Filter {
    fn begin(&mut self, _: &Sample<'_>) -> Result<(), Error> {
        Ok(())
    }

    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<(), Error> {
        self.bound.see(&self.inputs);
        let transition = self.predict(from, sample.t, sample.inputs)?;
        self.driven().arrive();
        self.keep_inside();
        if self.keeps_transitions() {
            self.pending = Some(match self.pending.take() {
                None => transition,
                Some(earlier) => transition.after(&earlier),
            });
        }
        Ok(())
    }

    fn update(&mut self, sample: &Sample<'_>) -> Result<(), Error> {
        self.sensing.health.inputs_held += sample.held;
        // those of an update that failed
        self.sensing.take_corrections();
        self.inputs.copy_from_slice(sample.inputs);
        self.driven().start(sample.inputs);
        self.correct(sample.t, sample.readings)?;
        self.keep_inside();
        Ok(())
    }

    fn report(&mut self, t: f64) -> Result<(), Error> {
        let names = self.sensing.states();
        self.bound.check(t, names, &self.belief.x, String::new)?;
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            *deviation = self.belief.root.deviation(i);
        }
        match self.deviations.iter().position(|d| !d.is_finite()) {
            None => Ok(()),
            Some(i) => Err(deviation_diverged(t, &names[i], self.deviations[i])),
        }
    }

    fn estimate(&self) -> &[f64] {
        &self.belief.x
    }

    fn deviations(&self) -> Option<&[f64]> {
        Some(&self.deviations)
    }

    fn innovations(&self) -> &[Innovation] {
        &self.sensing.innovations
    }

    fn health(&self) -> &Health {
        &self.sensing.health
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
