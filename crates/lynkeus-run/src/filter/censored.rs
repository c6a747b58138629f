//! Readings that correct, and those at an end of their sensor's range among them.
//!
//! A sensor with limits shows the end of its range where what it measures, y = h(x) + v, is beyond: a
//! reading inside is y itself and corrects as any other; one at an end says that y is there or
//! beyond (J. Tobin, *Econometrica* 26 (1958) 24–36). With ŷ and S, mean and variance of y
//! before, σ = √S and a = (end − ŷ)/σ, y given that has the mean ŷ + σλ and the variance S(1 − δ),
//!
//! λ = φ(a)/Φ(−a),  δ = λ(λ − a),
//!
//! and x̂, P follow by the gain PCᵀ/S. That is the correction by a reading of ŷ + σ/(λ − a) whose noise
//! has the variance R + S(1/δ − 1): by none, where the model expects y far beyond.

use crate::noise::Limits;
use crate::snapshot::{Damaged, Walk};

/// Ends that are so many deviations away do not matter: less than 10⁻¹⁸ of readings get there.
pub(crate) const FAR: f64 = 9.0;

/// A reading that takes less than this share of the variance away says nothing.
const NOTHING: f64 = 1e-10;

/// A reading that corrects.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(crate) struct Believed {
    pub sensor: usize,
    pub reading: f64,
    /// of its noise
    pub variance: f64,
    /// reading − prediction
    pub innovation: f64,
    /// of the sensor's range, where the reading is at one
    pub end: Option<End>,
}

impl Believed {
    /// Innovation and variance of the noise with which it corrects, `moved` after what was predicted
    /// before has moved so far, and is known with a variance `spread`. None of a reading at an end of
    /// its range that says nothing new.
    pub fn weighed(&self, moved: f64, spread: f64) -> Option<(f64, f64)> {
        let innovation = self.innovation - moved;
        match self.end {
            None => Some((innovation, self.variance)),
            Some(end) => end.weighed(innovation, spread, self.variance),
        }
    }

    /// The logarithm of how likely it is that y is at the end of the range or beyond, as [`Self::weighed`] has
    /// it; 0 of a reading inside.
    pub fn log_likelihood(&self, moved: f64, spread: f64) -> f64 {
        let variance = spread + self.variance;
        match self.end {
            Some(end) if variance > 0.0 => {
                let off = end.sign() * (self.innovation - moved);
                Tail::beyond(off / variance.sqrt()).log_weight()
            }
            _ => 0.0,
        }
    }

    /// The reading, and the variance of its noise, where the output is taken to be h: one at an end of
    /// its range as the parabola that its likelihood −2 log Φ is like about h, by its slope and
    /// curvature there.
    pub fn about(&self, h: f64) -> Option<(f64, f64)> {
        let Some(end) = self.end else {
            return Some((self.reading, self.variance));
        };
        let weighed = end.weighed(self.reading - h, 0.0, self.variance);
        weighed.map(|(innovation, variance)| (h + innovation, variance))
    }

    /// Of a plant with so many sensors.
    pub fn walk(&mut self, walk: &mut Walk<'_>, sensors: usize) -> Result<(), Damaged> {
        walk.below(&mut self.sensor, sensors)?;
        for number in [&mut self.reading, &mut self.variance, &mut self.innovation] {
            walk.number(number)?;
        }
        let mut end = self.end.map_or(0, |end| 1 + end as usize);
        walk.below(&mut end, 3)?;
        self.end = [None, Some(End::Low), Some(End::High)][end];
        Ok(())
    }
}

/// A standard normal number that is larger than a.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Tail {
    /// how likely it is: Φ(−a)
    pub weight: f64,
    /// its mean λ
    pub mean: f64,
    /// λ − a
    pub excess: f64,
}

impl Tail {
    /// Beyond `a`.
    pub fn beyond(a: f64) -> Self {
        const DENSITY: f64 = 0.398_942_280_401_432_7;
        let size = a.abs();
        let density = DENSITY * (-0.5 * a * a).exp();
        let weight = if size < 2.25 {
            // Φ(a) − ½ = φ(a)(a + a³/3 + a⁵/(3·5) + …)
            let (mut term, mut sum) = (a, a);
            for k in 1..40 {
                term *= a * a / f64::from(2 * k + 1);
                sum += term;
            }
            0.5 - density * sum
        } else {
            // Laplace's continued fraction: φ/Φ(−a) = a + 1/(a + 2/(a + 3/…))
            let fractions = (1..80).rev().map(f64::from);
            let excess = fractions.fold(0.0, |rest, k| k / (size + rest));
            let weight = density / (size + excess);
            if a > 0.0 {
                let mean = a + excess;
                return Self {
                    weight,
                    mean,
                    excess,
                };
            }
            1.0 - weight
        };
        let mean = density / weight;
        Self {
            weight,
            mean,
            excess: mean - a,
        }
    }

    /// The logarithm of how likely it is, also where that is too small for a number.
    pub fn log_weight(&self) -> f64 {
        let a = self.mean - self.excess;
        match a > 0.0 {
            true => -0.5 * (a * a + std::f64::consts::TAU.ln()) - self.mean.ln(),
            false => self.weight.ln(),
        }
    }

    /// δ: the share of its variance that a number loses by being beyond.
    pub fn told(&self) -> f64 {
        self.mean * self.excess
    }

    /// 1 − δ, which is 1/a² far out.
    pub fn left(&self) -> f64 {
        let a = self.mean - self.excess;
        (1.0 - self.told()).max(1.0 / (a * a + 6.0)).min(1.0)
    }
}

/// An end of a sensor's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum End {
    Low,
    High,
}

impl End {
    /// 1 where what is beyond is larger, else −1.
    pub fn sign(self) -> f64 {
        match self {
            Self::Low => -1.0,
            Self::High => 1.0,
        }
    }

    /// That a reading is at.
    pub fn of(limits: Limits, reading: f64) -> Option<Self> {
        match reading {
            y if y >= limits.high => Some(Self::High),
            y if y <= limits.low => Some(Self::Low),
            _ => None,
        }
    }

    pub fn value(self, limits: Limits) -> f64 {
        match self {
            Self::Low => limits.low,
            Self::High => limits.high,
        }
    }

    /// A reading at this end as an ordinary one: its innovation and the variance of its noise, where
    /// the end is `innovation` from what is expected with a variance of `spread`, and y has a noise of
    /// variance `noise`. None where it says nothing.
    pub fn weighed(self, innovation: f64, spread: f64, noise: f64) -> Option<(f64, f64)> {
        let variance = spread + noise;
        if variance.is_nan() || variance <= 0.0 {
            // both are certain of themselves: y is at the end, or is expected beyond
            return (self.sign() * innovation > 0.0).then_some((innovation, noise));
        }
        let deviation = variance.sqrt();
        let tail = Tail::beyond(self.sign() * innovation / deviation);
        let told = tail.told();
        (told > NOTHING).then(|| {
            let value = self.sign() * deviation / tail.excess;
            (value, noise + variance * (1.0 / told - 1.0).max(0.0))
        })
    }
}
