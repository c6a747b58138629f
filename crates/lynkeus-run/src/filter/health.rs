//! Whether readings and estimate go together.

use crate::snapshot::{Damaged, Persist, Walk};

/// What became of a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// the sensor did not report
    #[default]
    Missing,
    /// it corrected the estimate
    Taken,
    /// the gate kept it out, or sigma points of negative weight gave it no variance
    Rejected,
    /// at a limit of the sensor, where the model expects the output there or beyond: it says little,
    /// and is not judged
    AtLimit,
}

/// A reading beside what was expected of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Innovation {
    /// y − ŷ, in the unit of the output; 0 where the sensor did not report. Of a reading at a limit of
    /// its sensor the mean of what y may be, less ŷ
    pub value: f64,
    /// its standard deviation before the correction, over what the sensor can show
    pub deviation: f64,
    /// the same once the start is forgotten: of an observer with a theorem, whose error system is
    /// driven by the noises alone; of a filter, the deviation itself
    pub settled: f64,
    /// what the model expected: ŷ before the correction
    pub predicted: f64,
    /// what became of it
    pub reading: Reading,
}

/// Counts of one sensor.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct SensorHealth {
    /// readings that corrected the estimate
    pub taken: usize,
    /// samples without a reading
    pub missing: usize,
    /// readings that the gate kept out
    pub rejected: usize,
    /// readings at a limit, the model expecting the output there or beyond
    pub at_limit: usize,
    /// of these, those of which it was known how far off they may be
    pub judged: usize,
    /// Σ (innovation/deviation)² of the readings judged
    pub squares: f64,
    /// readings rejected in a row, up to now
    pub locked_out: usize,
}

impl SensorHealth {
    /// The mean of (innovation/deviation)², 1 where noise and model are as declared; none
    /// before the first reading, and where no covariance says what to expect.
    #[must_use]
    pub fn consistency(&self) -> Option<f64> {
        (self.judged > 0).then(|| self.squares / self.judged as f64)
    }

    /// The counts after those of an earlier moment.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            taken: self.taken - earlier.taken,
            missing: self.missing - earlier.missing,
            rejected: self.rejected - earlier.rejected,
            at_limit: self.at_limit - earlier.at_limit,
            judged: self.judged - earlier.judged,
            squares: self.squares - earlier.squares,
            locked_out: self.locked_out,
        }
    }

    pub(crate) fn count(&mut self, innovation: &Innovation) {
        match innovation.reading {
            Reading::Missing => self.missing += 1,
            Reading::AtLimit => self.at_limit += 1,
            Reading::Rejected => {
                self.rejected += 1;
                self.locked_out += 1;
            }
            Reading::Taken => {
                self.taken += 1;
                self.locked_out = 0;
                if innovation.deviation > 0.0 {
                    self.judged += 1;
                    self.squares += (innovation.value / innovation.deviation).powi(2);
                }
            }
        }
    }
}

/// Counts of particles.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ParticleHealth {
    /// updates by readings
    pub updates: usize,
    /// times that they were drawn anew
    pub resampled: usize,
    /// updates whose readings no particle explains
    pub starved: usize,
    /// the least effective number after an update
    pub lowest: f64,
    /// updates after which hardly more than one particle counted
    pub alone: usize,
    /// most of them in a row
    pub longest_alone: usize,
    /// of them in a row, up to now
    row: usize,
    /// times that a particle came to where the plant has no value and was put back into the declared ranges
    pub put_back: usize,
}

impl Default for ParticleHealth {
    fn default() -> Self {
        Self {
            updates: 0,
            resampled: 0,
            starved: 0,
            lowest: f64::INFINITY,
            alone: 0,
            longest_alone: 0,
            row: 0,
            put_back: 0,
        }
    }
}

impl ParticleHealth {
    /// An update that leaves so many particles that count, where fewer than `least` are one.
    pub(crate) fn see(&mut self, effective: f64, least: f64) {
        self.updates += 1;
        self.lowest = self.lowest.min(effective);
        match effective < least {
            true => (self.alone, self.row) = (self.alone + 1, self.row + 1),
            false => self.row = 0,
        }
        self.longest_alone = self.longest_alone.max(self.row);
    }
}

impl Persist for ParticleHealth {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.number(&mut self.lowest)?;
        for count in [
            &mut self.updates,
            &mut self.resampled,
            &mut self.starved,
            &mut self.alone,
            &mut self.longest_alone,
            &mut self.row,
            &mut self.put_back,
        ] {
            walk.count(count)?;
        }
        Ok(())
    }
}

/// Counts of a whole run.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Health {
    /// one per sensor
    pub sensors: Vec<SensorHealth>,
    /// values of known inputs that were missing, where the last one held
    pub inputs_held: usize,
    /// samples at which the estimate was put back into the declared ranges, because the plant has
    /// no value where it was
    pub confined: usize,
    /// times that the estimate was put into the bounds where it is kept
    pub projected: usize,
    /// samples at which a moving horizon has not come to the minimum over its window
    pub unsolved: usize,
    /// how the particles went; none of what has no particles
    pub particles: Option<ParticleHealth>,
}

impl Health {
    /// Of so many sensors, before the first sample.
    pub(crate) fn of(sensors: usize) -> Self {
        Self {
            sensors: vec![SensorHealth::default(); sensors],
            ..Self::default()
        }
    }
}

impl Persist for Health {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        for sensor in &mut self.sensors {
            walk.count(&mut sensor.taken)?;
            walk.count(&mut sensor.missing)?;
            walk.count(&mut sensor.rejected)?;
            walk.count(&mut sensor.at_limit)?;
            walk.count(&mut sensor.judged)?;
            walk.number(&mut sensor.squares)?;
            walk.count(&mut sensor.locked_out)?;
        }
        walk.count(&mut self.inputs_held)?;
        walk.count(&mut self.confined)?;
        walk.count(&mut self.projected)?;
        walk.count(&mut self.unsolved)?;
        // whether there are some is no state
        self.particles.iter_mut().try_for_each(|own| own.walk(walk))
    }
}

impl Persist for Innovation {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.number(&mut self.value)?;
        walk.number(&mut self.deviation)?;
        walk.number(&mut self.settled)?;
        walk.number(&mut self.predicted)?;
        let mut place = self.reading as usize;
        walk.below(&mut place, Reading::ALL.len())?;
        self.reading = Reading::ALL[place];
        Ok(())
    }
}

impl Reading {
    const ALL: [Self; 4] = [Self::Missing, Self::Taken, Self::Rejected, Self::AtLimit];
}
