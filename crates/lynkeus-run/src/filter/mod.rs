//! Kalman filters: estimates that are corrected when sensors report.
//!
//! Between samples a filter lets the plant's own equations run; at a sample every sensor
//! that reports corrects the estimate, by as much as its noise and the estimate's
//! covariance P say. P is held as a root S, P = S Sᵀ, and only ever changed as a root:
//! rounding cannot make it indefinite.
//!
//! ```
//! use lynkeus_expr::Graph;
//! use lynkeus_run::filter::{FilterKind, FilterSettings, NoisyModel, NoisyPlant, Sensor};
//! use lynkeus_run::{Blueprint, EstimatorSettings, Level};
//!
//! // a level that nobody moves, measured with noise of standard deviation 1
//! let g = Graph::new();
//! let [time, x] = ["time", "x"].map(|name| g.symbol(name));
//! let model = NoisyModel::new(&NoisyPlant {
//!     graph: &g,
//!     time: time.node(),
//!     states: vec![("x".into(), x.node(), 0.0)],
//!     derivatives: vec![g.constant(0.0).node()],
//!     inputs: vec![],
//!     sensors: vec![Sensor { name: "y".into(), output: x.node(), noise: Level::Absolute(1.0), limits: None }],
//!     process_noise: vec![0.0],
//!     initial_variance: vec![1.0],
//!     ranges: vec![],
//!     confined: None,
//!     whens: Default::default(),
//! })?;
//! let settings = FilterSettings::of(FilterKind::Extended);
//! let filter = Blueprint::filter(model, settings, EstimatorSettings::default());
//! let mut filter = filter.estimator()?;
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

mod belief;
pub(crate) mod censored;
mod drawn;
mod ekf;
pub(crate) mod expressions;
pub(crate) mod health;
mod likelihood;
mod mhe;
mod model;
mod order;
mod particle;
mod point;
mod profile;
mod record;
pub(crate) mod root;
pub(crate) mod sensing;
mod settings;
mod smoother;
pub(crate) mod transition;
mod ukf;

pub use crate::correlation::Correlation;
pub use crate::noise::Limits;
pub(crate) use belief::Belief;
pub use drawn::Drawn;
pub use health::{Health, Innovation, ParticleHealth, Reading, SensorHealth};
pub use likelihood::{
    Likelihood, ParametricLevel, ParametricPlant, ParametricSensor, Row, Score, Seen,
};
pub(crate) use model::check_counts;
pub use model::{NoisyModel, NoisyPlant, Sensor};
pub(crate) use order::by_distance;
pub use record::Record;
pub use settings::{FilterKind, FilterSettings, PATIENCE, Particles, SigmaPoints, Weights};
pub use smoother::Smoothed;

use crate::divergence::{Bound, check_deviations};
use crate::manifold::Manifold;
use crate::runner::{Runner, Sample};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::standing::{self, Errors, Stand, Standing};
use crate::{Error, EstimatorSettings, Result};
use belief::{Projection, confine};
use ekf::Ekf;
use mhe::Mhe;
use particle::ParticleFilter;
use profile::Profile;
use sensing::Sensing;
use smoother::{History, Step};
use transition::Propagation;
use ukf::Ukf;

/// What the filters differ in.
#[derive(Clone, Debug)]
enum Engine {
    Extended(Ekf),
    Unscented(Box<Ukf>),
    MovingHorizon(Box<Mhe>),
}

/// What an extended filter has beside its belief.
#[derive(Clone, Debug)]
pub(crate) struct Beside {
    /// known inputs from the last sample on
    pub inputs: Vec<f64>,
    pub bound: Bound,
    pub health: Health,
    /// of each sensor's readings that were rejected in a row, those that differ from the one before, and
    /// that one
    pub rejected: Vec<(usize, f64)>,
}

impl Beside {
    /// At the start.
    pub fn new(model: &NoisyModel) -> Self {
        let (flow, sensors) = (model.flow.system(), model.sensors.len());
        Self {
            inputs: vec![0.0; flow.signals().len()],
            bound: Bound::new(flow.start()),
            health: Health::of(sensors),
            rejected: vec![(0, 0.0); sensors],
        }
    }
}

/// The filter of such settings, at the plant's first estimate.
pub(crate) fn started(
    model: &NoisyModel,
    settings: &FilterSettings,
    run: EstimatorSettings,
) -> Result<Box<dyn Runner>> {
    match &settings.kind {
        FilterKind::Particles(own) => Ok(Box::new(ParticleFilter::new(model, settings, own, run)?)),
        _ => Ok(Box::new(Filter::new(model, settings, run)?)),
    }
}

