//! The unscented Kalman filter.

use super::Belief;
use super::factor::factor;
use super::health::Reading;
use super::model::FilterModel;
use super::root::{Root, dot};
use super::sensing::Sensing;
use super::smooth::Correction;
use super::spanned::{Rows, Spanned};
use crate::driven::Driven;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Error, EstimatorSettings, Integrator};

/// How sigma points are spread and weighed, after Julier, Uhlmann and van der Merwe; the
/// default makes the cubature filter of Arasaratnam and Haykin.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct SigmaPoints {
    /// α > 0
    pub alpha: f64,
    /// β
    pub beta: f64,
    /// κ, with n + κ > 0
    pub kappa: f64,
}

impl Default for SigmaPoints {
    fn default() -> Self {
        Self {
            alpha: 1.0,
            beta: 0.0,
            kappa: 0.0,
        }
    }
}

/// Weights of 2n + 1 points x̂, x̂ ± columns of √(n+λ) L.
#[derive(Clone, Copy, Debug)]
pub struct Weights {
    /// √(n+λ): how far the points lie from x̂, in columns of L
    pub spread: f64,
    /// of x̂ in means
    pub mean_of_centre: f64,
    /// of x̂ in covariances
    pub centre: f64,
    /// of each other point
    pub other: f64,
}

impl SigmaPoints {
    /// The weights for n states.
    ///
    /// # Errors
    /// [`Error::Setting`] where α²(n + κ) is not above 0.
    pub fn weights(&self, n: usize) -> Result<Weights, Error> {
        let n = n as f64;
        let both = self.alpha.powi(2) * (n + self.kappa);
        if !(both > 0.0 && both.is_finite() && self.beta.is_finite()) {
            let found = format!(
                "alpha = {}, beta = {}, kappa = {}",
                self.alpha, self.beta, self.kappa
            );
            let expected =
                format!("alpha² (n + kappa) above 0 for n = {n} states, and finite numbers");
            return Err(Error::setting("sigma points", expected, found));
        }
        let mean_of_centre = (both - n) / both;
        Ok(Weights {
            spread: both.sqrt(),
            mean_of_centre,
            centre: mean_of_centre + 1.0 - self.alpha.powi(2) + self.beta,
            other: 0.5 / both,
        })
    }
}

#[derive(Clone, Debug)]
pub(super) struct Unscented {
    pub driven: Driven,
    integrator: Integrator,
    weights: Weights,
    process_noise: Vec<f64>,
}

/// Points beside their weighted mean.
struct Cloud {
    mean: Vec<f64>,
    /// deviations from the mean, point by point
    deviations: Vec<Vec<f64>>,
}

impl Unscented {
    pub fn new(
        model: &FilterModel,
        points: SigmaPoints,
        run: EstimatorSettings,
    ) -> Result<Self, Error> {
        let n = model.dimension();
        Ok(Self {
            driven: Driven::new(&model.flow, run.between),
            integrator: Integrator::new(run.method, n)?,
            weights: points.weights(n)?,
            process_noise: model.process_noise.clone(),
        })
    }

    /// x̂ and x̂ ± columns of √(n+λ) L, L the lower factor of P.
    fn points(&self, belief: &Belief) -> Vec<Vec<f64>> {
        let n = belief.x.len();
        let mut points = vec![belief.x.clone()];
        for sign in [1.0, -1.0] {
            points.extend((0..n).map(|k| {
                let column = (0..n).map(|i| belief.root.row(i)[k]);
                let moved = belief.x.iter().zip(column);
                moved
                    .map(|(x, l)| x + sign * self.weights.spread * l)
                    .collect()
            }));
        }
        points
    }

    fn cloud(&self, mut points: Vec<Vec<f64>>) -> Cloud {
        let size = points[0].len();
        let weight = |k: usize| {
            if k == 0 {
                self.weights.mean_of_centre
            } else {
                self.weights.other
            }
        };
        let mean: Vec<f64> = (0..size)
            .map(|i| {
                points
                    .iter()
                    .enumerate()
                    .map(|(k, p)| weight(k) * p[i])
                    .sum()
            })
            .collect();
        for point in &mut points {
            point.iter_mut().zip(&mean).for_each(|(x, m)| *x -= m);
        }
        Cloud {
            mean,
            deviations: points,
        }
    }

