//! The extended Kalman filter's correction.

use super::belief::Belief;
use super::censored::Believed;
use super::root::Root;
use super::sensing::Sensing;
use super::smoother::Correction;
use crate::Result;
use crate::manifold::Manifold;
use crate::runner::Sample;

/// A step of the iteration that is smaller than this, in deviations of what is known after it, is the last.
const SMALL: f64 = 1e-4;

/// Room for its corrections.
#[derive(Clone, Debug)]
pub(crate) struct Ekf {
    /// how often a sample's readings are linearised, at most
    iterations: usize,
    /// readings that correct
    taken: Vec<Believed>,
    /// the estimate before the first of them
    before: Vec<f64>,
    /// the root of its covariance
    prior: Root,
    gain: Vec<f64>,
}

impl Ekf {
    /// Whose corrections are linearised so often, at most.
    pub fn new(iterations: usize) -> Self {
        Self {
            iterations,
            taken: vec![],
            before: vec![],
            prior: Root::diagonal(&[]),
            gain: vec![],
        }
    }

    /// x̂⁺ and P⁺ by the readings of a sample, with the slopes and predictions at x̂⁻; then, where more iterations are
    /// asked for, by Gauss and Newton's steps: from x̂⁻ and P⁻ again, with those at the estimate that was found,
    /// until it stays (B. M. Bell and F. W. Cathey, *IEEE Transactions on Automatic Control* 38 (1993) 294–297). What is
    /// added to x̂⁻ is tangent there, and slopes elsewhere are carried over to it.
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
        if self.iterations < 2 {
            self.pass(sensing, belief, None);
            return Ok(());
        }
        self.prior.clone_from(&belief.root);
        self.pass(sensing, belief, None);
        let mut at = self.before.clone();
        self.go_on(&sensing.manifold, &at, at.clone(), &mut belief.x);
        for _ in 1..self.iterations {
            if self.taken.is_empty() || stays(&at, belief) {
                break;
            }
            at.clone_from(&belief.x);
            let mut about = at.clone();
            sensing.manifold.retract(&self.before, &mut about);
            let map = &mut sensing.output_map;
            if map.linearise(sample.t, &about, sample.inputs).is_err() {
                // the sensors have no value there: what was found stays
                break;
            }
            belief.x.clone_from(&self.before);
            belief.root.clone_from(&self.prior);
            self.look(sensing, &at, &about);
            self.pass(sensing, belief, Some(&about));
            self.go_on(&sensing.manifold, &at, about, &mut belief.x);
        }
        Ok(())
    }

    /// A step was found in the plane that touches at x̂⁻, where it led from `at` to x: it is gone from the place itself,
    /// and x is where that is, by the shorter way.
    fn go_on(&self, manifold: &Manifold, at: &[f64], about: Vec<f64>, x: &mut [f64]) {
        if manifold.is_straight() {
            return;
        }
        let mut step: Vec<f64> = x.iter().zip(at).map(|(x, at)| x - at).collect();
        manifold.transport(&self.before, &about, &mut step, 1);
        for ((x, about), step) in x.iter_mut().zip(&about).zip(step) {
            *x = about + step;
        }
        manifold.retract(&about, x);
        manifold.flatten(&self.before, x);
    }

    /// The innovations about another place, `at` in the plane that touches at x̂⁻, as those of x̂⁻.
    fn look(&mut self, sensing: &mut Sensing, at: &[f64], about: &[f64]) {
        for believed in &mut self.taken {
            sensing.take_slopes(believed.sensor, Some((about, &self.before)));
            let moves = at.iter().zip(&self.before).map(|(x, x0)| x - x0);
            let moved: f64 = sensing.slopes.iter().zip(moves).map(|(c, m)| c * m).sum();
            let predicted = sensing.output_map.outputs()[believed.sensor] - moved;
            let manifold = &sensing.manifold;
            let reading = manifold.lifted(believed.sensor, believed.reading, predicted);
            believed.innovation = reading - predicted;
        }
    }

    /// The readings one after the other, which for sensors with independent noises is all of them
    /// at once. Those at an end of their sensor's range come last: what they say depends on what the others leave of
    /// the estimate.
    fn pass(&mut self, sensing: &mut Sensing, belief: &mut Belief, about: Option<&[f64]>) {
        if let Some(corrections) = &mut sensing.corrections {
            corrections.clear();
        }
        let inside = self.taken.iter().filter(|b| b.end.is_none());
        for believed in inside.chain(self.taken.iter().filter(|b| b.end.is_some())) {
            let carried = about.map(|about| (about, &self.before[..]));
            let spread = sensing.project(believed.sensor, belief, carried);
            let (c, projected) = (&sensing.slopes, &sensing.projected);
            let moves = belief.x.iter().zip(&self.before).map(|(x, x0)| x - x0);
            let moved: f64 = c.iter().zip(moves).map(|(c, moved)| c * moved).sum();
            if let (Some(record), None) = (&mut sensing.record, about) {
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
    }
}

/// Whether the estimate is where it was, beside what is known of it.
fn stays(before: &[f64], belief: &Belief) -> bool {
    let steps = belief.x.iter().zip(before).enumerate();
    let mut steps = steps.map(|(i, (x, x0))| ((x - x0).abs(), belief.root.deviation(i)));
    steps.all(|(step, deviation)| step <= SMALL * deviation)
}