/// A filter under way.
#[derive(Clone, Debug)]
pub(crate) struct Filter {
    /// the plant between samples
    propagation: Propagation,
    engine: Engine,
    /// the same inside the declared ranges, for intervals on which the plant has no value where the
    /// estimate is
    spare: Option<Propagation>,
    ranges: Vec<Limits>,
    manifold: Manifold,
    belief: Belief,
    /// so many last states are drawn anew in every row
    drawn: usize,
    projection: Option<Projection>,
    sensing: Sensing,
    deviations: Vec<f64>,
    bound: Bound,
    history: Option<History>,
    /// the transition since the last update, for the smoother
    pending: Option<Profile>,
}

impl Filter {
    /// At the plant's first estimate.
    pub fn new(
        model: &NoisyModel,
        settings: &FilterSettings,
        run: EstimatorSettings,
    ) -> Result<Self> {
        let flow = model.flow.system();
        let n = flow.states().len();
        settings.check(n, model.ranges.len())?;
        let manifold = model.manifold.clone();
        if flow.has_clauses() && settings.is_window() {
            let expected = "no window of samples for a plant whose state jumps (`when`)";
            return Err(Error::setting("filter", expected, "one"));
        }
        let propagation = |flow| -> Result<Propagation> {
            let propagation = Propagation::new(flow, &model.process_noise, run)?;
            Ok(propagation.drawing(model.drawn))
        };
        Ok(Self {
            propagation: propagation(&model.flow)?,
            engine: match settings.kind {
                FilterKind::Extended => Engine::Extended(Ekf::new(settings.iterations)),
                FilterKind::Unscented(points) => {
                    Engine::Unscented(Box::new(Ukf::new(model, points, run.method)?))
                }
                FilterKind::MovingHorizon(length) => {
                    let horizon = Mhe::new(model, length, settings.keep_history)?;
                    Engine::MovingHorizon(Box::new(horizon))
                }
                FilterKind::Particles(_) => {
                    let expected = "one with a covariance";
                    return Err(Error::setting("filter", expected, "particles"));
                }
            },
            spare: model.confined.as_ref().map(propagation).transpose()?,
            ranges: model.ranges.clone(),
            deviations: model.initial_variance[..n - model.drawn]
                .iter()
                .map(|v| v.sqrt())
                .collect(),
            drawn: model.drawn,
            belief: Belief::on(&manifold, flow.start(), &model.initial_variance),
            projection: (settings.projects).then(|| Projection::new(model.ranges.clone())),
            sensing: Sensing::new(model, settings),
            bound: Bound::new(flow.start()),
            history: settings.keep_history.then(|| History {
                manifold: manifold.clone(),
                ..History::default()
            }),
            manifold,
            pending: None,
        })
    }

    /// Goes to where another one is: x̂, then the lower triangle of S row by row, and what is beside.
    pub fn resume(&mut self, belief: impl Iterator<Item = f64>, beside: &Beside) {
        let places = self.belief.numbers_mut();
        places.zip(belief).for_each(|(place, value)| *place = value);
        self.propagation.driven.start(&beside.inputs);
        self.bound = beside.bound;
        self.sensing.health.clone_from(&beside.health);
        let kept = self.sensing.moved.iter_mut().zip(&mut self.sensing.last);
        for ((moved, last), rejected) in kept.zip(&beside.rejected) {
            (*moved, *last) = *rejected;
        }
    }

    /// Where it is: what [`Filter::resume`] takes.
    pub fn standing(&mut self) -> (impl Iterator<Item = f64>, Beside) {
        let kept = self.sensing.moved.iter().zip(&self.sensing.last);
        let beside = Beside {
            inputs: self.propagation.driven.signals().to_vec(),
            bound: self.bound,
            health: self.sensing.health.clone(),
            rejected: kept.map(|(moved, last)| (*moved, *last)).collect(),
        };
        (self.belief.numbers_mut().map(|x| *x), beside)
    }

    /// To the next sample; the transition is what the smoother needs of it. Where the plant has no
    /// value on the way, inside the declared ranges.
    fn predict(&mut self, from: f64, sample: &Sample<'_>) -> Result<Option<Profile>> {
        // a window finds its own
        let keep = self.sensing.corrections.is_some();
        let (propagation, belief) = (&mut self.propagation, &mut self.belief);
        if let Some(spare) = &mut self.spare {
            spare.driven.start(propagation.driven.signals());
        }
        propagation.driven.aim(from, sample.t, sample.inputs);
        let result = match &mut self.engine {
            Engine::Unscented(ukf) => ukf.predict(propagation, belief, from, sample.t, keep),
            engine => {
                let done = propagation.predict(belief, from, sample.t);
                if let Engine::MovingHorizon(_) = engine {
                    confine(&mut belief.x, &self.ranges);
                }
                done.map(|()| keep.then(|| propagation.transition().clone()))
            }
        };
        match (result, &mut self.spare) {
            (Err(error), Some(spare)) if is_undefined(&error) => {
                // a flow that failed has left the belief as it was
                self.sensing.health.confined += 1;
                confine(&mut belief.x, &self.ranges);
                spare.driven.aim(from, sample.t, sample.inputs);
                spare.predict(belief, from, sample.t)?;
                Ok(keep.then(|| spare.transition().clone()))
            }
            (result, _) => result,
        }
    }

