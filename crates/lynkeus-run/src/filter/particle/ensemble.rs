//! The correction of the ensemble Kalman filter: all particles move together, and none is weighed.
//!
//! With the sample covariances of what a sensor shows, v, and of a state with that, c, a reading of noise R that is ν off
//! moves the mean by cν/(v + R), and each deviation by −αc/(v + R) times that of what the sensor shows,
//! α = 1/(1 + √(R/(v + R))), so that the sample covariance is Kalman's, without random numbers; readings count one after
//! the other (J. S. Whitaker and T. M. Hamill, *Monthly Weather Review* 130 (2002) 1913–1924). Deviations are then
//! inflated, and mixed by reflections at random, which keep mean and covariance: without that, single particles run
//! away from the others (P. Sakov and P. R. Oke, *Monthly Weather Review* 136 (2008) 1042–1053).

use rand_chacha::ChaCha8Rng;
use rand_distr::{Distribution, StandardNormal};

use super::Believed;

/// Most reflections after an update.
const REFLECTIONS: usize = 16;

/// Particles, and what the sensors show of each.
pub(super) struct Ensemble<'e> {
    /// particle by particle, so many states of each
    pub x: &'e mut [f64],
    pub n: usize,
    pub shown: &'e mut [f64],
    pub m: usize,
}

impl Ensemble<'_> {
    /// Takes readings; `expected` is what the sensors showed on average before. The logarithm of their likelihood.
    pub fn take(&mut self, taken: &[Believed], expected: &[f64]) -> f64 {
        let mut log_likelihood = 0.0;
        for believed in taken {
            let i = believed.sensor;
            let (mean, own) = deviations(self.shown, self.m, i);
            let v = product(&own, &own);
            let moved = mean - expected[i];
            log_likelihood += match believed.end {
                Some(_) => believed.log_likelihood(moved, v),
                None => {
                    let (off, s) = (believed.innovation - moved, v + believed.variance);
                    -0.5 * ((std::f64::consts::TAU * s).ln() + off * off / s)
                }
            };
            let Some((off, noise)) = believed.weighed(moved, v) else {
                continue;
            };
            let s = v + noise;
            // neither says anything of the other
            if s <= 0.0 {
                continue;
            }
            let share = 1.0 / (1.0 + (noise / s).sqrt());
            for (values, width) in [(&mut *self.x, self.n), (&mut *self.shown, self.m)] {
                for column in 0..width {
                    let (_, with) = deviations(values, width, column);
                    let gain = product(&with, &own) / s;
                    let all = values.iter_mut().skip(column).step_by(width);
                    for (value, own) in all.zip(&own) {
                        *value += gain * (off - share * own);
                    }
                }
            }
        }
        log_likelihood
    }

    /// Deviations larger by a factor, and mixed.
    pub fn spread(&mut self, inflation: f64, random: &mut ChaCha8Rng) {
        let count = self.x.len() / self.n.max(1);
        let mirrors: Vec<Vec<f64>> = (0..REFLECTIONS.min(count.saturating_sub(1)))
            .map(|_| mirror(count, random))
            .collect();
        for column in 0..self.n {
            let (mean, mut own) = deviations(self.x, self.n, column);
            for mirror in &mirrors {
                let along: f64 = mirror.iter().zip(&own).map(|(v, d)| v * d).sum();
                for (d, v) in own.iter_mut().zip(mirror) {
                    *d -= 2.0 * along * v;
                }
            }
            let all = self.x.iter_mut().skip(column).step_by(self.n);
            for (x, d) in all.zip(own) {
                *x = mean + inflation * d;
            }
        }
    }
}

/// The mean of a column, and what is off it.
fn deviations(values: &[f64], width: usize, column: usize) -> (f64, Vec<f64>) {
    let column: Vec<f64> = values.iter().skip(column).step_by(width).copied().collect();
    let mean = column.iter().sum::<f64>() / column.len() as f64;
    (mean, column.iter().map(|x| x - mean).collect())
}

/// A sample covariance.
fn product(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum::<f64>() / (a.len() as f64 - 1.0)
}

/// A direction among so many particles in which their mean does not move, of length 1.
fn mirror(count: usize, random: &mut ChaCha8Rng) -> Vec<f64> {
    let drawn: Vec<f64> = (0..count).map(|_| StandardNormal.sample(random)).collect();
    let (_, own) = deviations(&drawn, 1, 0);
    let length = own.iter().map(|x| x * x).sum::<f64>().sqrt();
    own.iter().map(|x| x / length).collect()
}

#[cfg(test)]
mod tests {
    use nalgebra::{DMatrix, DVector};

    use super::super::stream;
    use super::*;

    fn moments(x: &[f64], n: usize) -> (DVector<f64>, DMatrix<f64>) {
        let columns: Vec<(f64, Vec<f64>)> = (0..n).map(|i| deviations(x, n, i)).collect();
        let mean = DVector::from_fn(n, |i, _| columns[i].0);
        let covariance = DMatrix::from_fn(n, n, |i, j| product(&columns[i].1, &columns[j].1));
        (mean, covariance)
    }

    /// With linear sensors mean and covariance are Kalman's of the sample's before, to rounding, however few particles.
    #[test]
    fn an_ensemble_is_corrected_as_kalman_says() {
        let (n, m, count) = (3, 2, 8);
        let mut random = stream(5, 0, 0);
        let mut x: Vec<f64> = (0..n * count)
            .map(|_| StandardNormal.sample(&mut random))
            .collect();
        let c = DMatrix::from_row_slice(m, n, &[1.0, 0.5, 0.0, -0.3, 0.0, 2.0]);
        let mut shown: Vec<f64> = x
            .chunks_exact(n)
            .flat_map(|x| {
                (&c * DVector::from_row_slice(x))
                    .iter()
                    .copied()
                    .collect::<Vec<_>>()
            })
            .collect();
        let (mean, p) = moments(&x, n);
        let expected = &c * &mean;
        let (readings, noises) = ([0.7, -1.1], [0.2, 0.05]);
        let off = DVector::from_row_slice(&readings) - &expected;
        let s = &c * &p * c.transpose() + DMatrix::from_diagonal(&DVector::from_row_slice(&noises));
        let gain = &p * c.transpose() * s.clone().try_inverse().unwrap();
        let taken: Vec<Believed> = (0..m)
            .map(|i| Believed {
                sensor: i,
                reading: readings[i],
                variance: noises[i],
                innovation: off[i],
                end: None,
            })
            .collect();
        let mut ensemble = Ensemble {
            x: &mut x,
            n,
            shown: &mut shown,
            m,
        };
        let told = ensemble.take(&taken, expected.as_slice());
        let density = (std::f64::consts::TAU * &s).determinant().ln()
            + off.dot(&(s.try_inverse().unwrap() * &off));
        assert!((told + 0.5 * density).abs() < 1e-12, "{told} {density}");
        let (own_mean, own) = moments(&x, n);
        assert!((own_mean - (&mean + &gain * off)).amax() < 1e-13);
        assert!((own - (&p - &gain * &c * &p)).amax() < 1e-13);
        // what is mixed keeps both
        let (mean, p) = moments(&x, n);
        let before = x.clone();
        let mut ensemble = Ensemble {
            x: &mut x,
            n,
            shown: &mut [],
            m: 0,
        };
        ensemble.spread(1.0, &mut random);
        let (mixed_mean, mixed) = moments(&x, n);
        assert!((mixed_mean - &mean).amax() < 1e-14 && (mixed - &p).amax() < 1e-14);
        assert!(before.iter().zip(&x).any(|(a, b)| (a - b).abs() > 0.1));
    }
}
