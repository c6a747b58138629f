//! Means, deviations and covariances of weighted particles, on lines, circles and among the rotations.

use crate::manifold::{Manifold, wrapped};

/// Most steps to a mean of rotations, and the last of them.
const MEANS: usize = 30;
const LAST: f64 = 1e-13;

/// What is made of a cloud.
#[derive(Clone, Debug, Default)]
pub(super) struct Moments {
    /// what each sensor is expected to show
    pub expected: Vec<f64>,
    /// of the states
    pub deviations: Vec<f64>,
    /// of the states
    pub mean: Vec<f64>,
    /// weights that sum to 1
    weights: Vec<f64>,
    /// the place about which angles and rotations are laid out
    about: Vec<f64>,
    manifold: Manifold,
}

impl Moments {
    /// What `m` sensors are expected to show; angles among what they show of each particle are those next to it. Particles
    /// that show nothing do not count.
    pub fn show(&mut self, weights: &[f64], shown: &mut [f64], m: usize, manifold: &Manifold) {
        self.weights.clear();
        self.weights.extend_from_slice(weights);
        self.expected.clear();
        for i in 0..m {
            if manifold.dials.contains(&i) {
                lift(&self.weights, shown, m, i);
            }
            let (mut sum, mut whole) = (0.0, 0.0);
            for (w, shown) in self.weights.iter().zip(shown.chunks_exact(m)) {
                if *w > 0.0 && shown[i].is_finite() {
                    (sum, whole) = (sum + w * shown[i], whole + w);
                }
            }
            self.expected.push(sum / whole);
        }
    }

    /// The covariance of what two sensors show.
    pub fn spread(&self, shown: &[f64], i: usize, j: usize) -> f64 {
        let m = self.expected.len();
        let [a, b] = [i, j].map(|i| self.expected[i]);
        let (mut sum, mut whole) = (0.0, 0.0);
        for (w, shown) in self.weights.iter().zip(shown.chunks_exact(m)) {
            let product = (shown[i] - a) * (shown[j] - b);
            if *w > 0.0 && product.is_finite() {
                (sum, whole) = (sum + w * product, whole + w);
            }
        }
        sum / whole
    }

    /// Mean and deviations of the states.
    pub fn condense(&mut self, x: &[f64], weights: &[f64], manifold: &Manifold, n: usize) {
        self.weights.clear();
        self.weights.extend_from_slice(weights);
        if self.manifold != *manifold {
            self.manifold.clone_from(manifold);
        }
        let by_weight = |a: &usize, b: &usize| self.weights[*a].total_cmp(&self.weights[*b]);
        let heaviest = (0..self.weights.len())
            .max_by(by_weight)
            .unwrap_or_default();
        self.about.clear();
        self.about.extend_from_slice(&x[heaviest * n..][..n]);
        for &circle in &manifold.circles {
            let middle = middle(&self.weights, x.iter().skip(circle).step_by(n));
            self.about[circle] += wrapped(middle - self.about[circle]);
        }
        for _ in 0..MEANS {
            let mut mean = vec![0.0; n];
            self.each(x, |w, x| {
                mean.iter_mut().zip(x).for_each(|(sum, x)| *sum += w * x)
            });
            manifold.retract(&self.about, &mut mean);
            let mut moved = 0.0_f64;
            for i in manifold.rotations.iter().flat_map(|r| *r..r + 4) {
                moved = moved.max((mean[i] - self.about[i]).abs());
                self.about[i] = mean[i];
            }
            self.mean = mean;
            if moved < LAST {
                break;
            }
        }
        let mut squares = vec![0.0; n];
        self.each(x, |w, x| {
            for ((square, x), mean) in squares.iter_mut().zip(x).zip(&self.mean) {
                *square += w * (x - mean).powi(2);
            }
        });
        self.deviations.clear();
        self.deviations.extend(squares.iter().map(|s| s.sqrt()));
    }

    /// The covariance of the first `n` of the states that were condensed last, row by row.
    pub fn write_covariance(&self, x: &[f64], n: usize, covariance: &mut [f64]) {
        covariance.fill(0.0);
        self.each(x, |w, x| {
            for (place, entry) in covariance.iter_mut().enumerate() {
                let [a, b] = [place / n, place % n].map(|i| x[i] - self.mean[i]);
                *entry += w * a * b;
            }
        });
    }

