//! The sensors: what the model expects of them, and which readings are believed.

use super::censored::{self, End};
use super::extended::Room;
use super::health::{Health, Innovation, Reading};
use super::model::{FilterModel, Sensor};
use super::smooth::Correction;
use crate::noise::Limits;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Evaluation, Events};

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
pub(super) struct Believed {
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

/// The readings of a sensor that were rejected in a row.
#[derive(Clone, Copy, Debug, Default)]
struct Lockout {
    /// readings that differ from the one before
    moved: usize,
    last: f64,
}

#[derive(Clone, Debug)]
pub(super) struct Sensing {
    output_map: Evaluation,
    states: Vec<String>,
    sensors: Vec<Sensor>,
    output_entries: Vec<(usize, usize)>,
    /// h, then the entries of C
    values: Vec<f64>,
    gate: Option<f64>,
    /// of readings that only stand for others ([`super::FilterSettings::foresees`])
    foresees: bool,
    lockouts: Vec<Lockout>,
    pub innovations: Vec<Innovation>,
    pub health: Health,
    /// of this sample, where a smoother asks for them
    pub corrections: Option<Vec<Correction>>,
    /// room of the extended filter
    pub room: Room,
}

impl Sensing {
    pub fn new(
        model: &FilterModel,
        gate: Option<f64>,
        keep_corrections: bool,
        foresees: bool,
    ) -> Self {
        let count = model.sensors.len();
        Self {
            output_map: model.output_map.evaluation(),
            states: model.states().to_vec(),
            sensors: model.sensors.clone(),
            output_entries: model.output_entries.clone(),
            values: vec![0.0; count + model.output_entries.len()],
            gate,
            foresees,
            lockouts: vec![Lockout::default(); count],
            innovations: vec![Innovation::default(); count],
            health: Health::of(count),
            corrections: keep_corrections.then(Vec::new),
            room: Room::default(),
        }
    }

    pub fn states(&self) -> &[String] {
        &self.states
    }

    pub fn take_corrections(&mut self) -> Vec<Correction> {
        self.corrections
            .as_mut()
            .map(std::mem::take)
            .unwrap_or_default()
    }

    /// h(t, x, u), and the entries of C there.
    pub fn evaluate(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<&[f64], Error> {
        self.values_at(t, x, u, self.values.len())
    }

    /// h(t, x, u), whether or not C has values there.
    pub fn predict(&mut self, t: f64, x: &[f64], u: &[f64]) -> Result<&[f64], Error> {
        self.values_at(t, x, u, self.sensors.len())
    }

    /// h, where the first `needed` values are finite.
    fn values_at(&mut self, t: f64, x: &[f64], u: &[f64], needed: usize) -> Result<&[f64], Error> {
        let signals = self.output_map.signals_mut();
        let (own, known) = signals.split_at_mut(x.len());
        own.copy_from_slice(x);
        known.copy_from_slice(u);
        self.output_map.enter(t);
        self.output_map.outputs(t, &[], &mut self.values);
        match self.values[..needed].iter().all(|v| v.is_finite()) {
            true => Ok(&self.values[..self.sensors.len()]),
            false => Err(self.output_map.not_finite(t, &[])),
        }
    }

    /// Row i of C where it was evaluated last.
    pub fn slopes(&self, i: usize) -> Vec<f64> {
        let mut row = vec![0.0; self.states.len()];
        self.write_slopes(i, &mut row);
        row
    }

    /// The same with room for it.
    pub fn write_slopes(&self, i: usize, row: &mut [f64]) {
        row.fill(0.0);
        let values = &self.values[self.sensors.len()..];
        for (&(output, state), value) in self.output_entries.iter().zip(values) {
            if output == i {
                row[state] = *value;
            }
        }
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
        if reading.is_finite() {
            innovation.reading = Reading::Taken;
            let (mut shown, mut end) = (reading, None);
            if let Some(limits) = limits {
                (shown, end) = (limits.shown(reading), End::of(limits, reading));
            }
            let plain = shown - predicted;
            innovation.value = plain;
            if let Some(limits) = limits {
                censored::judge(limits, end, &mut innovation);
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
        self.follow(i, reading, innovation.reading);
        self.health.sensors[i].count(&innovation);
        self.innovations[i] = innovation;
        believed
    }

    fn is_outlier(&self, i: usize, innovation: f64, deviation: f64) -> bool {
        let Some(gate) = self.gate else { return false };
        let relieved =
            self.health.sensors[i].locked_out >= LOCKED_OUT && self.lockouts[i].moved >= MOVED;
        !relieved && innovation.abs() > gate * deviation
    }

    fn follow(&mut self, i: usize, reading: f64, became: Reading) {
        let lockout = &mut self.lockouts[i];
        match became {
            Reading::Missing => return,
            Reading::Rejected => lockout.moved += usize::from(reading != lockout.last),
            Reading::Taken | Reading::AtLimit => lockout.moved = 0,
        }
        lockout.last = reading;
    }
}

impl Persist for Sensing {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        self.output_map.walk(walk)?;
        for lockout in &mut self.lockouts {
            walk.count(&mut lockout.moved)?;
            walk.number(&mut lockout.last)?;
        }
        for innovation in &mut self.innovations {
            innovation.walk(walk)?;
        }
        self.health.walk(walk)
    }
}
