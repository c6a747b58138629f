//! Any observer, fed sample by sample.

use std::sync::{Arc, OnceLock};

use crate::filter::{Filter, FilterSettings, Health, Innovation, NoisyModel, Smoothed};
use crate::runner::{Runner, Sample};
use crate::sampled::Sampled;
use crate::snapshot::{self, Damaged, Persist, Walk};
use crate::{
    Blueprint, Error, EstimatorSettings, Method, SampledObserver, SnapshotFault, StepAdvice, System,
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
    intake: Intake,
    core: Core,
    /// the state before the call under way
    image: Vec<u8>,
}

impl Blueprint {
    /// The estimator, at its start.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method; for a filter also of the gate or the
    /// sigma points.
    pub fn estimator(&self) -> Result<Estimator, Error> {
        Estimator::of(self.clone())
    }
}

impl Estimator {
    fn of(blueprint: Blueprint) -> Result<Self, Error> {
        let core = match &blueprint {
            Blueprint::Sampled { observer, method } => {
                Core::Sampled(Box::new(Sampled::new(observer, *method)?))
            }
            Blueprint::Filter {
                model,
                settings,
                run,
            } => Core::Filter(Box::new(Filter::new(model, settings, *run)?)),
        };
        let sensors = blueprint.sensors();
        Ok(Self {
            intake: Intake::new([&sensors[..], blueprint.inputs()].concat(), sensors.len()),
            blueprint: Arc::new(blueprint),
            fingerprint: OnceLock::new(),
            core,
            image: vec![],
        })
    }

    /// Of an observer whose signals are all there at every sample, at its start values.
    ///
    /// # Errors
    /// As [`Blueprint::estimator`].
    pub fn new(observer: &System, settings: EstimatorSettings) -> Result<Self, Error> {
        Self::of(Blueprint::new(observer, settings))
    }

    /// Of an observer whose sensors report when they do, at its start values.
    ///
    /// # Errors
    /// As [`Blueprint::estimator`].
    pub fn sampled(observer: &SampledObserver, method: Method) -> Result<Self, Error> {
        let observer = Box::new(observer.clone());
        Self::of(Blueprint::Sampled { observer, method })
    }

    /// A Kalman filter, at the plant's first estimate.
    ///
    /// # Errors
    /// As [`Blueprint::estimator`].
    pub fn filter(
        model: &NoisyModel,
        settings: FilterSettings,
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let model = Box::new(model.clone());
        Self::of(Blueprint::Filter {
            model,
            settings,
            run,
        })
    }

    /// Goes to `t`, at which nothing is read: inputs stay as they were, and the estimate is
    /// what follows from the samples before.
    ///
    /// # Errors
    /// [`Error::Setting`] before the first sample, [`Error::TimeBefore`], [`Error::NoNumber`];
    /// [`Error::Diverged`], [`Error::NotFinite`] and the errors of the integration.
    pub fn predict(&mut self, t: f64) -> Result<&[f64], Error> {
        self.save();
        let before = self.intake.time();
        self.intake.wait(t)?;
        self.settle(before, false)
    }