    /// Takes each particle that counts with its weight, its angles and rotations laid out about where the others are.
    fn each(&self, x: &[f64], mut take: impl FnMut(f64, &[f64])) {
        let (about, manifold) = (&self.about, &self.manifold);
        let particles = self.weights.iter().zip(x.chunks_exact(about.len()));
        let particles = particles.filter(|(w, _)| **w > 0.0);
        if manifold.is_flat() {
            particles.for_each(|(w, x)| take(*w, x));
            return;
        }
        let mut place = vec![];
        for (w, x) in particles {
            place.clear();
            place.extend_from_slice(x);
            manifold.flatten(about, &mut place);
            for &circle in &manifold.circles {
                place[circle] = about[circle] + wrapped(place[circle] - about[circle]);
            }
            take(*w, &place);
        }
    }
}

/// Angles of sensor i as those nearest to the middle of all.
fn lift(weights: &[f64], shown: &mut [f64], m: usize, i: usize) {
    let middle = middle(weights, shown.iter().skip(i).step_by(m));
    for shown in shown.iter_mut().skip(i).step_by(m) {
        *shown = middle + wrapped(*shown - middle);
    }
}

/// The direction of the sum of weighted angles, in (−π, π].
fn middle<'a>(weights: &[f64], angles: impl Iterator<Item = &'a f64>) -> f64 {
    let (mut sine, mut cosine) = (0.0, 0.0);
    for (w, angle) in weights.iter().zip(angles) {
        let (s, c) = angle.sin_cos();
        if *w > 0.0 && s.is_finite() {
            (sine, cosine) = (sine + w * s, cosine + w * c);
        }
    }
    sine.atan2(cosine)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::manifold::{angle_between, turned};

    const EVEN: [f64; 2] = [0.5, 0.5];

    /// Two angles across the end of a turn, one of them a turn further on.
    #[test]
    fn angles_have_the_mean_between_them() {
        let circle = Manifold {
            circles: vec![0],
            dials: vec![0],
            ..Manifold::default()
        };
        let mut moments = Moments::default();
        let x = [3.1, 1.0, -3.1 - std::f64::consts::TAU, 3.0];
        moments.condense(&x, &EVEN, &circle, 2);
        let off = wrapped(moments.mean[0] - std::f64::consts::PI);
        assert!(
            off.abs() < 1e-12 && moments.mean[1] == 2.0,
            "{:?}",
            moments.mean
        );
        let deviation = std::f64::consts::PI - 3.1;
        assert!((moments.deviations[0] - deviation).abs() < 1e-12);
        let mut covariance = [0.0; 4];
        moments.write_covariance(&x, moments.mean.len(), &mut covariance);
        assert!((covariance[1] - deviation).abs() < 1e-12, "{covariance:?}");
        let mut shown = [3.1, -3.1];
        moments.show(&EVEN, &mut shown, 1, &circle);
        assert!((wrapped(moments.expected[0] - std::f64::consts::PI)).abs() < 1e-12);
        assert!((moments.spread(&shown, 0, 0) - deviation.powi(2)).abs() < 1e-12);
    }

    /// Quaternions of both signs about the body's x: their mean is half-way, and the vector's deviation is twice that
    /// of the numbers.
    #[test]
    fn rotations_have_the_mean_between_them() {
        let attitude = Manifold {
            rotations: vec![0],
            ..Manifold::default()
        };
        let first = turned([0.6, 0.0, 0.8, 0.0], [0.4, 0.0, 0.0]);
        let other = turned([0.6, 0.0, 0.8, 0.0], [-0.4, 0.0, 0.0]).map(|x| -x);
        let mut moments = Moments::default();
        moments.condense(&[first, other].concat(), &EVEN, &attitude, 4);
        let mean: [f64; 4] = moments.mean.clone().try_into().unwrap();
        assert!(angle_between(mean, [0.6, 0.0, 0.8, 0.0]) < 1e-12);
        let size = moments.deviations.iter().map(|d| d * d).sum::<f64>().sqrt();
        assert!((2.0 * size - 0.4).abs() < 1e-12, "{size}");
    }
}
