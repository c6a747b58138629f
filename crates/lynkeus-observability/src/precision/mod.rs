//! How well states can be known: standard errors along a trajectory, for given noise and sampling.
//!
//! A small error δz of the state at the start of a window, unknown inputs appended as
//! constants, changes the sample of sensor c at t_k by ∂h_c/∂z·S(t_k)·δz, where the
//! sensitivity S solves S' = (∂f/∂z)·S, S(0) = I. With independent noise of standard deviation r the
//! samples up to the horizon T carry the information
//!
//! F(T) = Σ_k Σ_c (∂h_c/∂z S(t_k))ᵀ (∂h_c/∂z S(t_k)) / r_c²,
//!
//! a sensor with limits the share of that which a clipped normal number tells
//! ([`Limits::information`]),
//!
//! and no unbiased estimator is more precise than F⁻¹ at the start of the window and
//! S(T)·F⁻¹·S(T)ᵀ at its end, the present (Cramér and Rao's bound; least squares reaches it where
//! the noise is small). F itself is never formed: its square-root factor is, by orthogonal
//! transformations of the weighted rows, so that the condition of the rows and not its square counts.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_observability::precision::{Deviation, Experiment, Quantity, Sensor, Window};
//!
//! // a cart: its place is measured ten times, 1 s apart, each time to ±0.1 m
//! let g = Graph::new();
//! let [time, place, speed] = ["time", "place", "speed"].map(|name| g.symbol(name));
//! let state = |name: &str, node, start, scale| Quantity { name: name.into(), node, start, scale, is_known: false };
//! let cart = Experiment {
//!     states: vec![
//!         state("place", place.node(), 0.0, 10.0),
//!         state("speed", speed.node(), 1.0, 2.0),
//!     ],
//!     derivatives: vec![speed.node(), g.constant(0.0).node()],
//!     sensors: vec![Sensor { name: "y".into(), node: place.node(), noise: Deviation::Absolute(0.1), limits: None }],
//!     ..Experiment::new(&g, time.node(), Window { start: 0.0, step: 1.0, horizons: vec![9] })
//! };
//! let found = cart.run()?;
//! let σ = found.deviations(0, &[0]);
//! // the slope of a straight line through ten points
//! let expected = 0.1 * (12.0 / (10.0 * 99.0_f64)).sqrt();
//! assert!((σ.present[1] - expected).abs() < 1e-9);
//! # Ok::<(), lynkeus_run::Error>(())
//! ```

mod deviations;
mod forward;
mod sets;
mod tangent;

use lynkeus_expr::{Budget, Graph, Node};
use lynkeus_model::Whens;
use lynkeus_run::filter::Limits;
use lynkeus_run::{Error, Method};

pub use deviations::{Deviations, Rank};
pub use sets::{Advice, SensorSet};

use deviations::Information;
use deviations::Judged;
use forward::Forward;
use nalgebra::DMatrix;

/// Most cells (8 bytes each) of the information that is kept.
const MOST_CELLS: usize = 60_000_000;

/// Something to be estimated: a state, or an unknown input.
#[derive(Clone, Debug, PartialEq)]
pub struct Quantity {
    /// its name
    pub name: String,
    /// its symbol in the graph
    pub node: Node,
    /// its value at the start of the window, in its unit; not used for unknown inputs, whose
    /// course is among [`Experiment::inputs`]
    pub start: f64,
    /// its range or magnitude, in its unit, above 0: what errors are compared with
    pub scale: f64,
    /// its start is known exactly: what changes at events alone
    pub is_known: bool,
}

/// The standard deviation of one sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Deviation {
    /// in the unit of the sensor
    Absolute(f64),
    /// a share of the present value
    Relative {
        /// 0.05 is 5 %
        share: f64,
        /// in the unit of the sensor, above 0: what it does not fall below where the value is near zero
        least: f64,
    },
}

impl Sensor {
    /// What a row of its slopes weighs where it would show a value: the root of Fisher's information
    /// of a sample, that of a clipped normal number where it has limits.
    pub(crate) fn weight(&self, value: f64) -> f64 {
        let deviation = self.noise.at(value);
        let share = self.limits.map_or(1.0, |l| l.information(value, deviation));
        share.sqrt() / deviation
    }
}

impl Deviation {
    /// The standard deviation of a sample of this value.
    pub fn at(self, value: f64) -> f64 {
        match self {
            Self::Absolute(deviation) => deviation,
            Self::Relative { share, least } => (share * value.abs()).max(least),
        }
    }

    fn is_usable(self) -> bool {
        let (Self::Absolute(least) | Self::Relative { least, .. }) = self;
        least > 0.0 && least.is_finite()
    }
}

/// A sensor that is there or could be.
#[derive(Clone, Debug, PartialEq)]
pub struct Sensor {
    /// its name
    pub name: String,
    /// what it shows: an expression in time, states and inputs
    pub node: Node,
    /// how noisy its samples are; independent of each other and of other sensors
    pub noise: Deviation,
    /// the range that it can show: near an end a sample tells less, and far beyond nothing
    pub limits: Option<Limits>,
}

