//! The sensors: what the model expects of them, and which readings are believed.

use super::extended::Room;
use super::health::{Health, Innovation, Reading};
use super::model::{FilterModel, Limits, Sensor};
use super::smooth::Correction;
use crate::snapshot::{Damaged, Persist, Walk};
use crate::{Dynamics, Error, Evaluation};

/// After so many rejections in a row the next reading is believed: a gate must not lock the
/// filter out for ever.
const LOCKED_OUT: usize = 10;
/// Of them so many have to differ from the reading before: a sensor that hangs, or shows an end
/// of its range, is no reason to doubt the estimate.
const MOVED: usize = 5;

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
    lockouts: Vec<Lockout>,
    pub innovations: Vec<Innovation>,
    pub health: Health,
    /// of this sample, where a smoother asks for them
    pub corrections: Option<Vec<Correction>>,
    /// room of the extended filter
    pub room: Room,
}

impl Sensing {
    pub fn new(model: &FilterModel, gate: Option<f64>, keep_corrections: bool) -> Self {
        let count = model.sensors.len();
        Self {
            output_map: model.output_map.evaluation(),
            states: model.states().to_vec(),
            sensors: model.sensors.clone(),
            output_entries: model.output_entries.clone(),
            values: vec![0.0; count + model.output_entries.len()],
            gate,
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

    /// The variance of a sensor's noise where the model predicts a value.
    pub fn noise(&self, i: usize, predicted: f64) -> f64 {
        self.sensors[i].noise.variance(predicted)
    }

    /// Decides what becomes of a reading whose innovation has the given variance. Sigma points of
    /// negative weight may give a negative one, by which no reading can be weighed.
    pub fn judge(&mut self, i: usize, reading: f64, predicted: f64, variance: f64) -> Innovation {
        let deviation = variance.max(0.0).sqrt();
        let mut innovation = Innovation {
            value: 0.0,
            deviation,
            predicted,
            reading: Reading::Missing,
        };
        if reading.is_finite() {
            innovation.value = reading - predicted;
            innovation.reading = match self.sensors[i].limits {
                Some(limits) if says_nothing(limits, reading, predicted) => Reading::AtLimit,
                _ if variance < 0.0 || self.is_outlier(i, innovation.value, deviation) => {
                    Reading::Rejected
                }
                _ => Reading::Taken,
            };
        }
        self.follow(i, reading, innovation.reading);
        self.health.sensors[i].count(&innovation);
        self.innovations[i] = innovation;
        innovation
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

/// A reading at a limit says that the output is there or beyond; nothing new where the model
/// expects just that.
fn says_nothing(limits: Limits, reading: f64, predicted: f64) -> bool {
    (reading <= limits.low && predicted <= limits.low)
        || (reading >= limits.high && predicted >= limits.high)
}
