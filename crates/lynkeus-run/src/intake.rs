//! What every estimator asks of a sample.

use crate::Error;
use crate::snapshot::{Damaged, Persist, Walk};

/// A sample as an observer takes it.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Sample<'a> {
    pub t: f64,
    /// by sensor; not finite where it did not report
    pub readings: &'a [f64],
    /// by known input; the last value where there was none
    pub inputs: &'a [f64],
    /// inputs of which the last value holds
    pub held: usize,
}

/// The samples so far, and whether the next one may follow them.
#[derive(Clone, Debug)]
pub(crate) struct Intake {
    /// of the sensors, then of the known inputs
    names: Vec<String>,
    sensors: usize,
    time: Option<f64>,
    values: Vec<f64>,
    held: usize,
}

impl Intake {
    pub fn new(names: Vec<String>, sensors: usize) -> Self {
        Self {
            values: vec![0.0; names.len()],
            names,
            sensors,
            time: None,
            held: 0,
        }
    }

    pub fn names(&self) -> &[String] {
        &self.names
    }

    pub fn sensors(&self) -> usize {
        self.sensors
    }

    pub fn time(&self) -> Option<f64> {
        self.time
    }

    /// The sample taken last.
    pub fn sample(&self) -> Sample<'_> {
        let (readings, inputs) = self.values.split_at(self.sensors);
        Sample {
            t: self.time.unwrap_or_default(),
            readings,
            inputs,
            held: self.held,
        }
    }

    /// Takes a sample, or nothing where one is refused.
    ///
    /// # Errors
    /// [`Error::Setting`] for a wrong number of signals, [`Error::NoNumber`] for a time or the
    /// first value of an input, [`Error::TimeBefore`].
    pub fn take(&mut self, t: f64, signals: &[f64]) -> Result<(), Error> {
        if signals.len() != self.names.len() {
            let expected = format!("{}: {}", self.names.len(), self.names.join(", "));
            return Err(Error::setting("number of signals", expected, signals.len()));
        }
        self.check_time(t)?;
        let inputs = self.sensors..self.names.len();
        let missing = |i: &usize| !signals[*i].is_finite();
        if let (None, Some(i)) = (self.time, inputs.clone().find(missing)) {
            return Err(no_number(&self.names[i], signals[i]));
        }
        self.values[..self.sensors].copy_from_slice(&signals[..self.sensors]);
        self.held = inputs.clone().filter(missing).count();
        for i in inputs.filter(|i| signals[*i].is_finite()) {
            self.values[i] = signals[i];
        }
        self.time = Some(t);
        Ok(())
    }

    /// Goes to a time at which nothing reports.
    ///
    /// # Errors
    /// As [`Intake::take`], and before the first sample.
    pub fn wait(&mut self, t: f64) -> Result<(), Error> {
        self.started()?;
        self.check_time(t)?;
        self.values[..self.sensors].fill(f64::NAN);
        self.held = 0;
        self.time = Some(t);
        Ok(())
    }

    /// The time of the last sample.
    ///
    /// # Errors
    /// [`Error::Setting`] where there is none.
    pub fn started(&self) -> Result<f64, Error> {
        let none = || Error::setting("samples so far", "one, which sets the time", 0);
        self.time.ok_or_else(none)
    }

    fn check_time(&self, t: f64) -> Result<(), Error> {
        if !t.is_finite() {
            return Err(no_number("t", t));
        }
        match self.time {
            Some(reached) if t < reached => Err(Error::TimeBefore { reached, time: t }),
            _ => Ok(()),
        }
    }
}

fn no_number(signal: &str, value: f64) -> Error {
    Error::NoNumber {
        signal: signal.to_owned(),
        value,
    }
}

impl Persist for Intake {
    fn walk(&mut self, walk: &mut Walk<'_>) -> Result<(), Damaged> {
        walk.optional(&mut self.time, Walk::number)?;
        walk.numbers(&mut self.values)?;
        walk.count(&mut self.held)
    }
}