/// When samples are taken and when the question is asked.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Window {
    /// instant of the first sample, in the plant's unit of time
    pub start: f64,
    /// time between samples
    pub step: f64,
    /// horizons in steps, increasing: one of 9 holds the samples 0 to 9
    pub horizons: Vec<usize>,
}

impl Window {
    /// At most `points` horizons, spaced by equal ratios, from a few samples up to `span` (in the plant's
    /// unit of time).
    pub fn log_spaced(start: f64, span: f64, step: f64, points: usize) -> Self {
        let last = (span / step * (1.0 + 1e-12)).floor().max(1.0);
        let ratio = |i: usize| i as f64 / points.saturating_sub(1).max(1) as f64;
        let mut horizons: Vec<usize> = (0..points.max(1))
            .map(|i| last.powf(ratio(i)).round() as usize)
            .chain([last as usize])
            .collect();
        horizons.dedup();
        Self {
            start,
            step,
            horizons,
        }
    }

    /// The instant of sample `k`.
    pub fn instant(&self, k: usize) -> f64 {
        self.start + k as f64 * self.step
    }

    fn check(&self) -> Result<(), Error> {
        let is_increasing = self.horizons.windows(2).all(|pair| pair[0] < pair[1]);
        if self.horizons.is_empty() || !is_increasing {
            let found = format!("{:?}", self.horizons);
            return Err(setting("horizons", "one or more, increasing", found));
        }
        if !(self.step > 0.0 && self.step.is_finite() && self.start.is_finite()) {
            let found = format!("{} from {}", self.step, self.start);
            return Err(setting("sampling", "a finite step above 0", found));
        }
        Ok(())
    }
}

/// A plant on a trajectory, and everything that could measure it.
#[derive(Clone, Debug)]
pub struct Experiment<'g> {
    /// holds all expressions
    pub graph: &'g Graph,
    /// the symbol of time
    pub time: Node,
    /// the states
    pub states: Vec<Quantity>,
    /// their derivatives, expressions in time, states and inputs
    pub derivatives: Vec<Node>,
    /// by which the states jump; none where they never do
    pub whens: Whens,
    /// inputs that are to be estimated: the error of each is a constant over the window
    pub unknown: Vec<Quantity>,
    /// every input, the unknown ones included, with its course as an expression of time
    pub inputs: Vec<(Node, Node)>,
    /// present and possible sensors
    pub sensors: Vec<Sensor>,
    /// sampling and horizons
    pub window: Window,
    /// the integrator
    pub method: Method,
}

impl<'g> Experiment<'g> {
    /// Nothing to estimate and no sensors yet.
    pub fn new(graph: &'g Graph, time: Node, window: Window) -> Self {
        Self {
            graph,
            time,
            states: vec![],
            derivatives: vec![],
            whens: Whens::default(),
            unknown: vec![],
            inputs: vec![],
            sensors: vec![],
            window,
            method: Method::default(),
        }
    }

    /// States, then unknown inputs.
    fn quantities(&self) -> impl Iterator<Item = &Quantity> {
        self.states.iter().chain(&self.unknown)
    }

    fn check(&self) -> Result<(), Error> {
        self.window.check()?;
        if let Some(bad) = self
            .quantities()
            .find(|q| !(q.scale > 0.0 && q.scale.is_finite()))
        {
            let what = format!("scale of '{}'", bad.name);
            return Err(setting(what, "a finite number above 0", bad.scale));
        }
        if let Some(bad) = self.sensors.iter().find(|s| !s.noise.is_usable()) {
            let what = format!("noise of '{}'", bad.name);
            let found = format!("{:?}", bad.noise);
            return Err(setting(what, "a standard deviation above 0", found));
        }
        let wide = self.quantities().count();
        let cells = self.window.horizons.len() * (self.sensors.len() + 1) * wide * wide;
        if cells > MOST_CELLS {
            let what = "horizons × sensors × states²";
            let expected = format!("at most {MOST_CELLS} (fewer horizons or candidates)");
            return Err(setting(what, expected, cells));
        }
        match self.graph.budget().affords(cells * size_of::<f64>()) {
            true => Ok(()),
            false => Err(Error::Cancelled {
                time: self.window.start,
            }),
        }
    }
}

/// What every sensor tells up to every horizon.
#[derive(Clone, Debug)]
pub struct Precision {
    /// names of states and unknown inputs
    pub names: Vec<String>,
    /// their scales, in their units
    pub scales: Vec<f64>,
    /// names of the sensors
    pub sensors: Vec<String>,
    /// ends of the horizons, measured from the start of the window, in the plant's unit of time
    pub horizons: Vec<f64>,
    /// whose start is known exactly
    known: Vec<bool>,
    /// relative accuracy of the sensitivities
    accuracy: f64,
    /// of what is computed from here on; once it is spent, results do not count
    budget: Budget,
    checkpoints: Vec<Checkpoint>,
}

