//! The extended Kalman filter, continuous-discrete.

use super::Belief;
use super::flow::Linearised;
use super::health::Reading;
use super::root::{dot, factor_into};
use super::sensing::Sensing;
use super::smooth::Correction;
use crate::driven::Driven;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Integrator, System};

#[derive(Clone, Debug)]
pub(crate) struct Extended {
    pub driven: Driven,
    integrator: Integrator,
    entries: Vec<(usize, usize)>,
    slopes: Vec<f64>,
    /// Q/q, empty where Q = 0
    noise: Vec<f64>,
    /// q, the largest entry of Q
    scale: f64,
    /// the state of [`Linearised`]
    z: Vec<f64>,
    /// rows whose sum of squares is P⁻
    rows: Vec<f64>,
    sums: Vec<f64>,
    /// qW and its factor
    spread: Vec<f64>,
    lower: Vec<f64>,
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
        let scale = process_noise.iter().fold(0.0_f64, |m, q| m.max(*q));
        let noise = match scale > 0.0 {
            true => process_noise.iter().map(|q| q / scale).collect(),
            false => vec![],
        };
        let dimension = n + n * Linearised::width(n, scale > 0.0);
        Ok(Self {
            driven: Driven::new(flow, run.between),
            integrator: Integrator::new(run.method, dimension)?,
            entries: entries.to_vec(),
            slopes: vec![0.0; flow.outputs().len()],
            noise,
            scale,
            z: vec![],
            rows: vec![],
            sums: vec![0.0; n],
            spread: vec![],
            lower: vec![],
        })
    }

    /// x̂⁻ and P⁻ = ΦPΦᵀ + qW at the next sample, and Φ where there is room for it.
    pub fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        kept: Option<&mut Vec<f64>>,
    ) -> Result<(), Error> {
        let n = belief.x.len();
        let noisy = !self.noise.is_empty();
        let width = Linearised::width(n, noisy);
        Linearised::begin(&belief.x, noisy, &mut self.z);
        let mut flow = Linearised {
            driven: &mut self.driven,
            entries: &self.entries,
            slopes: &mut self.slopes,
            noise: &self.noise,
        };
        self.integrator.advance(&mut flow, from, to, &mut self.z)?;
        belief.x.copy_from_slice(&self.z[..n]);
        let transition = |i: usize| &self.z[n + i * width..n + i * width + n];
        self.rows.clear();
        self.rows.resize(width * n, 0.0);
        // (ΦS)ᵀ, row by row
        for i in 0..n {
            belief.root.transposed_times(transition(i), &mut self.sums);
            let into = self.rows[i..].iter_mut().step_by(n);
            into.zip(&self.sums).for_each(|(into, sum)| *into = *sum);
        }
        if noisy {
            self.spread.clear();
            let rows = (0..n).flat_map(|i| &self.z[n + i * width + n..n + (i + 1) * width]);
            self.spread.extend(rows.map(|w| self.scale * w));
            factor_into(&self.spread, n, &mut self.lower);
            for (k, row) in self.rows[n * n..].chunks_exact_mut(n).enumerate() {
                row.iter_mut()
                    .enumerate()
                    .for_each(|(i, into)| *into = self.lower[i * n + k]);
            }
        }
        if let Some(kept) = kept {
            kept.clear();
            kept.extend((0..n).flat_map(transition));
        }
        belief.root.of_rows_with(&mut self.rows, &mut self.sums);
        Ok(())
    }
}

impl Persist for Extended {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.integrator.walk(walk)
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
    gain: Vec<f64>,
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
    gain.resize(n, 0.0);
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
        for (x, k) in belief.x.iter_mut().zip(&*gain) {
            *x += k * rest;
        }
        if let Some(corrections) = &mut sensing.corrections {
            corrections.push(Correction {
                slopes: c.to_vec(),
                innovation: rest,
                variance,
                gain: gain.clone(),
            });
        }
    }
    Ok(())
}