    /// The estimate into the bounds where it is to be kept there.
    fn keep_inside(&mut self) {
        let before = self.before();
        if let Some(projection) = &mut self.projection {
            let Belief { x, root } = &mut self.belief;
            self.sensing.health.projected += usize::from(projection.project(x, root));
            self.land(before);
        }
    }

    /// Where it is, in case that a sum is none of its states. A window brings its states to where they are itself.
    fn before(&self) -> Option<Vec<f64>> {
        let is_sum =
            !self.manifold.is_straight() && !matches!(self.engine, Engine::MovingHorizon(_));
        is_sum.then(|| self.belief.x.clone())
    }

    /// What was added to the states since then as their own way, with all that is known about it.
    fn land(&mut self, before: Option<Vec<f64>>) {
        let (Some(before), Belief { x, root }) = (before, &mut self.belief) else {
            return;
        };
        let n = x.len();
        self.manifold.retract(&before, x);
        self.manifold.transport(&before, x, &mut root.entries, n);
        root.restore();
        let Some(corrections) = &mut self.sensing.corrections else {
            return;
        };
        for correction in corrections {
            correction.transport(&self.manifold, &before, x);
        }
        let pending = self.pending.get_or_insert_with(|| Profile::identity(n));
        self.manifold
            .transport(&before, x, pending.entries_mut(), n);
    }

    /// The way of quaternions, which steps leave as long as they are.
    fn settle(&mut self, transition: &mut Option<Profile>) {
        if self.manifold.is_straight() {
            return;
        }
        let Belief { x, root } = &mut self.belief;
        let n = x.len();
        self.manifold.normalise(x);
        self.manifold.project(x, &mut root.entries, n);
        root.restore();
        if let Some(transition) = transition {
            self.manifold.project(x, transition.entries_mut(), n);
        }
    }

    /// Without what nobody estimates.
    fn told(&self, mut rows: Vec<Smoothed>) -> Vec<Smoothed> {
        let count = self.deviations.len();
        for row in &mut rows {
            row.estimate.truncate(count);
            row.deviations.truncate(count);
        }
        rows
    }

    /// What every row draws anew.
    fn renew(&mut self) {
        if self.drawn > 0 {
            self.belief.renew(self.drawn);
            if let Some(pending) = &mut self.pending {
                pending.clear_last(self.drawn);
            }
        }
    }

    fn correct(&mut self, sample: &Sample<'_>) -> Result<()> {
        match self.correct_here(sample) {
            // the outputs are evaluated before a reading is counted; a window keeps its states
            // inside anyway
            Err(error)
                if is_undefined(&error)
                    && self.spare.is_some()
                    && !matches!(self.engine, Engine::MovingHorizon(_)) =>
            {
                self.sensing.health.confined += 1;
                confine(&mut self.belief.x, &self.ranges);
                self.correct_here(sample)
            }
            result => result,
        }
    }

    fn correct_here(&mut self, sample: &Sample<'_>) -> Result<()> {
        let (sensing, belief) = (&mut self.sensing, &mut self.belief);
        if let Some(record) = &mut sensing.record {
            record.clear(!matches!(self.engine, Engine::MovingHorizon(_)));
        }
        match &mut self.engine {
            Engine::Extended(ekf) => ekf.correct(sensing, belief, sample),
            Engine::Unscented(ukf) => ukf.correct(sensing, belief, sample),
            Engine::MovingHorizon(mhe) => {
                mhe.correct(&mut self.propagation, sensing, belief, sample)
            }
        }
    }
}

impl Runner for Filter {
    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<()> {
        self.bound.see(self.propagation.driven.signals());
        let mut transition = self.predict(from, sample)?;
        self.propagation.driven.arrive();
        self.settle(&mut transition);
        if let Some(transition) = transition {
            self.pending = Some(match self.pending.take() {
                None => transition,
                Some(earlier) => transition.after(&earlier),
            });
        }
        self.keep_inside();
        Ok(())
    }

    fn update(&mut self, sample: &Sample<'_>) -> Result<()> {
        self.sensing.health.inputs_held += sample.held;
        // those of an update that failed
        self.sensing.take_corrections();
        self.propagation.driven.start(sample.inputs);
        self.renew();
        let before = self.before();
        self.correct(sample)?;
        self.land(before);
        self.keep_inside();
        if let Some(record) = &mut self.sensing.record {
            record.end(&self.belief);
        }
        Ok(())
    }

