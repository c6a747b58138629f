//! The extended Kalman filter, continuous-discrete.

use std::sync::Arc;

use super::Belief;
use super::along::Along;
use super::root::{Gain, Root, dot};
use super::sensing::{Believed, Sensing};
use super::smooth::Correction;
use super::spanned::Rows;
use super::stage::Stage;
use crate::driven::Driven;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Linearised};

#[derive(Clone, Debug)]
pub(crate) struct Extended {
    pub driven: Driven,
    along: Along,
    /// x̂⁻
    x: Vec<f64>,
    /// rows whose sum of squares is P⁻
    rows: Vec<f64>,
    sums: Vec<f64>,
}

impl Extended {
    /// Of a flow with F, and the densities of the noise on its states.
    pub fn new(
        flow: &Linearised,
        process_noise: &[f64],
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let n = flow.system().states().len();
        Ok(Self {
            driven: Driven::new(flow.system(), run.between),
            along: Along::new(flow, process_noise, run.method)?,
            x: vec![0.0; n],
            rows: vec![],
            sums: vec![0.0; n],
        })
    }

    /// x̂⁻ and P⁻ = ΦPΦᵀ + W at the next sample. Φ is returned where it is to be kept. Where the
    /// flow fails the belief is as it was.
    pub fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Rows, Error> {
        self.x.clone_from(&belief.x);
        let (driven, x) = (&mut self.driven, &mut self.x);
        self.along.advance(driven, belief, from, to, x)?;
        belief.x.clone_from(&self.x);
        self.carry(&mut belief.root);
        Ok(match keep {
            true => Rows::of(self.along.transition()),
            false => Rows::default(),
        })
    }

    /// ΦPΦᵀ + W over the way that was gone last.
    pub fn carry(&mut self, root: &mut Root) {
        self.rows.clear();
        // the rows of W come first: their zeros are spared in the reflections
        self.along.push_root(&mut self.rows);
        self.push_carried(root);
        root.of_rows_with(&mut self.rows, &mut self.sums);
    }

    /// The way from a state, without carrying a belief along it; the root chooses units where there
    /// are many states.
    pub(super) fn stage(&mut self, about: Belief, from: f64, to: f64) -> Result<Stage, Error> {
        self.x.clone_from(&about.x);
        let (driven, x) = (&mut self.driven, &mut self.x);
        self.along.advance(driven, &about, from, to, x)?;
        let mut noise = vec![];
        self.along.push_root(&mut noise);
        Ok(Stage {
            about: about.x,
            end: self.x.clone(),
            transition: Arc::new(Rows::of(self.along.transition())),
            noise,
        })
    }

    /// The rows of (ΦS)ᵀ.
    fn push_carried(&mut self, root: &Root) {
        let (n, transition) = (self.x.len(), self.along.transition());
        let first = self.rows.len();
        self.rows.resize(first + n * n, 0.0);
        let into = &mut self.rows[first..];
        let sums = &mut self.sums;
        for i in 0..n {
            sums.fill(0.0);
            for (j, phi) in transition.span(i).zip(transition.row(i)) {
                for (sum, s) in sums.iter_mut().zip(&root.row(j)[..=j]) {
                    *sum += phi * s;
                }
            }
            let column = into[i..].iter_mut().step_by(n);
            column.zip(&*sums).for_each(|(into, sum)| *into = *sum);
        }
    }
}

impl Persist for Extended {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.along.walk(walk)
    }
}

/// Room for a correction.
#[derive(Clone, Debug, Default)]
pub(super) struct Room {
    h: Vec<f64>,
    before: Vec<f64>,
    /// C, row by row
    slopes: Vec<f64>,
    projected: Vec<f64>,
    gain: Gain,
    taken: Vec<Believed>,
}

/// The readings one after the other, which for sensors with independent noises is all of them
/// at once: slopes and predictions are those at x̂⁻. Those at an end of their sensor's range come last:
/// what they say depends on what the others leave of the estimate.
pub(super) fn correct(
    sensing: &mut Sensing,
    belief: &mut Belief,
    t: f64,
    readings: &[f64],
    inputs: &[f64],
) -> Result<(), Error> {
    let mut room = std::mem::take(&mut sensing.room);
    let result = correct_in(&mut room, sensing, belief, t, readings, inputs);
    sensing.room = room;
    result
}

fn correct_in(
    room: &mut Room,
    sensing: &mut Sensing,
    belief: &mut Belief,
    t: f64,
    readings: &[f64],
    inputs: &[f64],
) -> Result<(), Error> {
    let Room {
        h,
        before,
        slopes,
        projected,
        gain,
        taken,
    } = room;
    let n = belief.x.len();
    h.clear();
    h.extend_from_slice(sensing.evaluate(t, &belief.x, inputs)?);
    before.clone_from(&belief.x);
    slopes.resize(h.len() * n, 0.0);
    projected.resize(n, 0.0);
    taken.clear();
    // the gate looks at every reading from before the first correction
    for (i, h) in h.iter().enumerate() {
        let c = &mut slopes[i * n..(i + 1) * n];
        sensing.write_slopes(i, c);
        belief.root.transposed_times(c, projected);
        let spread = dot(projected, projected);
        taken.extend(sensing.judge(i, readings[i], *h, spread));
    }
    let inside = taken.iter().filter(|b| b.end.is_none());
    for believed in inside.chain(taken.iter().filter(|b| b.end.is_some())) {
        let c = &slopes[believed.sensor * n..(believed.sensor + 1) * n];
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
            corrections.push(Correction::single(c.to_vec(), rest, spread + noise, gain));
        }
    }
    Ok(())
}
