//! The sensors: what the model expects of them, and which readings are believed.
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

use super::belief::Belief;
use super::health::{Health, Innovation, Reading};
use super::model::{NoisyModel, Sensor};
use super::record::{Record, Taken};
use super::root::dot;
use super::settings::FilterSettings;
use super::smoother::Correction;
use crate::Result;
use crate::linearised::OutputMap;
use crate::noise::Limits;
use crate::runner::Sample;
use crate::snapshot::{Damaged, Persist, Walk};

/// After so many rejections in a row the next reading is believed: a gate must not lock the
/// filter out for ever.
const LOCKED_OUT: usize = 10;
/// Of them so many have to differ from the reading before: a sensor that hangs, or shows an end
/// of its range, is no reason to doubt the estimate.
const MOVED: usize = 5;

/// A reading so many deviations from what is expected contradicts the prediction: then it has a say in
/// how large a noise that grows with the value is. A nearer one has none: readings that come out high
/// would count less than those that come out low.
const SURPRISE: f64 = 3.0;

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

    /// As a record has it.
    pub fn taken(&self) -> Taken {
        Taken {
            sensor: self.sensor,
            innovation: self.innovation,
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

#[derive(Clone, Debug)]
pub(crate) struct Sensing {
    pub output_map: OutputMap,
    sensors: Vec<Sensor>,
    gate: Option<f64>,
    /// of readings that only stand for others ([`FilterSettings::foresees`])
    foresees: bool,
    /// of the readings of each sensor that were rejected in a row, those that differ from the one before
    moved: Vec<usize>,
    /// the reading before
    last: Vec<f64>,
    pub innovations: Vec<Innovation>,
    pub health: Health,
    /// of this sample, where a smoother asks for them
    pub corrections: Option<Vec<Correction>>,
    /// what the last sample came to, where that is asked for
    pub record: Option<Record>,
    /// a row of C
    pub slopes: Vec<f64>,
    /// Sᵀ times it
    pub projected: Vec<f64>,
}

impl Sensing {
    pub fn new(model: &NoisyModel, settings: &FilterSettings) -> Self {
        let (n, count) = (model.process_noise.len(), model.sensors.len());
        // a window finds its own
        let keeps_corrections = settings.keep_history && !settings.is_window();
        Self {
            output_map: OutputMap::new(&model.output_map),
            sensors: model.sensors.clone(),
            gate: settings.gate,
            foresees: settings.foresees,
            moved: vec![0; count],
            last: vec![0.0; count],
            innovations: vec![Innovation::default(); count],
            health: Health::of(count),
            corrections: keeps_corrections.then(Vec::new),
            record: None,
            slopes: vec![0.0; n],
            projected: vec![0.0; n],
        }
    }

    pub fn take_corrections(&mut self) -> Vec<Correction> {
        let corrections = self.corrections.as_mut();
        corrections.map(std::mem::take).unwrap_or_default()
    }

    /// Decides what becomes of all readings of a sample before the first of them corrects, by h and C at the
    /// belief's mean, and gathers those that correct.
    pub fn judge_all(
        &mut self,
        belief: &Belief,
        sample: &Sample<'_>,
        taken: &mut Vec<Believed>,
    ) -> Result<()> {
        self.output_map
            .linearise(sample.t, &belief.x, sample.inputs)?;
        taken.clear();
        for (i, reading) in sample.readings.iter().enumerate() {
            let spread = self.project(i, belief);
            let predicted = self.output_map.outputs()[i];
            taken.extend(self.judge(i, *reading, predicted, spread));
            if let Some(record) = &mut self.record {
                record.project(&self.projected);
            }
        }
        if let Some(record) = &mut self.record {
            record.spread_projected();
        }
        Ok(())
    }

    /// Takes the row of C of a sensor, and what the belief makes of it: the variance of the output.
    pub fn project(&mut self, sensor: usize, belief: &Belief) -> f64 {
        self.output_map.write_slopes(sensor, &mut self.slopes);
        let projected = &mut self.projected;
        belief.root.transposed_times(&self.slopes, projected);
        dot(projected, projected)
    }

    /// Decides what becomes of a reading where the model predicts a value with a variance `spread`; what
    /// is returned corrects. Sigma points of negative weight may give an innovation a negative
    /// variance, by which no reading can be weighed.
    pub fn judge(
        &mut self,
        i: usize,
        reading: f64,
        predicted: f64,
        spread: f64,
    ) -> Option<Believed> {
        let Sensor {
            noise, mut limits, ..
        } = self.sensors[i];
        let mut variance = noise.expected_variance(predicted, spread);
        if self.foresees {
            let told = |limits: Limits| limits.information(predicted, variance.sqrt());
            variance /= limits.take().map_or(1.0, told).max(f64::MIN_POSITIVE);
        }
        let deviation = (spread + variance).max(0.0).sqrt();
        let mut innovation = Innovation {
            value: 0.0,
            deviation,
            settled: deviation,
            predicted,
            reading: Reading::Missing,
        };
        let mut believed = None;
        let mut off = f64::NAN;
        if reading.is_finite() {
            innovation.reading = Reading::Taken;
            let (mut shown, mut end) = (reading, None);
            if let Some(limits) = limits {
                (shown, end) = (limits.shown(reading), End::of(limits, reading));
            }
            let plain = shown - predicted;
            (innovation.value, off) = (plain, plain);
            if let Some(limits) = limits {
                judge_near_an_end(limits, end, &mut innovation);
            }
            if innovation.reading == Reading::Taken
                && (spread + variance < 0.0 || self.is_outlier(i, plain, deviation))
            {
                innovation.reading = Reading::Rejected;
            }
            if innovation.reading != Reading::Rejected {
                if end.is_none() && plain.abs() > SURPRISE * deviation {
                    variance = noise.variance_after(reading, predicted, spread);
                }
                believed = Some(Believed {
                    sensor: i,
                    reading: shown,
                    variance,
                    innovation: plain,
                    end,
                });
            }
        }
        innovation.settled = innovation.deviation;
        if let Some(record) = &mut self.record {
            record.see(i, predicted, off, variance);
        }
        self.follow(i, reading, innovation.reading);
        self.health.sensors[i].count(&innovation);
        self.innovations[i] = innovation;
        believed
    }

    fn is_outlier(&self, i: usize, innovation: f64, deviation: f64) -> bool {
        let Some(gate) = self.gate else { return false };
        let relieved = self.health.sensors[i].locked_out >= LOCKED_OUT && self.moved[i] >= MOVED;
        !relieved && innovation.abs() > gate * deviation
    }

    fn follow(&mut self, i: usize, reading: f64, became: Reading) {
        match became {
            Reading::Missing => return,
            Reading::Rejected => self.moved[i] += usize::from(reading != self.last[i]),
            Reading::Taken | Reading::AtLimit => self.moved[i] = 0,
        }
        self.last[i] = reading;
    }
}

impl Persist for Sensing {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.output_map.walk(walk)?;
        self.moved.iter_mut().try_for_each(|m| walk.count(m))?;
        walk.numbers(&mut self.last)?;
        for innovation in &mut self.innovations {
            innovation.walk(walk)?;
        }
        self.health.walk(walk)
    }
}

/// Ends that are so many deviations away do not matter: less than 10⁻¹⁸ of readings get there.
pub(crate) const FAR: f64 = 9.0;

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
    fn log_weight(&self) -> f64 {
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
    fn left(&self) -> f64 {
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

/// What a reading says of a prediction near an end of the range: its innovation has mean 0 and the
/// deviation that is given with it, over all readings that may come. Of one at an end the innovation is
/// the mean of those that y may have. Where y itself is expected beyond an end, a reading there is
/// [`Reading::AtLimit`] and not judged, and the others are judged among themselves.
fn judge_near_an_end(limits: Limits, end: Option<End>, innovation: &mut Innovation) {
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
    // how far inside the range the prediction is, in deviations of the reading
    let room = |end: End| end.sign() * (end.value(limits) - predicted) / deviation;
    let ends = [End::Low, End::High];
    if end.is_none() && !ends.iter().any(|end| room(*end) < FAR) {
        return;
    }
    if let Some(end) = end {
        innovation.value = end.sign() * deviation * Tail::beyond(room(end)).mean;
    }
    match ends.into_iter().find(|end| room(*end) < 0.0) {
        None => {
            let [below, above] = ends.map(|end| lost(room(end)));
            innovation.deviation = deviation * (1.0 - (below + above)).max(0.0).sqrt();
        }
        Some(beyond) if end == Some(beyond) => innovation.reading = Reading::AtLimit,
        Some(beyond) if -room(beyond) < NO_CHANCE => {
            // given that it is on this side of the end
            let rest = Tail::beyond(-room(beyond));
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
