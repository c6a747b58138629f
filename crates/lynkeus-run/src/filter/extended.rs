//! The extended Kalman filter, continuous-discrete.

use super::Belief;
use super::flow::Joint;
use super::health::Reading;
use super::root::{dot, factor};
use super::sensing::Sensing;
use super::smooth::Correction;
use super::spanned::{Rows, Spanned};
use super::taylor::Moments;
use super::variation::Variation;
use crate::driven::Driven;
use crate::{Error, EstimatorSettings, System};

/// Up to so many states x̂, Φ and W are integrated together.
const FEW: usize = 8;

#[derive(Clone, Debug)]
pub(crate) struct Extended {
    pub driven: Driven,
    way: Way,
    /// rows whose sum of squares is P⁻
    rows: Vec<f64>,
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
        let way = match n <= FEW {
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
            rows: vec![],
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
        let mut x = belief.x.clone();
        let driven = &mut self.driven;
        let Moments { transition, noise } = match &mut self.way {
            Way::Joint(joint) => joint.advance(driven, from, to, &mut x)?,
            Way::Variation(variation) => variation.advance(driven, belief, from, to, &mut x)?,
        };
        belief.x = x;
        let n = belief.x.len();
        self.rows.clear();
        if let Some(noise) = noise {
            self.push_root(&noise, n);
        }
        self.push_carried(&transition, belief, n);
        belief.root.of_rows(&mut self.rows);
        Ok(match keep {
            true => Rows::of(&transition),
            false => Rows::default(),
        })
    }

    /// The rows of Lᵀ, W = LLᵀ. They come first: their zeros are spared in the reflections.
    fn push_root(&mut self, noise: &Spanned, n: usize) {
        let lower = factor(noise.entries(), n);
        self.rows.resize(n * n, 0.0);
        for (i, row) in lower.chunks_exact(n).enumerate() {
            for (k, entry) in row[..=i].iter().enumerate() {
                self.rows[k * n + i] = *entry;
            }
        }
    }

    /// The rows of (ΦS)ᵀ.
    fn push_carried(&mut self, transition: &Spanned, belief: &Belief, n: usize) {
        let first = self.rows.len();
        self.rows.resize(first + n * n, 0.0);
        let into = &mut self.rows[first..];
        let mut sums = vec![0.0; n];
        for i in 0..n {
            sums.fill(0.0);
            for (j, phi) in transition.span(i).zip(transition.row(i)) {
                for (sum, s) in sums.iter_mut().zip(&belief.root.row(j)[..=j]) {
                    *sum += phi * s;
                }
            }
            let column = into[i..].iter_mut().step_by(n);
            column.zip(&sums).for_each(|(into, sum)| *into = *sum);
        }
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
        let correction = Correction::single(c.clone(), rest, variance, gain);
        sensing.corrections.push(correction);
    }
    Ok(())
}
