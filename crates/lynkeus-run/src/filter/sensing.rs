//! The sensors: what the model expects of them, and which readings are believed.

use super::belief::Belief;
use super::censored::{Believed, End, FAR, Tail};
use super::health::{Health, Innovation, Reading};
use super::model::{NoisyModel, Sensor};
use super::record::Record;
use super::root::dot;
use super::settings::FilterSettings;
use super::smoother::Correction;
use crate::Result;
use crate::linearised::OutputMap;
use crate::manifold::Manifold;
use crate::noise::Limits;
use crate::runner::Sample;
use crate::snapshot::{Damaged, Persist, Walk};

/// A reading so many deviations from what is expected contradicts the prediction: then it has a say in
/// how large a noise that grows with the value is. A nearer one has none: readings that come out high
/// would count less than those that come out low.
pub(crate) const SURPRISE: f64 = 3.0;

#[derive(Clone, Debug)]
pub(crate) struct Sensing {
    pub output_map: OutputMap,
    pub manifold: Manifold,
    sensors: Vec<Sensor>,
    gate: Option<f64>,
    /// rejections in a row that end its say
    patience: usize,
    /// of readings that only stand for others ([`FilterSettings::foresees`])
    foresees: bool,
    /// of the readings of each sensor that were rejected in a row, those that differ from the one before
    pub moved: Vec<usize>,
    /// the reading before
    pub last: Vec<f64>,
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
            manifold: model.manifold.clone(),
            sensors: model.sensors.clone(),
            gate: settings.gate,
            patience: settings.patience,
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
        let readings = self
            .manifold
            .signed(sample.readings, self.output_map.outputs());
        for (i, reading) in readings.iter().enumerate() {
            let spread = self.project(i, belief, None);
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

    /// Takes the row of C of a sensor; where it was linearised elsewhere, carried over from there to another place.
    pub fn take_slopes(&mut self, sensor: usize, carried: Option<(&[f64], &[f64])>) {
        self.output_map.write_slopes(sensor, &mut self.slopes);
        if let Some((from, to)) = carried {
            self.manifold.transport(from, to, &mut self.slopes, 1);
        }
    }

    /// The same, and what the belief makes of it: the variance of the output.
    pub fn project(
        &mut self,
        sensor: usize,
        belief: &Belief,
        carried: Option<(&[f64], &[f64])>,
    ) -> f64 {
        self.take_slopes(sensor, carried);
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
            let (mut shown, mut end) = (self.manifold.lifted(i, reading, predicted), None);
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
                    variance = noise.variance_after(shown, predicted, spread);
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
        let moved = self.moved[i] >= self.patience.div_ceil(2);
        let relieved = moved && self.health.sensors[i].locked_out >= self.patience;
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

/// A reading inside the range, of which the model expects that it is so many deviations beyond an end,
/// is no chance.
const NO_CHANCE: f64 = 4.0;

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