/// The end of a horizon.
#[derive(Clone, Debug)]
struct Checkpoint {
    /// ∂z(T)/∂z(0)·diag(scales)
    transition: DMatrix<f64>,
    /// of each sensor
    information: Vec<Information>,
    /// the same in the coordinates of the present, where sensitivities to the start leave something in doubt
    forward: Option<Forward>,
}

impl Precision {
    /// Standard errors from the samples of the sensors `set` (indices) up to horizon number
    /// `horizon`; everything is unseen where there is no such horizon or sensor, or where the
    /// graph's budget is spent.
    pub fn deviations(&self, horizon: usize, set: &[usize]) -> Deviations {
        self.deviations_at(horizon, set, self.accuracy)
    }

    /// True where sensitivities ten times more or less accurate would change which present values
    /// count as seen, or where one that they show is lost in the errors of the integrator.
    pub fn is_doubtful(&self, horizon: usize, set: &[usize]) -> bool {
        let pattern = |factor: f64| {
            let accuracy = factor * self.accuracy;
            self.deviations_at(horizon, set, accuracy).pattern()
        };
        let present = pattern(1.0);
        let lost = || {
            let judged = self.judged(horizon, set, self.accuracy);
            let shown = judged.map_or(vec![], |judged| judged.deviations.pattern());
            shown
                .iter()
                .zip(&present)
                .any(|(shown, seen)| *shown && !seen)
        };
        lost()
            || [0.1, 10.0]
                .into_iter()
                .any(|factor| pattern(factor) != present)
    }

    /// Whether something is not seen at the longest horizon by all sensors, or what is rests on what counts as rounding.
    fn is_in_doubt(&self) -> bool {
        let last = self.checkpoints.len().saturating_sub(1);
        let all: Vec<usize> = (0..self.sensors.len()).collect();
        let judged = self.judged(last, &all, self.accuracy);
        judged.is_some_and(|judged| {
            let mut doubts = judged.start.iter().chain(&judged.present);
            doubts.any(|doubt| *doubt)
        })
    }

    /// What sensitivities to the start tell.
    fn judged(&self, horizon: usize, set: &[usize], accuracy: f64) -> Option<Judged> {
        let checkpoint = self.checkpoints.get(horizon)?;
        let parts = set.iter().filter_map(|&s| checkpoint.information.get(s));
        let joined = Information::joined(self.names.len(), parts);
        let transition = &checkpoint.transition;
        deviations::of(&joined, transition, &self.scales, accuracy, &self.budget)
    }

    fn deviations_at(&self, horizon: usize, set: &[usize], accuracy: f64) -> Deviations {
        let judged = self.judged(horizon, set, accuracy);
        let Some(Judged {
            deviations: mut found,
            start: doubted_start,
            present: doubted_present,
        }) = judged
        else {
            return Deviations::blind(self.names.len());
        };
        let checkpoint = self.checkpoints.get(horizon);
        let forward = checkpoint.and_then(|checkpoint| checkpoint.forward.as_ref());
        let carried = forward.and_then(|forward| forward.deviations(set, &self.budget));
        self.know(&mut found.start);
        let Some([start, present]) = carried else {
            return found;
        };
        let all = [
            (&mut found.start, doubted_start, start),
            (&mut found.present, doubted_present, present),
        ];
        for (values, doubted, carried) in all {
            let values = values.iter_mut().zip(doubted).zip(carried);
            for (((σ, is_doubted), own), scale) in values.zip(&self.scales) {
                if is_doubted {
                    *σ = own * scale;
                }
            }
        }
        self.know(&mut found.start);
        found
    }

    /// Nothing is left to find of what is known at the start.
    fn know(&self, start: &mut [f64]) {
        let known = start.iter_mut().zip(&self.known);
        known
            .filter(|(_, is_known)| **is_known)
            .for_each(|(σ, _)| *σ = 0.0);
    }
}

/// Work on parts of some things, each in a thread of its own, in order.
fn side_by_side<P: Send, R: Send>(
    parts: impl Iterator<Item = P>,
    work: impl Fn(P) -> R + Sync,
) -> Vec<R> {
    let work = &work;
    std::thread::scope(|scope| {
        let start = |part| scope.spawn(move || work(part));
        let crew: Vec<_> = parts.map(start).collect();
        let done = crew.into_iter().map(|worker| worker.join());
        done.map(|done| done.unwrap_or_else(|panic| std::panic::resume_unwind(panic)))
            .collect()
    })
}

/// How many of these make the part of one thread.
fn share(count: usize) -> usize {
    let threads = std::thread::available_parallelism().map_or(1, usize::from);
    count.div_ceil(threads).max(1)
}

fn setting(what: impl Into<String>, expected: impl Into<String>, found: impl ToString) -> Error {
    Error::Setting {
        what: what.into(),
        expected: expected.into(),
        found: found.to_string(),
    }
}

#[cfg(test)]
mod tests;
