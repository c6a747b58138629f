//! Any observer, fed sample by sample.

use std::sync::{Arc, OnceLock};

use crate::filter::{self, Health, Innovation, Record, Smoothed};
use crate::runner::{Runner, Sample, check_time, no_number};
use crate::sampled::Sampled;
use crate::snapshot::{self, Damaged, Walk};
use crate::standing::Standing;
use crate::{
    Blueprint, Error, EstimatorSettings, Result, SnapshotFault, StepAdvice, System, Updates,
};

/// Any observer, one sample after the other, live or from a log.
///
/// It goes to a time without a reading ([`predict`](Self::predict)), takes what sensors report
/// there ([`update`](Self::update)), or both at once ([`push`](Self::push)). Signals are the
/// readings in the order of the sensors, then the known inputs; a reading that is not finite says
/// that this sensor did not report, of an input that is not finite the last value holds. An
/// observer made of a [`System`] alone knows of no sensors: all its signals are inputs.
///
/// A call that fails changes nothing: the estimator stays at the
/// last good sample and the next call goes on from there. With [`Step::Substeps`](crate::Step::Substeps) or
/// [`Step::AtMost`](crate::Step::AtMost) neither a system nor a sampled observer nor the extended filter of up to eight
/// states without history allocates once its equations have become machine code.
///
/// ```
/// use lynkeus_expr::Graph;
/// use lynkeus_run::{Estimator, EstimatorSettings, System};
///
/// // x̂' = u + 2(y − x̂)
/// let g = Graph::new();
/// let [time, x, u, y] = ["time", "x", "u", "y"].map(|name| g.symbol(name));
/// let signals = [("u".to_string(), u.node()), ("y".to_string(), y.node())];
/// let states = [("x_hat".to_string(), x.node(), 0.0)];
/// let dx = u + (y - x) * 2.0;
/// let observer = System::new(&g, time.node(), &states, &signals, &[dx.node()], &[])?;
///
/// let mut estimator = Estimator::new(&observer, EstimatorSettings::default())?;
/// for k in 0..=20 {
///     estimator.push(0.5 * f64::from(k), &[0.0, 1.0])?;
/// }
/// assert!((estimator.estimate()[0] - 1.0).abs() < 1e-6);
///
/// // saved, and gone on with elsewhere
/// let snapshot = estimator.snapshot();
/// let mut other = Estimator::new(&observer, EstimatorSettings::default())?;
/// other.restore(&snapshot)?;
/// assert_eq!(other.push(11.0, &[0.1, 1.0])?, estimator.push(11.0, &[0.1, 1.0])?);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Estimator {
    blueprint: Arc<Blueprint>,
    fingerprint: OnceLock<u64>,
    /// of the sensors, then of the known inputs
    names: Vec<String>,
    sensors: usize,
    time: Option<f64>,
    /// of the last sample; an input that was missing has the value before
    signals: Vec<f64>,
    /// inputs of which the last value holds
    held: usize,
    runner: Box<dyn Runner>,
    kept: Kept,
}

/// Calls between two images of a state.
const CALLS: usize = 16;

/// What brings back the state before a call that fails: an image of a state, and the calls since then, which lead
/// from it to that one again, to the last bit. So few calls pay for an image.
#[derive(Clone, Debug, Default)]
struct Kept {
    /// nothing where the state is another one since then
    image: Vec<u64>,
    /// of each call the time, whether there were signals, and the signals
    since: Vec<f64>,
}

impl Kept {
    fn forget(&mut self) {
        self.image.clear();
    }

    fn add(&mut self, t: f64, signals: Option<&[f64]>, count: usize) {
        self.since.extend([t, f64::from(signals.is_some())]);
        match signals {
            Some(signals) => self.since.extend_from_slice(signals),
            None => self.since.resize(self.since.len() + count, 0.0),
        }
    }
}

impl Blueprint {
    /// The estimator, at its start.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method; for a filter also of the gate or the
    /// sigma points.
    pub fn estimator(&self) -> Result<Estimator> {
        Estimator::of(self.clone())
    }
}

impl Estimator {
    fn of(blueprint: Blueprint) -> Result<Self> {
        let runner: Box<dyn Runner> = match &blueprint.updates {
            Updates::Jumps {
                predict, errors, ..
            } => Box::new(Sampled::new(&blueprint, *predict, errors.as_deref())?),
            Updates::Filter { model, settings } => filter::started(model, settings, blueprint.run)?,
        };
        let names = [&blueprint.sensors, blueprint.inputs()].concat();
        Ok(Self {
            fingerprint: OnceLock::new(),
            signals: vec![0.0; names.len()],
            names,
            sensors: blueprint.sensors.len(),
            time: None,
            held: 0,
            runner,
            kept: Kept::default(),
            blueprint: Arc::new(blueprint),
        })
    }

