//! What every filter does: predict, and correct.

use super::belief::Belief;
use super::profile::Skyline;
use super::sensing::Sensing;
use crate::Error;
use crate::Evaluation;
use crate::snapshot::Persist;

/// What the filters differ in.
pub(crate) trait Kalman: Persist {
    /// The plant between samples.
    fn driven(&mut self) -> &mut Evaluation;

    /// x̂⁻ and P⁻ at the next sample; where it is to be kept, the state-transition matrix is returned, which
    /// the smoother needs. A flow that fails leaves the belief as it was.
    fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Skyline, Error>;

    /// x̂⁺ and P⁺ by the readings of a sample.
    fn correct(
        &mut self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        t: f64,
        readings: &[f64],
        inputs: &[f64],
    ) -> Result<(), Error>;
}