    fn weight(&self, k: usize) -> f64 {
        if k == 0 {
            self.weights.centre
        } else {
            self.weights.other
        }
    }

    /// Σ W (a − ā)(b − b̄)ᵀ of components i and j.
    fn moment(&self, a: &Cloud, i: usize, b: &Cloud, j: usize) -> f64 {
        let pairs = a.deviations.iter().zip(&b.deviations).enumerate();
        pairs.map(|(k, (a, b))| self.weight(k) * a[i] * b[j]).sum()
    }

    /// Each point through the flow; P⁻ = Σ W(…)(…)ᵀ + QΔt. Where it is to be kept, the transition
    /// of the linear flow that carries the points best is returned: Φ = DᵀP⁻¹ with the covariance D
    /// of the points before and after (S. Särkkä, "Unscented Rauch–Tung–Striebel smoother", *IEEE
    /// Transactions on Automatic Control* 53 (2008) 845–849).
    pub fn predict(
        &mut self,
        belief: &mut Belief,
        from: f64,
        to: f64,
        keep: bool,
    ) -> Result<Rows, Error> {
        let mut points = self.points(belief);
        for point in &mut points {
            self.integrator.advance(&mut self.driven, from, to, point)?;
        }
        let transition = match keep {
            true => self.carried(&belief.root, &points),
            false => Rows::default(),
        };
        let cloud = self.cloud(points);
        let noise: Vec<f64> = self.process_noise.iter().map(|q| q * (to - from)).collect();
        let deviations = &cloud.deviations;
        let extra = (0..noise.len()).map(|i| {
            let mut row = vec![0.0; noise.len()];
            row[i] = noise[i].sqrt();
            row
        });
        belief.root = self.spread(deviations, extra.collect());
        belief.x = cloud.mean;
        Ok(transition)
    }

    /// Row i of the linear map that takes the points drawn from `root` to their images best.
    fn row(&self, root: &Root, images: &[Vec<f64>], i: usize) -> Vec<f64> {
        let n = root.n;
        let apart = (0..n).map(|k| images[1 + k][i] - images[1 + n + k][i]);
        let halves: Vec<f64> = apart.map(|d| 0.5 * d / self.weights.spread).collect();
        root.against(&halves)
    }

    fn carried(&self, root: &Root, images: &[Vec<f64>]) -> Rows {
        let rows = (0..root.n).flat_map(|i| self.row(root, images, i));
        Rows::of(&Spanned::dense(root.n, rows.collect()))
    }

    /// The lower root of Σ W d dᵀ + Σ e eᵀ. Where the first weight is negative the sum is formed,
    /// and what it lacks of being definite taken as nothing.
    fn spread(&self, deviations: &[Vec<f64>], extra: Vec<Vec<f64>>) -> Root {
        let n = deviations[0].len();
        let mut root = Root::diagonal(&vec![0.0; n]);
        let weighed = deviations
            .iter()
            .enumerate()
            .map(|(k, d)| (self.weight(k), d));
        if self.weights.centre >= 0.0 {
            let scaled = weighed.flat_map(|(w, d)| d.iter().map(move |x| w.sqrt() * x));
            let mut rows: Vec<f64> = scaled.chain(extra.into_iter().flatten()).collect();
            root.of_rows(&mut rows);
            return root;
        }
        let all = weighed.chain(extra.iter().map(|e| (1.0, e)));
        let mut sum = vec![0.0; n * n];
        for (w, d) in all {
            for (k, entry) in sum.iter_mut().enumerate() {
                *entry += w * d[k / n] * d[k % n];
            }
        }
        root.entries = factor(&sum, n);
        root
    }

