//! An observer fed sample by sample.

use crate::divergence::Bound;
use crate::driven::Driven;
use crate::{Dynamics, Error, Integrator, Method, Step, StepAdvice, System};

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

/// An observer that takes one sample after the other, live or from a log.
///
/// With [`Step::Substeps`] or [`Step::AtMost`] a push does not allocate after the second.
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
/// assert!((estimator.state()[0] - 1.0).abs() < 1e-6);
/// # Ok::<(), lynkeus_run::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Estimator {
    driven: Driven,
    integrator: Integrator,
    time: Option<f64>,
    x: Vec<f64>,
    estimates: Vec<f64>,
    bound: Bound,
    samples: usize,
}

impl Estimator {
    /// An estimator at the observer's start values, waiting for the first sample.
    ///
    /// # Errors
    /// [`Error::Setting`] for impossible numbers of the method.
    pub fn new(observer: &System, settings: EstimatorSettings) -> Result<Self, Error> {
        Ok(Self {
            integrator: Integrator::new(settings.method, observer.states().len())?,
            time: None,
            x: observer.start().to_vec(),
            estimates: vec![0.0; observer.estimates().len()],
            bound: Bound::new(observer.start()),
            samples: 0,
            driven: Driven::new(observer, settings.between),
        })
    }

    /// Takes the sample (`t`, `signals`) and returns the estimates at `t`, in the
    /// order of [`System::estimates`]. The first sample only sets the time.
    ///
    /// `signals` are in the order of [`System::signals`]. After an error of the
    /// integration the state is the last one reached.
    ///
    /// # Errors
    /// [`Error::TimeOrder`], [`Error::NotANumber`], [`Error::Setting`] for the
    /// sample; [`Error::Diverged`] and the errors of the integration.
    pub fn push(&mut self, t: f64, signals: &[f64]) -> Result<&[f64], Error> {
        self.samples += 1;
        self.check_sample(t, signals)?;
        self.bound.see(signals);
        match self.time {
            None => self.driven.start(signals),
            Some(before) => {
                self.driven.aim(before, t, signals);
                self.integrator
                    .advance(&mut self.driven, before, t, &mut self.x)?;
                self.driven.arrive();
            }
        }
        self.time = Some(t);
        self.report(t)
    }

    /// The observer's state at the last sample.
    pub fn state(&self) -> &[f64] {
        &self.x
    }

    /// Time of the last sample.
    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// For fixed steps: the step in use beside the one that the observer needs, as
    /// of [`Integrator::advice`]; none before the second sample.
    pub fn advice(&self) -> Option<StepAdvice> {
        self.integrator.advice()
    }

    fn check_sample(&self, t: f64, signals: &[f64]) -> Result<(), Error> {
        let names = self.driven.evaluation.system().signals();
        if signals.len() != names.len() {
            let expected = format!("{}: {}", names.len(), names.join(", "));
            return Err(Error::setting("number of signals", expected, signals.len()));
        }
        let not_a_number = |column: &str, value| Error::NotANumber {
            row: self.samples,
            column: column.to_owned(),
            value,
        };
        if !t.is_finite() {
            return Err(not_a_number("t", t));
        }
        if let Some(i) = signals.iter().position(|v| !v.is_finite()) {
            return Err(not_a_number(&names[i], signals[i]));
        }
        match self.time {
            Some(previous) if t <= previous => Err(Error::TimeOrder {
                row: self.samples,
                previous,
                time: t,
            }),
            _ => Ok(()),
        }
    }

    fn report(&mut self, t: f64) -> Result<&[f64], Error> {
        let names = self.driven.evaluation.system().states();
        self.bound
            .check(t, names, &self.x, || self.integrator.hint())?;
        let evaluation = &mut self.driven.evaluation;
        evaluation.enter(t);
        evaluation.estimates(t, &self.x, &mut self.estimates);
        if self.estimates.iter().any(|v| !v.is_finite()) {
            return Err(evaluation.not_finite(t, &self.x));
        }
        Ok(&self.estimates)
    }
}