    fn report(&mut self, t: f64) -> Result<()> {
        let names = self.propagation.driven.system().states();
        self.bound.check(t, names, &self.belief.x, String::new)?;
        for (i, deviation) in self.deviations.iter_mut().enumerate() {
            *deviation = self.belief.root.deviation(i);
        }
        check_deviations(t, names, &self.deviations)
    }

    fn estimate(&self) -> &[f64] {
        &self.belief.x[..self.deviations.len()]
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

    fn keep_record(&mut self) {
        let (states, sensors) = (self.deviations.len(), self.sensing.innovations.len());
        self.sensing.record = Some(Record::new(states, sensors));
    }

    fn record(&self) -> Option<&Record> {
        self.sensing.record.as_ref()
    }

    fn remember(&mut self) {
        let corrections = self.sensing.take_corrections();
        let transition = self.pending.take();
        let Some(history) = &mut self.history else {
            return;
        };
        if let Engine::MovingHorizon(horizon) = &mut self.engine {
            horizon.leave(history);
            return;
        }
        history.steps.push(Step {
            transition,
            touched: None,
            belief: self.belief.clone(),
            corrections,
        });
    }

    fn has_history(&self) -> bool {
        self.history.is_some()
    }

    /// None where a window reaches back less far than `lag`, either.
    fn smoothed(&self, lag: Option<usize>, deviations: bool) -> Option<Vec<Smoothed>> {
        let history = self.history.as_ref()?;
        let Engine::MovingHorizon(horizon) = &self.engine else {
            return Some(self.told(history.smoothed(&[], lag, deviations)));
        };
        if lag.is_some_and(|lag| lag > horizon.length()) {
            return None;
        }
        let newest = horizon.steps(&self.propagation, &self.sensing)?;
        let mut rows = history.smoothed(&newest, lag, deviations);
        if let Some(lag) = lag {
            // as it was known then: the rows kept are linearised about what was known later
            let known = history.in_windows(self.belief.x.len(), lag);
            for (row, x) in rows.iter_mut().zip(known) {
                row.estimate.copy_from_slice(x);
            }
        }
        for row in &mut rows {
            confine(&mut row.estimate, &self.ranges);
        }
        Some(self.told(rows))
    }

    fn walk_history(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        let n = self.belief.x.len();
        match &mut self.history {
            Some(history) => history.walk(walk, n),
            None => Ok(()),
        }
    }

    /// What every row draws anew is left out.
    fn stand(&self) -> Stand<'_> {
        let (n, own) = (self.belief.x.len(), self.deviations.len());
        let rows = self.belief.root.entries.chunks_exact(n.max(1)).take(own);
        Stand {
            names: &self.propagation.driven.system().states()[..own],
            own,
            x: &self.belief.x[..own],
            errors: Errors::Root(rows.flat_map(|row| &row[..own]).copied().collect()),
        }
    }

    fn resume(&mut self, sample: &Sample<'_>, standing: &Standing) -> Result<()> {
        if let Errors::Particles { .. } = standing.errors {
            return Err(standing::other_errors("a covariance", "particles"));
        }
        let names = self.propagation.driven.system().states();
        let places = standing.places(names, self.deviations.len())?;
        standing.fill(&places, &mut self.belief.x);
        standing.fill_root(&places, &mut self.belief.root)?;
        self.bound.see(&self.belief.x);
        self.propagation.driven.start(sample.inputs);
        if let Engine::MovingHorizon(mhe) = &mut self.engine {
            mhe.begin(sample, &self.belief);
        }
        Ok(())
    }

    fn copied(&self) -> Box<dyn Runner> {
        Box::new(self.clone())
    }
}

/// Whether the plant has no value where it was asked for.
fn is_undefined(error: &Error) -> bool {
    matches!(
        error,
        Error::NotFinite { .. } | Error::StepUnderflow { .. } | Error::Diverged { .. }
    )
}

impl Persist for Filter {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.propagation.walk(walk)?;
        match &mut self.engine {
            Engine::Extended(_) => {}
            Engine::Unscented(ukf) => {
                ukf.integrator.walk(walk)?;
                if self.propagation.driven.system().has_clauses() {
                    ukf.integrator.memory().walk(walk)?;
                }
            }
            Engine::MovingHorizon(mhe) => mhe.walk(walk)?,
        }
        if let Some(spare) = &mut self.spare {
            spare.walk(walk)?;
        }
        self.belief.walk(walk)?;
        self.sensing.walk(walk)?;
        walk.numbers(&mut self.deviations)?;
        walk.number(&mut self.bound.scale)?;
        let n = self.belief.x.len();
        walk.optional(&mut self.pending, |walk, pending| pending.walk(walk, n))
    }
}

#[cfg(test)]
mod tests;
