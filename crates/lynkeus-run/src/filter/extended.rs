//! The extended Kalman filter, continuous-discrete.

use super::Belief;
use super::factor::Factor;
use super::flow::Joint;
use super::health::Reading;
use super::root::{Gain, dot};
use super::sensing::Sensing;
use super::smooth::Correction;
use super::spanned::Rows;
use super::taylor::Moments;
use super::variation::Variation;
use crate::driven::Driven;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Method, Step, System};

/// Up to so many states x̂, Φ and W are integrated together, and wherever steps are given: these are
/// then the steps of all three.
const FEW: usize = 8;

#[derive(Clone, Debug)]
pub(crate) struct Extended {
    pub driven: Driven,
    way: Way,
    /// x̂⁻, Φ and W
    x: Vec<f64>,
    moments: Moments,
    /// rows whose sum of squares is P⁻
    rows: Vec<f64>,
    sums: Vec<f64>,
    /// of W
    factor: Factor,
}

/// How Φ and W are found.
#[derive(Clone, Debug)]
enum Way {
    Joint(Box<Joint>),
    Variation(Box<Variation>),
}

impl Extended {
    /// Of a flow whose first outputs are the entries of its Jacobian, and the densities of the
    /// noise on its states.
    pub fn new(
        flow: &System,
        entries: &[(usize, usize)],
        process_noise: &[f64],
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let n = flow.states().len();
        let is_given = matches!(run.method, Method::Rk4(Step::AtMost(_) | Step::Substeps(_)));
        let way = match n <= FEW || is_given {
            true => Way::Joint(Box::new(Joint::new(
                n,
                flow.outputs().len(),
                entries,
                process_noise,
                run.method,
            )?)),
            false => Way::Variation(Box::new(Variation::new(
                n,
                flow.outputs().len(),
                entries,
                process_noise,
                run.method,
            )?)),
        };
        Ok(Self {
            driven: Driven::new(flow, run.between),
            way,
            x: vec![0.0; n],
            moments: Moments::start(n, process_noise.iter().any(|q| *q > 0.0)),
            rows: vec![],
            sums: vec![0.0; n],
            factor: Factor::default(),
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
        let (driven, x, moments) = (&mut self.driven, &mut self.x, &mut self.moments);
        match &mut self.way {
            Way::Joint(joint) => joint.advance(driven, from, to, x, moments)?,
            Way::Variation(variation) => {
                *moments = variation.advance(driven, belief, from, to, x)?;
            }
        };
        belief.x.clone_from(&self.x);
        self.rows.clear();
        self.push_root();
        self.push_carried(belief);
        belief.root.of_rows_with(&mut self.rows, &mut self.sums);
        Ok(match keep {
            true => Rows::of(&self.moments.transition),
            false => Rows::default(),
        })
    }

    /// The rows of Lᵀ, W = LLᵀ. They come first: their zeros are spared in the reflections.
    fn push_root(&mut self) {
        let Some(noise) = &self.moments.noise else {
            return;
        };
        let n = self.x.len();
        let lower = self.factor.of(noise.entries(), n);
        self.rows.resize(n * n, 0.0);
        for (i, row) in lower.chunks_exact(n).enumerate() {
            for (k, entry) in row[..=i].iter().enumerate() {
                self.rows[k * n + i] = *entry;
            }
        }
    }

    /// The rows of (ΦS)ᵀ.
    fn push_carried(&mut self, belief: &Belief) {
        let (n, transition) = (self.x.len(), &self.moments.transition);
        let first = self.rows.len();
        self.rows.resize(first + n * n, 0.0);
        let into = &mut self.rows[first..];
        let sums = &mut self.sums;
        for i in 0..n {
            sums.fill(0.0);
            for (j, phi) in transition.span(i).zip(transition.row(i)) {
                for (sum, s) in sums.iter_mut().zip(&belief.root.row(j)[..=j]) {
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
        match &mut self.way {
            Way::Joint(joint) => joint.walk(walk),
            Way::Variation(variation) => variation.walk(walk),
        }
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

/// A reading that corrects.
#[derive(Clone, Copy, Debug)]
struct Believed {
    sensor: usize,
    variance: f64,
    innovation: f64,
}

/// The readings one after the other, which for sensors with independent noises is all of them
/// at once: slopes and predictions are those at x̂⁻.
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
        let r = sensing.noise(i, *h);
        let variance = dot(projected, projected) + r;
        let innovation = sensing.judge(i, readings[i], *h, variance);
        if innovation.reading == Reading::Taken {
            taken.push(Believed {
                sensor: i,
                variance: r,
                innovation: innovation.value,
            });
        }
    }
    for believed in &*taken {
        let c = &slopes[believed.sensor * n..(believed.sensor + 1) * n];
        let moves = belief.x.iter().zip(&*before).map(|(x, x0)| x - x0);
        let moved: f64 = c.iter().zip(moves).map(|(c, moved)| c * moved).sum();
        let rest = believed.innovation - moved;
        belief.root.transposed_times(c, projected);
        let variance = dot(projected, projected) + believed.variance;
        let root = &mut belief.root;
        if !root.update_into(projected, believed.variance, gain) {
            continue;
        }
        for (x, k) in belief.x.iter_mut().zip(&gain.values) {
            *x += k * rest;
        }
        if let Some(corrections) = &mut sensing.corrections {
            let gain = gain.values.clone();
            corrections.push(Correction::single(c.to_vec(), rest, variance, gain));
        }
    }
    Ok(())
}