    /// Of an observer whose signals are all there at every sample, at its start values.
    ///
    /// # Errors
    /// As [`Blueprint::estimator`].
    pub fn new(observer: &System, settings: EstimatorSettings) -> Result<Self> {
        Self::of(Blueprint::new(observer, settings))
    }

    /// Goes to `t`, at which nothing is read: inputs stay as they were, and the estimate is
    /// what follows from the samples before.
    ///
    /// # Errors
    /// [`Error::Setting`] before the first sample, [`Error::TimeBefore`], [`Error::NoNumber`];
    /// [`Error::Diverged`], [`Error::NotFinite`] and the errors of the integration.
    pub fn predict(&mut self, t: f64) -> Result<&[f64]> {
        self.started()?;
        check_time(self.time, t)?;
        self.call(t, None)
    }

    /// Takes signals at the time where the estimator is.
    ///
    /// # Errors
    /// As [`Estimator::push`], and [`Error::Setting`] before the first sample.
    pub fn update(&mut self, signals: &[f64]) -> Result<&[f64]> {
        let t = self.started()?;
        self.push(t, signals)
    }

    /// Goes to `t` and takes the signals there, in the order of [`Estimator::signals`]. The
    /// first sample sets the time; one at the time of the sample before only updates. With
    /// [`BetweenSamples::Linear`](crate::BetweenSamples::Linear) the way to `t` is along the line to these inputs, else this is
    /// the same as [`predict`](Self::predict), then [`update`](Self::update).
    ///
    /// # Errors
    /// [`Error::Setting`] for a wrong number of signals, [`Error::TimeBefore`],
    /// [`Error::NoNumber`] for a time or the first value of an input; [`Error::Diverged`],
    /// [`Error::NotFinite`] and the errors of the integration.
    pub fn push(&mut self, t: f64, signals: &[f64]) -> Result<&[f64]> {
        if signals.len() != self.names.len() {
            let expected = format!("{}: {}", self.names.len(), self.names.join(", "));
            return Err(Error::setting("number of signals", expected, signals.len()));
        }
        check_time(self.time, t)?;
        let mut inputs = self.sensors..self.names.len();
        let missing = |i: &usize| !signals[*i].is_finite();
        if let (None, Some(i)) = (self.time, inputs.find(missing)) {
            return Err(no_number(&self.names[i], signals[i]));
        }
        self.call(t, Some(signals))
    }

    /// The time of the last sample.
    fn started(&self) -> Result<f64> {
        let none = || Error::setting("samples so far", "one, which sets the time", 0);
        self.time.ok_or_else(none)
    }

    /// Names of the signals: sensors, then known inputs.
    #[must_use]
    pub fn signals(&self) -> &[String] {
        &self.names
    }

    /// How many of the signals are readings of sensors, which may be missing.
    #[must_use]
    pub fn sensors(&self) -> usize {
        self.sensors
    }

    /// Names of what is estimated, monitors last.
    #[must_use]
    pub fn names(&self) -> &[String] {
        self.blueprint.estimates()
    }

    /// The estimate after the last call that succeeded, in the order of [`Estimator::names`].
    #[must_use]
    pub fn estimate(&self) -> &[f64] {
        self.runner.estimate()
    }

    /// Its standard deviations, monitors left out; none for an observer without a model of its
    /// errors.
    #[must_use]
    pub fn deviations(&self) -> Option<&[f64]> {
        self.runner.deviations()
    }

    /// What became of the last readings, one per sensor; empty where no covariance says what to
    /// expect of them.
    #[must_use]
    pub fn innovations(&self) -> &[Innovation] {
        self.runner.innovations()
    }

    /// How readings and estimate went together so far.
    #[must_use]
    pub fn health(&self) -> &Health {
        self.runner.health()
    }

    /// From the next update on a filter keeps what its correction is made of: see [`Estimator::record`].
    pub fn keep_record(&mut self) {
        self.runner.keep_record();
    }

    /// What the correction of the last update is made of, NaN before the first and after a call that failed; none
    /// where no record is kept, and of an observer that is no filter.
    #[must_use]
    pub fn record(&self) -> Option<&Record> {
        self.runner.record()
    }

