//! What an estimator asks of an observer under way.

use std::fmt::Debug;

use crate::filter::health::{Health, Innovation};
use crate::filter::{Record, Smoothed};
use crate::snapshot::{Damaged, Persist, Walk};
use crate::standing::{Stand, Standing};
use crate::{Error, Result, StepAdvice};

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

/// What the kinds of observers differ in. Any of the steps may fail half-way: the estimator
/// then goes back to where it was.
pub(crate) trait Runner: Persist + Debug + Send + Sync {
    /// The first sample, before its readings count.
    fn begin(&mut self, _: &Sample<'_>) -> Result<()> {
        Ok(())
    }

    /// From the sample before to the time of this one; only its inputs count.
    fn advance(&mut self, from: f64, sample: &Sample<'_>) -> Result<()>;

    /// The readings and inputs of a sample at its time.
    fn update(&mut self, sample: &Sample<'_>) -> Result<()>;

    /// Estimates and deviations at a time, all of them finite.
    fn report(&mut self, t: f64) -> Result<()>;

    fn estimate(&self) -> &[f64];

    fn deviations(&self) -> Option<&[f64]>;

    fn innovations(&self) -> &[Innovation];

    fn health(&self) -> &Health;

    /// From the next update on there is a record; of a filter.
    fn keep_record(&mut self) {}

    fn record(&self) -> Option<&Record> {
        None
    }

    /// How many particles count; of what has some.
    fn effective(&self) -> Option<f64> {
        None
    }

    /// The particles, and their weights, which sum to 1.
    fn particles(&self) -> Option<(&[f64], &[f64])> {
        None
    }

    /// The state of the observer itself.
    fn state(&self) -> &[f64] {
        self.estimate()
    }

    fn advice(&self) -> Option<StepAdvice> {
        None
    }

    /// Keeps the last update for a smoother, where it has a history.
    fn remember(&mut self) {}

    fn has_history(&self) -> bool {
        false
    }

    /// The estimate at each update given later ones, up to `lag` of them; none without history.
    fn smoothed(&self, _lag: Option<usize>, _deviations: bool) -> Option<Vec<Smoothed>> {
        None
    }

    /// What the smoother keeps.
    fn walk_history(&mut self, _: &mut Walk<'_>) -> Result<(), Damaged> {
        Ok(())
    }

    /// Where it stands after a sample.
    fn stand(&self) -> Stand<'_>;

    /// To where another one stood at the time of this sample, which has no readings.
    ///
    /// # Errors
    /// [`Error::Setting`]: it has other states, or knows of errors in another way.
    fn resume(&mut self, sample: &Sample<'_>, standing: &Standing) -> Result<()>;

    fn copied(&self) -> Box<dyn Runner>;
}

/// That a row at `t` may follow what was reached.
///
/// # Errors
/// [`Error::NoNumber`], [`Error::TimeBefore`].
pub(crate) fn check_time(reached: Option<f64>, t: f64) -> Result<()> {
    if !t.is_finite() {
        return Err(no_number("t", t));
    }
    match reached {
        Some(reached) if t < reached => Err(Error::TimeBefore { reached, time: t }),
        _ => Ok(()),
    }
}

pub(crate) fn no_number(signal: &str, value: f64) -> Error {
    Error::NoNumber {
        signal: signal.to_owned(),
        value,
    }
}

impl Clone for Box<dyn Runner> {
    fn clone(&self) -> Self {
        (**self).copied()
    }
}
