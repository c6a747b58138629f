//! Least-squares fits of noisy samples that share no code with what they judge: plain simulations,
//! finite differences, singular values of the whole stack.

use lynkeus_run::{Integrator, Method, Step, System};
use nalgebra::{DMatrix, DVector};

/// Normal deviates: SplitMix64 and Box and Muller's transformation.
pub struct Random(u64);

impl Random {
    pub fn new(seed: u64) -> Self {
        Self(seed)
    }

    fn uniform(&mut self) -> f64 {
        self.0 = self.0.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = self.0;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        ((z ^ (z >> 31)) as f64 + 0.5) / 2.0_f64.powi(64)
    }

    fn normal(&mut self) -> f64 {
        let (u, v) = (self.uniform(), self.uniform());
        (-2.0 * u.ln()).sqrt() * (std::f64::consts::TAU * v).cos()
    }
}

/// A plant whose unknown constants are states of their own, sampled evenly.
pub struct Bench {
    pub system: System,
    pub start: f64,
    pub step: f64,
    /// samples after the first
    pub samples: usize,
    pub substeps: usize,
    /// standard deviation of every sample
    pub noise: f64,
    /// standard deviation of what is known of every state beforehand, if anything is
    pub prior: Option<f64>,
}

/// Samples of some outputs, one after the other, and the state at the end.
struct Course {
    samples: DVector<f64>,
    end: DVector<f64>,
}

impl Bench {
    fn course(&self, from: &DVector<f64>, outputs: &[usize]) -> Course {
        let mut evaluation = self.system.evaluation();
        let method = Method::Rk4(Step::Substeps(self.substeps));
        let mut integrator = Integrator::new(method, from.len()).unwrap();
        let mut x: Vec<f64> = from.iter().copied().collect();
        let mut seen = vec![0.0; self.system.outputs().len()];
        let mut samples = vec![];
        for k in 0..=self.samples {
            let at = |k: usize| self.start + k as f64 * self.step;
            if k > 0 {
                integrator
                    .advance(&mut evaluation, at(k - 1), at(k), &mut x)
                    .unwrap();
            }
            evaluation.outputs(at(k), &x, &mut seen);
            samples.extend(outputs.iter().map(|&o| seen[o]));
        }
        Course {
            samples: DVector::from_vec(samples),
            end: DVector::from_vec(x),
        }
    }

    /// Root mean squares of the errors of (start, end), over `fits` sets of noisy samples; each fit
    /// takes `rounds` steps of the simplified Gauss–Newton method from a guess as far off as the prior
    /// allows.
    pub fn errors(
        &self,
        outputs: &[usize],
        rounds: usize,
        fits: usize,
        random: &mut Random,
    ) -> (Vec<f64>, Vec<f64>) {
        let truth = DVector::from_row_slice(self.system.start());
        let exact = self.course(&truth, outputs);
        let known = self.prior.map_or(0.0, |prior| self.noise / prior);
        let stack = stacked(self.slopes(&truth, outputs), known);
        let inverse = stack.pseudo_inverse(1e-14).unwrap();
        let mut sums = [0, 1].map(|_| DVector::zeros(truth.len()));
        for _ in 0..fits {
            let noise = DVector::from_fn(exact.samples.len(), |_, _| self.noise * random.normal());
            let measured = &exact.samples + noise;
            let spread = self.prior.unwrap_or_default();
            let guess = &truth + DVector::from_fn(truth.len(), |_, _| spread * random.normal());
            let mut z = guess.clone();
            for _ in 0..rounds {
                let residual = &measured - self.course(&z, outputs).samples;
                let aside = (&guess - &z) * known;
                let both = residual.iter().chain(aside.iter()).copied();
                z += &inverse * DVector::from_iterator(residual.len() + z.len(), both);
            }
            sums[0] += (&z - &truth).map(|e| e * e);
            sums[1] += (self.course(&z, outputs).end - &exact.end).map(|e| e * e);
        }
        let rms = |sum: &DVector<f64>| sum.iter().map(|s| (s / fits as f64).sqrt()).collect();
        (rms(&sums[0]), rms(&sums[1]))
    }

    /// Central differences.
    fn slopes(&self, at: &DVector<f64>, outputs: &[usize]) -> DMatrix<f64> {
        let column = |j: usize| {
            let h = 1e-5;
            let shifted = |by: f64| {
                let mut z = at.clone();
                z[j] += by;
                self.course(&z, outputs).samples
            };
            (shifted(h) - shifted(-h)) / (2.0 * h)
        };
        let columns: Vec<DVector<f64>> = (0..at.len()).map(column).collect();
        DMatrix::from_columns(&columns)
    }
}

/// A row more for every state: its distance from the guess, weighted.
fn stacked(slopes: DMatrix<f64>, weight: f64) -> DMatrix<f64> {
    let (rows, columns) = slopes.shape();
    let mut stack = slopes.resize(rows + columns, columns, 0.0);
    stack.rows_mut(rows, columns).fill_diagonal(weight);
    stack
}