    /// The points drawn again from x̂⁻, P⁻; K = P_xz P_zz⁻¹ over the readings that are believed.
    pub fn correct(
        &self,
        sensing: &mut Sensing,
        belief: &mut Belief,
        t: f64,
        readings: &[f64],
        inputs: &[f64],
    ) -> Result<(), Error> {
        let states = self.cloud(self.points(belief));
        let points = self.points(belief);
        let shown = points
            .iter()
            .map(|x| Ok(sensing.predict(t, x, inputs)?.to_vec()));
        let outputs = self.cloud(shown.collect::<Result<_, Error>>()?);
        let mut taken = vec![];
        for (i, reading) in readings.iter().enumerate() {
            let r = sensing.noise(i, outputs.mean[i]);
            let variance = self.moment(&outputs, i, &outputs, i) + r;
            let innovation = sensing.judge(i, *reading, outputs.mean[i], variance);
            if innovation.reading == Reading::Taken && variance > 0.0 {
                taken.push((i, r, innovation.value));
            }
        }
        let m = taken.len();
        if m == 0 {
            return Ok(());
        }
        let mut variance = vec![0.0; m * m];
        for (a, (i, r, _)) in taken.iter().enumerate() {
            for (b, (j, ..)) in taken.iter().enumerate() {
                variance[a * m + b] = self.moment(&outputs, *i, &outputs, *j);
            }
            variance[a * m + a] += r;
        }
        let lower = factor(&variance, m);
        let gain: Vec<Vec<f64>> = (0..belief.x.len())
            .map(|s| {
                let cross: Vec<f64> = taken
                    .iter()
                    .map(|(i, ..)| self.moment(&states, s, &outputs, *i))
                    .collect();
                solve(&lower, m, cross)
            })
            .collect();
        let slopes = |&(i, ..): &(usize, f64, f64)| self.row(&belief.root, &outputs.deviations, i);
        let column = |a: usize| gain.iter().map(|k| k[a]).collect();
        let unit = |a: usize| (0..m).map(|b| f64::from(u8::from(a == b))).collect();
        let innovations = || taken.iter().map(|t| t.2).collect();
        if let Some(corrections) = &mut sensing.corrections {
            corrections.push(Correction {
                slopes: taken.iter().map(slopes).collect(),
                gains: (0..m).map(column).collect(),
                information: (0..m).flat_map(|a| solve(&lower, m, unit(a))).collect(),
                weighed: solve(&lower, m, innovations()),
            });
        }
        for (x, k) in belief.x.iter_mut().zip(&gain) {
            *x += taken.iter().zip(k).map(|((.., nu), k)| k * nu).sum::<f64>();
        }
        // P⁺ = Σ W (dx − K dz)(…)ᵀ + K R Kᵀ, which is P⁻ − K P_zz Kᵀ
        let left: Vec<Vec<f64>> = states
            .deviations
            .iter()
            .zip(&outputs.deviations)
            .map(|(dx, dz)| {
                let dz: Vec<f64> = taken.iter().map(|(i, ..)| dz[*i]).collect();
                dx.iter()
                    .zip(&gain)
                    .map(|(dx, k)| dx - dot(k, &dz))
                    .collect()
            })
            .collect();
        let noise = taken
            .iter()
            .enumerate()
            .map(|(a, (_, r, _))| gain.iter().map(|k| k[a] * r.sqrt()).collect());
        belief.root = self.spread(&left, noise.collect());
        Ok(())
    }
}

impl Persist for Unscented {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.driven.walk(walk)?;
        self.integrator.walk(walk)
    }
}

/// x with L Lᵀ x = b; components that L does not reach are 0.
fn solve(lower: &[f64], m: usize, mut b: Vec<f64>) -> Vec<f64> {
    for i in 0..m {
        let known = dot(&lower[i * m..i * m + i], &b[..i]);
        let pivot = lower[i * m + i];
        b[i] = if pivot > 0.0 {
            (b[i] - known) / pivot
        } else {
            0.0
        };
    }
    for i in (0..m).rev() {
        let known: f64 = (i + 1..m).map(|j| lower[j * m + i] * b[j]).sum();
        let pivot = lower[i * m + i];
        b[i] = if pivot > 0.0 {
            (b[i] - known) / pivot
        } else {
            0.0
        };
    }
    b
}
