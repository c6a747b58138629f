//! A sensor as its readings come: which of them are none, whether it hangs, whether it went silent.

use lynkeus::stream::Channel;
use lynkeus::study::Screen;

use crate::bytes::{Parser, Writer};

/// Equal readings in a row that are none of our business.
const FEWEST: u64 = 5;
/// Readings that differed from the one before: the sensor has shown that it has noise.
const SHOWN: u64 = 30;
/// The expected number of false alarms of a sensor.
const ALARMS: f64 = 1e-6;
/// Silence for so many usual steps is told.
const SILENT: f64 = 10.0;
/// Steps after which one is usual.
const USUAL: u64 = 5;
/// The share of the last step in the usual one.
const LAST: f64 = 0.1;

/// What is known of a sensor.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Sensor {
    /// of readings
    steps: Steps,
    value: f64,
    /// equal readings in a row, up to now
    run: u64,
    points: u64,
    /// readings that equalled the one before, but for those of the run
    equal: u64,
    /// by screen, the last number that it saw and how many times that came
    screened: Vec<(f64, u64)>,
}

/// How long it usually is from one to the next.
#[derive(Clone, Debug, Default, PartialEq)]
pub(crate) struct Steps {
    count: u64,
    last: f64,
    usual: f64,
}

impl Steps {
    /// One at `t`, after all before.
    pub fn take(&mut self, t: f64) {
        let step = t - self.last;
        match self.count {
            0 => {}
            1 => self.usual = step,
            _ => self.usual += LAST * (step - self.usual),
        }
        self.count += 1;
        self.last = t;
    }

    /// How long it is from the last one to `t`, where that is more than so many usual ones.
    pub fn lacks(&self, t: f64, times: f64) -> Option<f64> {
        let step = t - self.last;
        (self.count > USUAL && step > times * self.usual).then_some(step)
    }

    pub fn save(&self, to: &mut Writer) {
        to.word(self.count);
        to.number(self.last);
        to.number(self.usual);
    }

    pub fn load(from: &mut Parser<'_>) -> Option<Self> {
        Some(Self {
            count: from.word()?,
            last: from.number()?,
            usual: from.number()?,
        })
    }
}

impl Sensor {
    /// The reading of a row after all before, NaN where it is none.
    pub fn take(&mut self, t: f64, y: f64, channel: &Channel) -> f64 {
        if y.is_nan() {
            return y;
        }
        self.points += 1;
        if y == self.value && self.run > 0 {
            self.run += 1;
        } else {
            self.equal += self.run.saturating_sub(1);
            (self.value, self.run) = (y, 1);
        }
        let y = self.screen(y, &channel.screens);
        if y.is_finite() {
            self.steps.take(t);
        }
        y
    }

    /// A reading, NaN where one of the screens says that it is none: each sees what those before it leave.
    fn screen(&mut self, mut y: f64, screens: &[Screen]) -> f64 {
        self.screened.resize(screens.len(), (f64::NAN, 0));
        for (screen, last) in screens.iter().zip(&mut self.screened) {
            if y.is_nan() {
                break;
            }
            *last = match y == last.0 {
                true => (y, last.1 + 1),
                false => (y, 1),
            };
            let is_none = match *screen {
                Screen::Repeats => last.1 > 1,
                Screen::Frozen(most) => last.1 > most,
                Screen::Plausible(low, high) => !(low..=high).contains(&y),
            };
            if is_none {
                y = f64::NAN;
            }
        }
        y
    }

    /// For how many readings it hangs, although it has noise; none where it does not.
    pub fn hangs(&self, channel: &Channel) -> Option<u64> {
        let is_noisy = channel.noise.is_some_and(|noise| noise.size() > 0.0);
        let is_end = |(low, high): (f64, f64)| self.value <= low || self.value >= high;
        let is_told = is_noisy && !channel.limits.is_some_and(is_end) && channel.screens.is_empty();
        let others = self.points.saturating_sub(self.run);
        let differed = others.saturating_sub(self.equal);
        if !is_told || self.run < FEWEST || differed < SHOWN {
            return None;
        }
        let share = (self.equal as f64 + 1.0) / (others as f64 + 2.0);
        let expected = self.points as f64 * share.powf(self.run as f64 - 1.0);
        (expected < ALARMS).then_some(self.run)
    }

    /// For how long it has been silent, where that is unusual.
    pub fn is_silent(&self, t: f64) -> Option<f64> {
        self.steps.lacks(t, SILENT)
    }

    pub fn save(&self, to: &mut Writer) {
        self.steps.save(to);
        to.number(self.value);
        for count in [self.run, self.points, self.equal] {
            to.word(count);
        }
        to.word(self.screened.len() as u64);
        for (last, count) in &self.screened {
            to.number(*last);
            to.word(*count);
        }
    }

    pub fn load(from: &mut Parser<'_>) -> Option<Self> {
        Some(Self {
            steps: Steps::load(from)?,
            value: from.number()?,
            run: from.word()?,
            points: from.word()?,
            equal: from.word()?,
            screened: {
                let count = from.count(16)?;
                let read = (0..count).map(|_| Some((from.number()?, from.word()?)));
                read.collect::<Option<_>>()?
            },
        })
    }
}

#[cfg(test)]
mod tests {
    use lynkeus::stream::Given;
    use lynkeus::study::Noise;

    use super::*;

    fn channel() -> Channel {
        Channel {
            name: "level".into(),
            given: Given::Key("level".into()),
            is_sensor: true,
            noise: Some(Noise::Absolute(0.1)),
            limits: None,
            screens: vec![],
            unit: None,
        }
    }

    #[test]
    fn a_noisy_sensor_that_repeats_itself_hangs() {
        let (mut sensor, channel) = (Sensor::default(), channel());
        for k in 0..100_i32 {
            sensor.take(f64::from(k), f64::from(k * k % 37), &channel);
            assert_eq!(sensor.hangs(&channel), None);
        }
        for k in 100..112 {
            sensor.take(f64::from(k), 3.0, &channel);
        }
        assert_eq!(sensor.hangs(&channel), Some(12));
        sensor.take(112.0, 4.0, &channel);
        assert_eq!(sensor.hangs(&channel), None);
    }

    #[test]
    fn silence_is_measured_in_usual_steps() {
        let (mut sensor, channel) = (Sensor::default(), channel());
        for k in 0..20 {
            sensor.take(2.0 * f64::from(k), 1.0 + f64::from(k), &channel);
        }
        assert_eq!(sensor.is_silent(50.0), None);
        assert_eq!(sensor.is_silent(59.0), Some(21.0));
    }

    #[test]
    fn cells_that_are_no_readings_are_screened() {
        let mut channel = channel();
        channel.screens = vec![Screen::Plausible(0.0, 9.0), Screen::Repeats];
        let mut sensor = Sensor::default();
        let read = [1.0, 10.0, 1.0, 2.0].map(|y| sensor.take(0.0, y, &channel));
        // as in a log: what is not plausible makes no new sample of the number before it
        assert_eq!(read.map(f64::is_nan), [false, true, true, false]);
        let mut to = Writer::default();
        sensor.save(&mut to);
        let read = Sensor::load(&mut Parser(&to.0));
        assert_eq!(read, Some(sensor));
    }
}
