//! Readings of sensors that show a part of what they measure.
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

use super::health::{Innovation, Reading};
use crate::noise::Limits;

/// Ends that are so many deviations away do not matter: less than 10⁻¹⁸ of readings get there.
pub(super) const FAR: f64 = 9.0;

/// A reading that takes less than this share of the variance away says nothing.
const NOTHING: f64 = 1e-10;

/// A reading inside the range, of which the model expects that it is so many deviations beyond an end,
/// is no chance.
const NO_CHANCE: f64 = 4.0;

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
        if size < 2.25 {
            // Φ(a) − ½ = φ(a)(a + a³/3 + a⁵/(3·5) + …)
            let (mut term, mut sum) = (a, a);
            for k in 1..40 {
                term *= a * a / f64::from(2 * k + 1);
                sum += term;
            }
            let weight = 0.5 - density * sum;
            let mean = density / weight;
            return Self {
                weight,
                mean,
                excess: mean - a,
            };
        }
        // Laplace's continued fraction: φ/Φ(−a) = a + 1/(a + 2/(a + 3/…))
        let excess = (1..80)
            .rev()
            .fold(0.0, |rest, k| f64::from(k) / (size + rest));
        let weight = density / (size + excess);
        if a > 0.0 {
            return Self {
                weight,
                mean: a + excess,
                excess,
            };
        }
        let weight = 1.0 - weight;
        let mean = density / weight;
        Self {
            weight,
            mean,
            excess: mean - a,
        }
    }

    /// δ: the share of its variance that a number loses by being beyond.
    pub fn told(&self) -> f64 {
        self.mean * self.excess
    }

    /// 1 − δ, which is 1/a² far out.
    fn left(&self) -> f64 {
        let a = self.mean - self.excess;
        (1.0 - self.told()).max(1.0 / (a * a + 6.0)).min(1.0)
    }
}

/// An end of a sensor's range.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    Low,
    High,
}

impl End {
    /// 1 where what is beyond is larger, else −1.
    fn sign(self) -> f64 {
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

    fn value(self, limits: Limits) -> f64 {
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

/// How far inside the range the prediction is, in deviations of the reading.
#[derive(Clone, Copy, Debug)]
struct Room {
    below: f64,
    above: f64,
}

/// What a reading says of a prediction near an end of the range: its innovation has mean 0 and the
/// deviation that is given with it, over all readings that may come. Of one at an end the innovation is
/// the mean of those that y may have. Where y itself is expected beyond an end, a reading there is
/// [`Reading::AtLimit`] and not judged, and the others are judged among themselves.
pub(super) fn judge(limits: Limits, end: Option<End>, innovation: &mut Innovation) {
    let (deviation, predicted) = (innovation.deviation, innovation.predicted);
    if let Some(end) = end {
        innovation.value = end.value(limits) - predicted;
    }
    if deviation <= 0.0 {
        let is_beyond = |end: End| end.sign() * innovation.value <= 0.0;
        if end.is_some_and(is_beyond) {
            innovation.reading = Reading::AtLimit;
        }
        return;
    }
    let room = Room {
        below: (predicted - limits.low) / deviation,
        above: (limits.high - predicted) / deviation,
    };
    let is_near = room.below < FAR || room.above < FAR;
    if !is_near && end.is_none() {
        return;
    }
    let mean = |end: End| match end {
        End::Low => -deviation * Tail::beyond(room.below).mean,
        End::High => deviation * Tail::beyond(room.above).mean,
    };
    let outside = match (room.below < 0.0, room.above < 0.0) {
        (true, _) => Some((End::Low, room.below)),
        (_, true) => Some((End::High, room.above)),
        _ => None,
    };
    if let Some(end) = end {
        innovation.value = mean(end);
    }
    match outside {
        None => {
            let lost = lost(room.below) + lost(room.above);
            innovation.deviation = deviation * (1.0 - lost).max(0.0).sqrt();
        }
        Some((beyond, _)) if end == Some(beyond) => innovation.reading = Reading::AtLimit,
        Some((beyond, room)) if -room < NO_CHANCE => {
            // given that it is on this side of the end
            let rest = Tail::beyond(-room);
            innovation.value += beyond.sign() * deviation * rest.mean;
            innovation.deviation = deviation * rest.left().sqrt();
        }
        Some(_) => {}
    }
}

impl Limits {
    /// How much a reading tells of a value, as a share of what it tells without limits: Fisher's
    /// information of a clipped normal number of that deviation, beside that of a normal one.
    #[must_use]
    pub fn information(self, value: f64, deviation: f64) -> f64 {
        if deviation <= 0.0 {
            return f64::from(u8::from(self.low < value && value < self.high));
        }
        let [below, above] = [value - self.low, self.high - value].map(|room| room / deviation);
        let (outer, inner) = (below.min(above), below.max(above));
        (kept(outer) - lost(inner)).max(0.0)
    }
}

/// What readings at an end lose of Fisher's information, where the value is `room` deviations inside:
/// they tell λ² each, and would tell 1 + aλ.
fn lost(room: f64) -> f64 {
    let tail = Tail::beyond(room);
    match room < FAR {
        true => tail.weight * tail.left(),
        false => 0.0,
    }
}

/// What is left of it, as a sum: beyond the end it is little.
fn kept(room: f64) -> f64 {
    if room >= 0.0 {
        return 1.0 - lost(room);
    }
    let rest = Tail::beyond(-room);
    let density = rest.weight * rest.mean;
    rest.weight - room * density + density * density / (1.0 - rest.weight)
}

#[cfg(test)]
mod tests;