    /// How many particles count, (Σw)²/Σw² after the last update and before they were drawn anew; none of what
    /// has no particles.
    #[must_use]
    pub fn effective(&self) -> Option<f64> {
        self.runner.effective()
    }

    /// The particles, one after the other, and their weights, which sum to 1; none of what has no particles.
    #[must_use]
    pub fn particles(&self) -> Option<(&[f64], &[f64])> {
        self.runner.particles()
    }

    /// Time of the last sample or prediction.
    #[must_use]
    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// For a [`System`] with fixed steps: the step in use beside the one that it needs, as of
    /// [`Integrator::advice`](crate::Integrator::advice); none before the second sample.
    #[must_use]
    pub fn advice(&self) -> Option<StepAdvice> {
        match self.sensors {
            0 => self.runner.advice(),
            _ => None,
        }
    }

    /// The state of the observer itself, by [`System::states`] for a system.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        self.runner.state()
    }

    /// The estimate at each update given all of them, or those up to `lag` updates later, with
    /// standard deviations if asked for; none for an estimator that keeps no history, and for a
    /// moving horizon that reaches back by fewer than `lag` samples.
    #[must_use]
    pub fn smoothed(&self, lag: Option<usize>, deviations: bool) -> Option<Vec<Smoothed>> {
        self.runner.smoothed(lag, deviations)
    }

    /// A number that differs for observers with other equations, settings, noises or starts.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        let find = || self.blueprint.fingerprint();
        *self.fingerprint.get_or_init(find)
    }

    /// Everything that the future depends on, with a version, the [fingerprint](Self::fingerprint)
    /// and a checksum. What a smoother keeps is in it, too.
    #[must_use]
    pub fn snapshot(&self) -> Vec<u8> {
        let mut own = self.clone();
        snapshot::seal(self.fingerprint(), |walk| own.walk(walk, true))
    }

    /// Goes to where another estimator of the same observer was: from there on both give the
    /// same, to the last bit. Where a snapshot is refused nothing changes.
    ///
    /// # Errors
    /// [`Error::Snapshot`]: damaged, of another version, or of another observer.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<()> {
        let refused = |fault| Error::Snapshot { fault };
        let state = snapshot::opened(snapshot, self.fingerprint()).map_err(refused)?;
        let mut restored = self.clone();
        restored.kept.forget();
        snapshot::load(&state, |walk| restored.walk(walk, true))
            .map_err(|_| refused(SnapshotFault::Damaged))?;
        *self = restored;
        Ok(())
    }

    /// Where it stands, by name: what an observer with other numbers goes on from ([`resume`](Self::resume)); none before
    /// the first sample.
    #[must_use]
    pub fn standing(&self) -> Option<Standing> {
        let time = self.time?;
        let signals = self.names.iter().cloned().zip(self.signals.iter().copied());
        let stand = self.runner.stand();
        let states = stand.names.iter().cloned().zip(stand.x.iter().copied());
        Some(Standing {
            time,
            inputs: signals.skip(self.sensors).collect(),
            states: states.collect(),
            own: stand.own,
            errors: stand.errors,
            estimates: self
                .names()
                .iter()
                .cloned()
                .zip(self.estimate().iter().copied())
                .collect(),
        })
    }

    /// Goes on, before its first sample, from where another observer stands that has the same states and other numbers:
    /// parameters, noises, a tuning, bounds, sensors, steps. States and what is known of their errors are taken over by
    /// name; all else begins anew, and where an observer does not follow errors they begin as at a start. Where it fails
    /// nothing changes.
    ///
    /// # Errors
    /// [`Error::Setting`]: it has had a sample, has other states, or knows of errors in another way (particles);
    /// [`Error::NoNumber`] for an input of which the other one knows nothing; those of [`predict`](Self::predict).
    pub fn resume(&mut self, standing: &Standing) -> Result<()> {
        if let Some(t) = self.time {
            return Err(Error::setting("time of the estimator", "none so far", t));
        }
        check_time(None, standing.time)?;
        let mut own = self.clone();
        own.kept.forget();
        own.time = Some(standing.time);
        own.signals[..own.sensors].fill(f64::NAN);
        for (name, signal) in own.names.iter().zip(&mut own.signals).skip(own.sensors) {
            let mut inputs = standing.inputs.iter();
            let known = inputs.find(|(known, _)| known == name);
            let value = known.map_or(f64::NAN, |(_, value)| *value);
            if !value.is_finite() {
                return Err(no_number(name, value));
            }
            *signal = value;
        }
        let (readings, inputs) = own.signals.split_at(own.sensors);
        let sample = Sample {
            t: standing.time,
            readings,
            inputs,
            held: 0,
        };
        own.runner.begin(&sample)?;
        own.runner.resume(&sample, standing)?;
        own.runner.report(standing.time)?;
        *self = own;
        Ok(())
    }

    /// The state, to [go back](Self::go_back) to; what a smoother keeps is not in it.
    pub(crate) fn image(&mut self) -> Vec<u64> {
        let mut image = vec![];
        // a state that is there can be walked over
        let _ = self.walk(&mut Walk::Save(&mut image), false);
        image
    }

    /// To a state from before.
    pub(crate) fn go_back(&mut self, image: &[u64]) {
        self.kept.forget();
        // the same walk over what it made
        let _ = snapshot::load(image, |walk| self.walk(walk, false));
    }

    /// Over all that the future depends on.
    pub(crate) fn walk_state(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.kept.forget();
        self.walk(walk, false)
    }

    /// A call with signals or without; back to the state before where it fails.
    fn call(&mut self, t: f64, signals: Option<&[f64]>) -> Result<&[f64]> {
        self.keep();
        if let Err(error) = self.go(t, signals) {
            self.undo();
            return Err(error);
        }
        self.kept.add(t, signals, self.names.len());
        Ok(self.estimate())
    }

    /// Keeps the state, for a call that fails. What a smoother keeps does not come twice.
    fn keep(&mut self) {
        let (kept, most) = (&self.kept, CALLS * (2 + self.names.len()));
        if !kept.image.is_empty() && kept.since.len() < most && !self.runner.has_history() {
            return;
        }
        let mut kept = std::mem::take(&mut self.kept);
        kept.image.clear();
        kept.since.clear();
        kept.since.reserve(most);
        // a state that is there can be walked over
        let _ = self.walk(&mut Walk::Save(&mut kept.image), false);
        self.kept = kept;
    }

    /// Back to the state before the call under way.
    fn undo(&mut self) {
        let kept = std::mem::take(&mut self.kept);
        // the same walk over what it made
        let _ = snapshot::load(&kept.image, |walk| self.walk(walk, false));
        for call in kept.since.chunks_exact(2 + self.names.len()) {
            let (t, signals) = (call[0], (call[1] > 0.0).then_some(&call[2..]));
            // it was done before
            let _ = self.go(t, signals);
        }
        if self.record().is_some() {
            // that of the sample before is gone
            self.keep_record();
        }
        self.kept = kept;
        self.kept.forget();
    }

    fn go(&mut self, t: f64, signals: Option<&[f64]>) -> Result<()> {
        let before = self.time.replace(t);
        self.held = 0;
        match signals {
            Some(signals) => self.take(signals),
            None => self.signals[..self.sensors].fill(f64::NAN),
        }
        let (readings, inputs) = self.signals.split_at(self.sensors);
        let sample = Sample {
            t,
            readings,
            inputs,
            held: self.held,
        };
        let runner = &mut self.runner;
        match before {
            None => runner.begin(&sample)?,
            Some(before) if t > before => runner.advance(before, &sample)?,
            Some(_) => {}
        }
        if signals.is_some() {
            runner.update(&sample)?;
        }
        runner.report(t)?;
        if signals.is_some() {
            runner.remember();
        }
        Ok(())
    }

    /// Signals; of an input that is missing the last value holds.
    fn take(&mut self, signals: &[f64]) {
        let (readings, inputs) = signals.split_at(self.sensors);
        let (own, last) = self.signals.split_at_mut(self.sensors);
        own.copy_from_slice(readings);
        for (last, input) in last.iter_mut().zip(inputs) {
            match input.is_finite() {
                true => *last = *input,
                false => self.held += 1,
            }
        }
    }

    /// Over all that the future depends on, and what a smoother keeps where that is asked for.
    fn walk(&mut self, walk: &mut Walk<'_>, with_history: bool) -> Result<(), Damaged> {
        walk.optional(&mut self.time, Walk::number)?;
        walk.numbers(&mut self.signals)?;
        walk.count(&mut self.held)?;
        self.runner.walk(walk)?;
        match with_history {
            true => self.runner.walk_history(walk),
            false => Ok(()),
        }
    }
}
