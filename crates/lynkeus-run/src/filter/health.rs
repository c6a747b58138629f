//! Whether readings and estimate go together.

/// What became of a reading.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Reading {
    /// the sensor did not report
    #[default]
    Missing,
    /// it corrected the estimate
    Taken,
    /// the gate kept it out
    Rejected,
    /// at a limit of the sensor, on which the estimate is beyond it
    AtLimit,
}

/// A reading beside what was expected of it.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Innovation {
    /// y − ŷ, in the unit of the output; 0 where the sensor did not report
    pub value: f64,
    /// its standard deviation before the correction
    pub deviation: f64,
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
    /// readings at a limit that said nothing new
    pub at_limit: usize,
    /// Σ (innovation/deviation)² of the readings taken
    pub squares: f64,
    /// readings rejected in a row, up to now
    pub locked_out: usize,
}

impl SensorHealth {
    /// The mean of (innovation/deviation)², 1 where noise and model are as declared; none
    /// before the first reading.
    #[must_use]
    pub fn consistency(&self) -> Option<f64> {
        (self.taken > 0).then(|| self.squares / self.taken as f64)
    }

    /// The counts after those of an earlier moment.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        Self {
            taken: self.taken - earlier.taken,
            missing: self.missing - earlier.missing,
            rejected: self.rejected - earlier.rejected,
            at_limit: self.at_limit - earlier.at_limit,
            squares: self.squares - earlier.squares,
            locked_out: self.locked_out,
        }
    }

    pub(super) fn count(&mut self, innovation: &Innovation) {
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
                    self.squares += (innovation.value / innovation.deviation).powi(2);
                }
            }
        }
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
}