    /// Takes signals at the time where the estimator is.
    ///
    /// # Errors
    /// As [`Estimator::push`], and [`Error::Setting`] before the first sample.
    pub fn update(&mut self, signals: &[f64]) -> Result<&[f64], Error> {
        let t = self.intake.started()?;
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
    pub fn push(&mut self, t: f64, signals: &[f64]) -> Result<&[f64], Error> {
        self.save();
        let before = self.intake.time();
        self.intake.take(t, signals)?;
        self.settle(before, true)
    }

    /// Names of the signals: sensors, then known inputs.
    #[must_use]
    pub fn signals(&self) -> &[String] {
        self.intake.names()
    }

    /// How many of the signals are readings of sensors, which may be missing.
    #[must_use]
    pub fn sensors(&self) -> usize {
        self.intake.sensors()
    }

    /// Names of what is estimated, monitors last.
    #[must_use]
    pub fn names(&self) -> &[String] {
        self.blueprint.estimates()
    }

    /// The estimate after the last call that succeeded, in the order of [`Estimator::names`].
    #[must_use]
    pub fn estimate(&self) -> &[f64] {
        self.core.runner().estimate()
    }

    /// Its standard deviations, monitors left out; none for an observer without a model of its
    /// errors.
    #[must_use]
    pub fn deviations(&self) -> Option<&[f64]> {
        self.core.runner().deviations()
    }

    /// What became of the last readings, one per sensor; empty where no covariance says what to
    /// expect of them.
    #[must_use]
    pub fn innovations(&self) -> &[Innovation] {
        self.core.runner().innovations()
    }

    /// How readings and estimate went together so far.
    #[must_use]
    pub fn health(&self) -> &Health {
        self.core.runner().health()
    }

    /// Time of the last sample or prediction.
    #[must_use]
    pub fn time(&self) -> Option<f64> {
        self.intake.time()
    }

    /// For a [`System`] with fixed steps: the step in use beside the one that it needs, as of
    /// [`Integrator::advice`](crate::Integrator::advice); none before the second sample.
    #[must_use]
    pub fn advice(&self) -> Option<StepAdvice> {
        match &self.core {
            Core::Sampled(sampled) if self.sensors() == 0 => sampled.advice(),
            _ => None,
        }
    }

    /// The state of the observer itself, by [`System::states`] for a system.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        match &self.core {
            Core::Sampled(sampled) => sampled.state(),
            Core::Filter(filter) => filter.estimate(),
        }
    }

    /// The estimate at each update given all of them, or those up to `lag` updates later, with
    /// standard deviations if asked for; none for an estimator that keeps no history, and for a
    /// moving horizon that reaches back by fewer than `lag` samples.
    #[must_use]
    pub fn smoothed(&self, lag: Option<usize>, deviations: bool) -> Option<Vec<Smoothed>> {
        match &self.core {
            Core::Filter(filter) => filter.smoothed(lag, deviations),
            Core::Sampled(_) => None,
        }
    }

    /// A number that differs for observers with other equations, settings, noises or starts.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        *self
            .fingerprint
            .get_or_init(|| self.blueprint.fingerprint())
    }

    /// Everything that the future depends on, with a version, the [fingerprint](Self::fingerprint)
    /// and a checksum. What a smoother keeps is in it, too.
    #[must_use]
    pub fn snapshot(&self) -> Vec<u8> {
        snapshot::seal(self.fingerprint(), &mut Whole(&mut self.clone()))
    }

    /// Goes to where another estimator of the same observer was: from there on both give the
    /// same, to the last bit. Where a snapshot is refused nothing changes.
    ///
    /// # Errors
    /// [`Error::Snapshot`]: damaged, of another version, or of another observer.
    pub fn restore(&mut self, snapshot: &[u8]) -> Result<(), Error> {
        let refused = |fault| Error::Snapshot { fault };
        let state = snapshot::opened(snapshot, self.fingerprint()).map_err(refused)?;
        let mut restored = self.clone();
        snapshot::load(&mut Whole(&mut restored), state)
            .map_err(|_| refused(SnapshotFault::Damaged))?;
        *self = restored;
        Ok(())
    }

    /// Keeps the state, for a call that fails.
    fn save(&mut self) {
        let mut image = std::mem::take(&mut self.image);
        image.clear();
        // a state that is there can be walked over
        let _ = self.walk(&mut Walk::Save(&mut image));
        self.image = image;
    }

    /// The observer to the sample that was taken in; back to what was saved where that fails.
    fn settle(&mut self, before: Option<f64>, has_signals: bool) -> Result<&[f64], Error> {
        if let Err(error) = self.go(before, has_signals) {
            let image = std::mem::take(&mut self.image);
            // the same walk over what it made
            let _ = snapshot::load(self, &image);
            self.image = image;
            return Err(error);
        }
        if let Core::Filter(filter) = &mut self.core
            && has_signals
        {
            filter.remember();
        }
        Ok(self.estimate())
    }

    fn go(&mut self, before: Option<f64>, has_signals: bool) -> Result<(), Error> {
        let sample = self.intake.sample();
        let runner = self.core.runner_mut();
        match before {
            None => runner.begin(&sample)?,
            Some(before) if sample.t > before => runner.advance(before, &sample)?,
            Some(_) => {}
        }
        if has_signals {
            runner.update(&sample)?;
        }
        runner.report(sample.t)
    }
}

