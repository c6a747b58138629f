//! The extended Kalman filter's correction.

use super::belief::Belief;
use super::censored::Believed;
use super::sensing::Sensing;
use super::smoother::Correction;
use crate::Result;
use crate::runner::Sample;

/// Room for its corrections.
#[derive(Clone, Debug, Default)]
pub(crate) struct Ekf {
    /// readings that correct
    taken: Vec<Believed>,
    /// the estimate before the first of them
    before: Vec<f64>,
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
    ) -> Result<()> {
        sensing.judge_all(belief, sample, &mut self.taken)?;
        self.before.clone_from(&belief.x);
        if let Some(record) = &mut sensing.record {
            let inside = self.taken.iter().filter(|b| b.end.is_none());
            let inside: Vec<Believed> = inside.copied().collect();
            record.count(&inside);
            record.join(&inside, &belief.root);
        }
        let inside = self.taken.iter().filter(|b| b.end.is_none());
        for believed in inside.chain(self.taken.iter().filter(|b| b.end.is_some())) {
            let spread = sensing.project(believed.sensor, belief);
            let (c, projected) = (&sensing.slopes, &sensing.projected);
            let moves = belief.x.iter().zip(&self.before).map(|(x, x0)| x - x0);
            let moved: f64 = c.iter().zip(moves).map(|(c, moved)| c * moved).sum();
            if let Some(record) = &mut sensing.record {
                record.count_at_end(believed, moved, spread);
            }
            let Some((rest, noise)) = believed.weighed(moved, spread) else {
                continue;
            };
            if !belief.take(projected, rest, noise, &mut self.gain) {
                continue;
            }
            if let (Some(record), Some(_)) = (&mut sensing.record, believed.end) {
                record.correct(believed.sensor, rest, self.gain.iter().copied());
            }
            if let Some(corrections) = &mut sensing.corrections {
                let (c, gain) = (c.clone(), self.gain.clone());
                corrections.push(Correction::single(c, rest, spread + noise, gain));
            }
        }
        Ok(())
    }
}
