//! The extended Kalman filter, continuous-discrete.

use std::sync::Arc;

use super::belief::Belief;
use super::kalman::Kalman;
use super::profile::Skyline;
use super::root::{Gain, Root, dot};
use super::sensing::{Believed, Sensing};
use super::smoother::Correction;
use super::transition::{Propagation, Stage, push_carried};
use crate::Evaluation;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Linearised};

#[derive(Clone, Debug)]
pub(crate) struct Ekf {
    pub driven: Evaluation,
    propagation: Propagation,
    /// x̂⁻
    x: Vec<f64>,
    /// rows whose sum of squares is P⁻
    rows: Vec<f64>,
    sums: Vec<f64>,
    /// readings that correct
    taken: Vec<Believed>,
    /// the estimate before the first of them
    before: Vec<f64>,
    /// a row of C
    slopes: Vec<f64>,
    projected: Vec<f64>,
    gain: Gain,
}

impl Ekf {
    /// Of a flow with F, and the densities of the noise on its states.
    pub fn new(
        flow: &Linearised,
        process_noise: &[f64],
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let n = flow.system().states().len();
        Ok(Self {
            driven: flow.system().driven(run.between),
            propagation: Propagation::new(flow, process_noise, run.method)?,
            x: vec![0.0; n],
            rows: vec![],
            sums: vec![0.0; n],
            taken: vec![],
            before: vec![],
            slopes: vec![0.0; n],
            projected: vec![0.0; n],
            gain: Gain::default(),
        })
    }

    /// ΦPΦᵀ + W over the way that was gone last.
    pub fn carry(&mut self, root: &mut Root) {
        self.rows.clear();
        // the rows of W come first: their zeros are spared in the reflections
        self.propagation.push_root(&mut self.rows);
        let transition = self.propagation.transition().rows();
        push_carried(transition, root, &mut self.rows, &mut self.sums);
        root.of_rows_with(&mut self.rows, &mut self.sums);
    }

    /// The way from a state, without carrying a belief along it; the root chooses units where there
    /// are many states.
    pub(super) fn stage(&mut self, about: Belief, from: f64, to: f64) -> Result<Stage, Error> {
        self.x.clone_from(&about.x);
        let (driven, x) = (&mut self.driven, &mut self.x);
        self.propagation.advance(driven, &about, from, to, x)?;
        let mut noise = vec![];
        self.propagation.push_root(&mut noise);
        Ok(Stage {
            about: about.x,
            end: self.x.clone(),
            transition: Arc::new(Skyline::of(self.propagation.transition())),
            noise,
        })
    }
}

impl Kalman for Ekf {
    fn driven(&mut self) -> &mut Evaluation {
        &mut self.driven
    }

    /// P⁻ = ΦPΦᵀ + W.
    fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Skyline, Error> {
        self.x.clone_from(&belief.x);
        let (driven, x) = (&mut self.driven, &mut self.x);
        self.propagation.advance(driven, belief, from, to, x)?;
        belief.x.clone_from(&self.x);
        self.carry(&mut belief.root);
        Ok(match keep {
            true => Skyline::of(self.propagation.transition()),
            false => Skyline::default(),
        })
    }

    /// The readings one after the other, which for sensors with independent noises is all of them
    /// at once: slopes and predictions are those at x̂⁻. Those at an end of their sensor's range come last:
    /// what they say depends on what the others leave of the estimate.
    fn correct(
        &mut self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        t: f64,
        readings: &[f64],
        inputs: &[f64],
    ) -> Result<(), Error> {
        let Self {
            taken,
            before,
            slopes: c,
            projected,
            gain,
            ..
        } = self;
        sensing.judge_all(belief, t, readings, inputs, taken)?;
        before.clone_from(&belief.x);
        let inside = taken.iter().filter(|b| b.end.is_none());
        for believed in inside.chain(taken.iter().filter(|b| b.end.is_some())) {
            sensing.write_slopes(believed.sensor, c);
            let moves = belief.x.iter().zip(&*before).map(|(x, x0)| x - x0);
            let moved: f64 = c.iter().zip(moves).map(|(c, moved)| c * moved).sum();
            belief.root.transposed_times(c, projected);
            let spread = dot(projected, projected);
            let Some((rest, noise)) = believed.weighed(moved, spread) else {
                continue;
            };
            if !belief.root.update_into(projected, noise, gain) {
                continue;
            }
            for (x, k) in belief.x.iter_mut().zip(&gain.values) {
                *x += k * rest;
            }
            if let Some(corrections) = &mut sensing.corrections {
                let gain = gain.values.clone();
                corrections.push(Correction::single(c.clone(), rest, spread + noise, gain));
            }
        }
        Ok(())
    }
}

impl Persist for Ekf {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.propagation.walk(walk)
    }
}
