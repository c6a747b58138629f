//! The extended Kalman filter, continuous-discrete.

use super::Belief;
use super::flow::Linearised;
use super::health::Reading;
use super::root::{dot, factor};
use super::sensing::Sensing;
use super::smooth::Correction;
use crate::driven::Driven;
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
        })
    }

    /// x̂⁻ and P⁻ = ΦPΦᵀ + qW at the next sample. Φ is returned where it is to be kept.
    pub fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Vec<f64>, Error> {
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
            let into = &mut self.rows[i..];
            let mut sums = vec![0.0; n];
            belief.root.transposed_times(transition(i), &mut sums);
            into.iter_mut()
                .step_by(n)
                .zip(sums)
                .for_each(|(into, sum)| *into = sum);
        }
        if noisy {
            let spread: Vec<f64> = (0..n)
                .flat_map(|i| &self.z[n + i * width + n..n + (i + 1) * width])
                .map(|w| self.scale * w)
                .collect();
            let lower = factor(&spread, n);
            for (k, row) in self.rows[n * n..].chunks_exact_mut(n).enumerate() {
                row.iter_mut()
                    .enumerate()
                    .for_each(|(i, into)| *into = lower[i * n + k]);
            }
        }
        let kept = match keep {
            true => (0..n).flat_map(transition).copied().collect(),
            false => vec![],
        };
        belief.root.of_rows(&mut self.rows);
        Ok(kept)
    }
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
    let h = sensing.evaluate(t, &belief.x, inputs)?.to_vec();
    let before = belief.x.clone();
    let n = before.len();
    let mut projected = vec![0.0; n];
    let slopes: Vec<Vec<f64>> = (0..h.len()).map(|i| sensing.slopes(i)).collect();
    // the gate looks at every reading from before the first correction
    let mut taken = vec![];
    for (i, c) in slopes.iter().enumerate() {
        belief.root.transposed_times(c, &mut projected);
        let r = sensing.noise(i, h[i]);
        let variance = dot(&projected, &projected) + r;
        let innovation = sensing.judge(i, readings[i], h[i], variance);
        if innovation.reading == Reading::Taken {
            taken.push((i, r, innovation.value));
        }
    }
    for (i, r, innovation) in taken {
        let c = &slopes[i];
        let moved: f64 = c
            .iter()
            .zip(&belief.x)
            .zip(&before)
            .map(|((c, x), x0)| c * (x - x0))
            .sum();
        let rest = innovation - moved;
        belief.root.transposed_times(c, &mut projected);
        let variance = dot(&projected, &projected) + r;
        let Some(gain) = belief.root.update(&projected, r) else {
            continue;
        };
        for (x, k) in belief.x.iter_mut().zip(&gain) {
            *x += k * rest;
        }
        sensing.corrections.push(Correction {
            slopes: c.clone(),
            innovation: rest,
            variance,
            gain,
        });
    }
    Ok(())
}
