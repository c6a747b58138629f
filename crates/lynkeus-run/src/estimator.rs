//! The one incremental core: any observer, fed sample by sample.

use crate::filter::{Filter, FilterModel, FilterSettings, Health, Innovation, Smoothed};
use crate::flow::Flow;
use crate::intake::Intake;
use crate::runner::{Core, Program};
use crate::sampled::{Sampled, SampledObserver};
use crate::snapshot::{self, Damaged, Persist, Walk};
use crate::{Error, Method, SnapshotFault, Step, StepAdvice, System};

/// What a signal is between two samples.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BetweenSamples {
    /// the value of the last sample: causal, late by half a sample on average
    #[default]
    Hold,
    /// the straight line between the samples. The estimate at a sample's time uses
    /// no later sample, but the path towards it is integrated with the sample at
    /// its end, so an estimate between samples would look ahead by one sample.
    Linear,
}

/// How an [`Estimator`] goes from sample to sample.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EstimatorSettings {
    /// the signals between samples
    pub between: BetweenSamples,
    /// how the observer is integrated; adaptive methods start anew at each sample
    pub method: Method,
}

impl Default for EstimatorSettings {
    /// Held signals and Runge–Kutta steps that are small enough for the observer.
    fn default() -> Self {
        Self {
            between: BetweenSamples::default(),
            method: Method::Rk4(Step::Auto),
        }
    }
}

/// Any observer, one sample after the other, live or from a log.
///
/// It goes to a time without a reading ([`predict`](Self::predict)), takes what sensors report
/// there ([`update`](Self::update)), or both at once ([`push`](Self::push)). Signals are the
/// readings in the order of the sensors, then the known inputs; a reading that is not finite says
/// that this sensor did not report, of an input that is not finite the last value holds. An
/// observer made of a [`System`] alone knows of no sensors: all its signals are inputs.
///
/// A call that fails changes nothing: the estimator stays at the
/// last good sample and the next call goes on from there. With [`Step::Substeps`] or
/// [`Step::AtMost`] neither a system nor a sampled observer nor the extended filter of up to eight
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
    intake: Intake,
    core: Core,
    /// of what is estimated
    names: Vec<String>,
    program: Program,
    /// the state before the call under way
    image: Vec<u8>,
}

impl Estimator {
    /// Of an observer whose signals are all there at every sample, at its start values.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method.
    pub fn new(observer: &System, settings: EstimatorSettings) -> Result<Self, Error> {
        let core = Core::Flow(Box::new(Flow::new(observer, settings)?));
        let intake = Intake::new(observer.signals().to_vec(), 0);
        let program = Program::new(vec![observer.clone()], format!("{settings:?}"));
        Ok(Self::of(
            core,
            intake,
            observer.estimates().to_vec(),
            program,
        ))
    }

    /// Of an observer whose sensors report when they do, at its start values.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method.
    pub fn sampled(observer: &SampledObserver, method: Method) -> Result<Self, Error> {
        let core = Core::Sampled(Box::new(Sampled::new(observer, method)?));
        let count = observer.sensors.len();
        let system = &observer.system;
        let tuned = observer.tuned.as_ref();
        let tuned = tuned.map_or(0, |tuned| tuned.system.outputs().len());
        let known = system.signals().len().saturating_sub(count + tuned);
        let inputs = system.signals().iter().take(known);
        let names = observer.sensors.iter().chain(inputs).cloned().collect();
        let told = system.outputs().len().saturating_sub(count);
        let outputs = system.outputs().iter().take(told).cloned();
        let mut systems = vec![system.clone()];
        systems.extend(observer.errors.iter().map(|e| e.flow().system().clone()));
        let noises = observer.errors.as_ref().map(|e| e.noises());
        let mut settings = format!(
            "{method:?} {} {:?} {noises:?}",
            observer.predict, observer.inputs
        );
        if let Some(tuned) = &observer.tuned {
            systems.push(tuned.system.clone());
            settings += &format!(" {:?}", tuned.values);
        }
        let program = Program::new(systems, settings);
        Ok(Self::of(
            core,
            Intake::new(names, count),
            outputs.collect(),
            program,
        ))
    }

    /// A Kalman filter, at the plant's first estimate.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method, the gate or the sigma points.
    pub fn filter(
        model: &FilterModel,
        settings: FilterSettings,
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let sensors = model.sensors().iter().map(|s| &s.name);
        let names = sensors.chain(model.inputs()).cloned().collect();
        let text = format!("{settings:?} {run:?} {}", model.numbers());
        let core = Core::Filter(Box::new(Filter::new(model, settings, run)?));
        let program = Program::new(model.systems().cloned().collect(), text);
        let intake = Intake::new(names, model.sensors().len());
        Ok(Self::of(core, intake, model.states().to_vec(), program))
    }

    fn of(core: Core, intake: Intake, names: Vec<String>, program: Program) -> Self {
        Self {
            intake,
            core,
            names,
            program,
            image: vec![],
        }
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
    /// [`BetweenSamples::Linear`] the way to `t` is along the line to these inputs, else this is
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
        &self.names
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
            Core::Flow(flow) => flow.advice(),
            _ => None,
        }
    }

    /// The state of the observer itself, by [`System::states`] for a system.
    #[must_use]
    pub fn state(&self) -> &[f64] {
        match &self.core {
            Core::Flow(flow) => flow.state(),
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
            _ => None,
        }
    }

    /// A number that differs for observers with other equations, settings, noises or starts.
    #[must_use]
    pub fn fingerprint(&self) -> u64 {
        self.program.fingerprint(self.intake.names())
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
        let state = snapshot::opened(snapshot, self.fingerprint())?;
        let mut restored = self.clone();
        snapshot::load(&mut Whole(&mut restored), state).map_err(|_| Error::Snapshot {
            fault: SnapshotFault::Damaged,
        })?;
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
            _ => Ok(()),
        }
    }
}
