//! Which filter, and how it works.

use crate::{Error, Result};

/// Which filter.
#[derive(Clone, Debug, PartialEq)]
pub enum FilterKind {
    /// the extended Kalman filter, continuous-discrete: the covariance follows the plant's
    /// linearisation along the estimate
    Extended,
    /// the unscented Kalman filter: sigma points follow the plant
    Unscented(SigmaPoints),
    /// moving-horizon estimation over so many samples, the states within the model's ranges
    MovingHorizon(usize),
    /// particles: no Gaussian, but points with weights
    Particles(Particles),
}

/// How particles are drawn and weighed.
#[derive(Clone, Debug, PartialEq)]
pub struct Particles {
    /// how many, from 2 to [`Particles::MOST`]
    pub count: usize,
    /// of their random numbers
    pub seed: u64,
    /// they are drawn anew where the effective number falls below this share of them
    pub resample_below: f64,
    /// drawn by what the next readings say of where the flow takes them: the auxiliary filter
    pub looks_ahead: bool,
    /// readings move all of them together by Kalman's formula with their sample covariances, and nothing weighs them;
    /// what is off their mean is then larger by this factor: the ensemble filter
    pub inflation: Option<f64>,
}

impl Particles {
    /// Most of them.
    pub const MOST: usize = 10_000_000;
}

impl Default for Particles {
    /// A thousand, drawn anew where less than half of them count.
    fn default() -> Self {
        Self {
            count: 1000,
            seed: 0,
            resample_below: 0.5,
            looks_ahead: false,
            inflation: None,
        }
    }
}

/// The patience of a gate, where nothing else is said.
pub const PATIENCE: usize = 10;

/// How a filter works.
#[derive(Clone, Debug, PartialEq)]
pub struct FilterSettings {
    /// which filter
    pub kind: FilterKind,
    /// a reading whose innovation exceeds so many of its standard deviations is rejected
    pub gate: Option<f64>,
    /// after so many rejections in a row, half of which differ from the reading before, the next is believed:
    /// a gate must not lock the filter out for ever, but a sensor that hangs is no reason to doubt the estimate
    pub patience: usize,
    /// keep what a smoother needs
    pub keep_history: bool,
    /// the estimate is kept in the model's ranges: after each prediction and correction it is put to the
    /// nearest place inside by the covariance's metric. The covariance stays: a bound says where
    /// the estimate is, and not how sure it is
    pub projects: bool,
    /// how often an extended filter linearises the readings of a sample, at most: once about the prediction, then
    /// about what they make of it
    pub iterations: usize,
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
            patience: PATIENCE,
            keep_history: false,
            projects: false,
            iterations: 1,
            foresees: false,
        }
    }

    /// That they can be, for n states with so many ranges.
    pub(crate) fn check(&self, n: usize, ranges: usize) -> Result<()> {
        if let Some(gate) = self.gate
            && !(gate > 0.0 && gate.is_finite())
        {
            let expected = "a number of standard deviations above 0";
            return Err(Error::setting("gate", expected, gate));
        }
        if (self.projects || self.is_window()) && ranges != n {
            let expected = format!("{n}, one pair per state");
            return Err(Error::setting("bounds", expected, ranges));
        }
        if matches!(self.kind, FilterKind::Particles(_)) {
            for (what, is_asked) in [
                ("smoother", self.keep_history),
                ("bounds", self.projects),
                ("covariances without readings", self.foresees),
            ] {
                if is_asked {
                    return Err(Error::setting(what, "none of particles", "one"));
                }
            }
        }
        if self.projects && self.keep_history {
            let found = "a smoother beside them";
            return Err(Error::setting("bounds", "no smoother", found));
        }
        Ok(())
    }

    pub(crate) fn is_window(&self) -> bool {
        matches!(self.kind, FilterKind::MovingHorizon(_))
    }
}

/// How sigma points are spread and weighed, after Julier, Uhlmann and van der Merwe; the
/// default makes the cubature filter of Arasaratnam and Haykin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints {
    /// α > 0
    pub alpha: f64,
    /// β
    pub beta: f64,
    /// κ, with n + κ > 0
    pub kappa: f64,
}

impl Default for SigmaPoints {
    fn default() -> Self {
        Self {
            alpha: 1.0,
            beta: 0.0,
            kappa: 0.0,
        }
    }
}

/// Weights of 2n + 1 points x̂, x̂ ± columns of √(n+λ) L.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// √(n+λ): how far the points lie from x̂, in columns of L
    pub spread: f64,
    /// of x̂ in means
    pub mean_of_centre: f64,
    /// of x̂ in covariances
    pub centre: f64,
    /// of each other point
    pub other: f64,
}

impl SigmaPoints {
    /// The weights for n states.
    ///
    /// # Errors
    /// [`Error::Setting`] where α²(n + κ) is not above 0.
    pub fn weights(&self, n: usize) -> Result<Weights> {
        let n = n as f64;
        let both = self.alpha.powi(2) * (n + self.kappa);
        if !(both > 0.0 && both.is_finite() && self.beta.is_finite()) {
            let Self { alpha, beta, kappa } = self;
            let found = format!("alpha = {alpha}, beta = {beta}, kappa = {kappa}");
            let expected =
                format!("alpha² (n + kappa) above 0 for n = {n} states, and finite numbers");
            return Err(Error::setting("sigma points", expected, found));
        }
        let mean_of_centre = (both - n) / both;
        Ok(Weights {
            spread: both.sqrt(),
            mean_of_centre,
            centre: mean_of_centre + 1.0 - self.alpha.powi(2) + self.beta,
            other: 0.5 / both,
        })
    }
}
