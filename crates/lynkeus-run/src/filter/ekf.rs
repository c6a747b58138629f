//! The extended Kalman filter's correction.

use super::belief::Belief;
use super::root::dot;
use super::sensing::{Believed, Sensing};
use super::smoother::Correction;
use crate::Error;
use crate::runner::Sample;

/// Room for its corrections.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ekf {
    /// readings that correct
    taken: Vec<Believed>,
    /// the estimate before the first of them
    before: Vec<f64>,
    /// a row of C
    slopes: Vec<f64>,
    projected: Vec<f64>,
    gain: Vec<f64>,
}

impl Ekf {
    /// x̂⁺ and P⁺ by the readings one after the other, which for sensors with independent noises is all of them
    /// at once: slopes and predictions are those at x̂⁻. Those at an end of their sensor's range come last:
    /// what they say depends on what the others leave of the estimate.
    pub fn correct(
        &mut self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        sample: &Sample<'_>,
    ) -> Result<(), Error> {
        let Self {
            taken,
            before,
            slopes: c,
            projected,
            gain,
        } = self;
        sensing.judge_all(belief, sample, taken)?;
        before.clone_from(&belief.x);
        c.resize(before.len(), 0.0);
        projected.resize(before.len(), 0.0);
        let inside = taken.iter().filter(|b| b.end.is_none());
        for believed in inside.chain(taken.iter().filter(|b| b.end.is_some())) {
            sensing.output_map.write_slopes(believed.sensor, c);
            let moves = belief.x.iter().zip(&*before).map(|(x, x0)| x - x0);
            let moved: f64 = c.iter().zip(moves).map(|(c, moved)| c * moved).sum();
            belief.root.transposed_times(c, projected);
            let spread = dot(projected, projected);
            let Some((rest, noise)) = believed.weighed(moved, spread) else {
                continue;
            };
            if !belief.take(projected, rest, noise, gain) {
                continue;
            }
            if let Some(corrections) = &mut sensing.corrections {
                let (c, gain) = (c.clone(), gain.clone());
                corrections.push(Correction::single(c, rest, spread + noise, gain));
            }
        }
        Ok(())
    }
}