impl Persist for Estimator {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.intake.walk(walk)?;
        self.core.runner_mut().walk(walk)
    }
}

/// An estimator with what its smoother keeps.
struct Whole<'e>(&'e mut Estimator);

impl Persist for Whole<'_> {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.0.walk(walk)?;
        match &mut self.0.core {
            Core::Filter(filter) => filter.walk_history(walk),
            Core::Sampled(_) => Ok(()),
        }
    }
}

/// The samples so far, and whether the next one may follow them.
#[derive(Clone, Debug)]
pub(crate) struct Intake {
    /// of the sensors, then of the known inputs
    names: Vec<String>,
    sensors: usize,
    time: Option<f64>,
    values: Vec<f64>,
    held: usize,
}

impl Intake {
    pub fn new(names: Vec<String>, sensors: usize) -> Self {
        Self {
            values: vec![0.0; names.len()],
            names,
            sensors,
            time: None,
            held: 0,
        }
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn sensors(&self) -> usize {
        self.sensors
    }

    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// The sample taken last.
    pub fn sample(&self) -> Sample<'_> {
        let (readings, inputs) = self.values.split_at(self.sensors);
        Sample {
            t: self.time.unwrap_or_default(),
            readings,
            inputs,
            held: self.held,
        }
    }

    /// Takes a sample, or nothing where one is refused.
    ///
    /// # Errors
    /// [`Error::Setting`] for a wrong number of signals, [`Error::NoNumber`] for a time or the
    /// first value of an input, [`Error::TimeBefore`].
    pub fn take(&mut self, t: f64, signals: &[f64]) -> Result<(), Error> {
        if signals.len() != self.names.len() {
            let expected = format!("{}: {}", self.names.len(), self.names.join(", "));
            return Err(Error::setting("number of signals", expected, signals.len()));
        }
        self.check_time(t)?;
        let inputs = self.sensors..self.names.len();
        let missing = |i: &usize| !signals[*i].is_finite();
        if let (None, Some(i)) = (self.time, inputs.clone().find(missing)) {
            return Err(no_number(&self.names[i], signals[i]));
        }
        self.values[..self.sensors].copy_from_slice(&signals[..self.sensors]);
        self.held = inputs.clone().filter(missing).count();
        for i in inputs.filter(|i| signals[*i].is_finite()) {
            self.values[i] = signals[i];
        }
        self.time = Some(t);
        Ok(())
    }

    /// Goes to a time at which nothing reports.
    ///
    /// # Errors
    /// As [`Intake::take`], and before the first sample.
    pub fn wait(&mut self, t: f64) -> Result<(), Error> {
        self.started()?;
        self.check_time(t)?;
        self.values[..self.sensors].fill(f64::NAN);
        self.held = 0;
        self.time = Some(t);
        Ok(())
    }

    /// The time of the last sample.
    ///
    /// # Errors
    /// [`Error::Setting`] where there is none.
    pub fn started(&self) -> Result<f64, Error> {
        let none = || Error::setting("samples so far", "one, which sets the time", 0);
        self.time.ok_or_else(none)
    }

    fn check_time(&self, t: f64) -> Result<(), Error> {
        if !t.is_finite() {
            return Err(no_number("t", t));
        }
        match self.time {
            Some(reached) if t < reached => Err(Error::TimeBefore { reached, time: t }),
            _ => Ok(()),
        }
    }
}

fn no_number(signal: &str, value: f64) -> Error {
    Error::NoNumber {
        signal: signal.to_owned(),
        value,
    }
}

impl Persist for Intake {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.optional(&mut self.time, Walk::number)?;
        walk.numbers(&mut self.values)?;
        walk.count(&mut self.held)
    }
}

/// An observer of any kind.
#[derive(Clone, Debug)]
pub(crate) enum Core {
    Sampled(Box<Sampled>),
    Filter(Box<Filter>),
}

impl Core {
    pub fn runner(&self) -> &dyn Runner {
        match self {
            Self::Sampled(sampled) => &**sampled,
            Self::Filter(filter) => &**filter,
        }
    }

    pub fn runner_mut(&mut self) -> &mut dyn Runner {
        match self {
            Self::Sampled(sampled) => &mut **sampled,
            Self::Filter(filter) => &mut **filter,
        }
    }
}
