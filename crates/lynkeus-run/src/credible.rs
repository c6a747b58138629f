//! When readings contradict an estimate: the figures of every judge, here and on a device.

/// What says how large an innovation may be.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum By {
    /// a filter's covariance
    Filter,
    /// an observer's linearised error system
    ErrorSystem,
    /// the same driven by the noises alone, from an exact start
    Settled,
    /// the sensor's noise alone
    Noise,
}

impl By {
    /// Innovations so many times larger than declared contradict the model.
    #[must_use]
    pub fn limit(self) -> f64 {
        match self {
            Self::Filter => 3.0,
            // linear, and with what held readings lag behind
            Self::ErrorSystem => 2.5,
            // it leaves out an estimate that still converges
            Self::Settled => 5.0,
            // and everything that the model does not know
            Self::Noise => 10.0,
        }
    }

    /// An observer with a theorem converges: its start is no contradiction.
    #[must_use]
    pub fn converges(self) -> bool {
        self != Self::Filter
    }
}

/// A reading that is farther off counts no more than one so many deviations off: glitches are few.
pub const CLIP: f64 = 30.0;
/// Of so many readings the largest innovation does not count.
pub const FEW: usize = 5;
/// Readings of which a share says something.
pub const ENOUGH: usize = 20;
/// A right run contradicts itself with this probability.
pub const CHANCE: f64 = 1e-6;
