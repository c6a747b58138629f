//! What the runs of one value say of it, whoever made them.

use lynkeus_model::Plant;
use lynkeus_observers::{Estimate, Observer, Signal};
use lynkeus_run::{Column, Role, Trajectory};

use super::errors::{Errors, rms, run_away};
use super::reference::Reference;
use super::{Peak, Row, measures};
use crate::crew::{Watch, part};
use crate::{Error, Study, prepare::systems};

/// A run of the plant and of what estimates it.
pub(super) trait Run {
    /// Times of the rows.
    fn times(&self) -> Vec<f64>;
    /// One column by row; none where the run does not have it.
    fn column(&self, column: Column) -> Option<Vec<f64>>;
}

impl Run for Trajectory {
    fn times(&self) -> Vec<f64> {
        Self::times(self).to_vec()
    }

    fn column(&self, column: Column) -> Option<Vec<f64>> {
        Self::column(self, column).map(<[f64]>::to_vec)
    }
}

/// What a value is run under.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Under {
    /// sensors without noise
    Exact,
    Noise,
    /// sensors without noise, and `disturbance` of `[tune]` on the plant's inputs
    Disturbance,
}

/// The runs of one value.
pub(super) trait Runs {
    type Run: Run;

    /// A run, or why its estimate is none.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    fn run(&self, under: Under, watch: &mut Watch<'_>) -> Result<Result<Self::Run, String>, Error>;

    /// The longest stable step over the step of the sensor, along the exact run; none where
    /// nothing is corrected between samples.
    fn margin(&self, exact: &Self::Run) -> Option<f64>;
}

/// What the runs are measured by.
pub(super) struct Judge<'a> {
    pub study: &'a Study,
    pub plant: &'a Plant,
    pub observer: Observer,
    pub reference: &'a Reference,
}

impl Judge<'_> {
    /// Fills the row in; the reason where a run failed.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn judge(
        &self,
        row: &mut Row,
        runs: &impl Runs,
        watch: &mut Watch<'_>,
    ) -> Result<Option<String>, Error> {
        let is_disturbed = !self.study.tune.disturbance.is_empty();
        let parts = if is_disturbed { 3 } else { 2 };
        let run = match runs.run(Under::Exact, &mut part(watch, 0, parts))? {
            Ok(run) => run,
            Err(reason) => return Ok(Some(reason)),
        };
        let exact = self.errors(&run);
        if let Some(reason) = run_away(&exact.scaled) {
            return Ok(Some(reason));
        }
        self.exact(row, &exact, &run);
        row.set(measures::SAMPLING_MARGIN, runs.margin(&run));
        let mut failure = None;
        match runs.run(Under::Noise, &mut part(watch, 1, parts))? {
            Ok(run) => self.noisy(row, &exact, &run),
            Err(reason) => failure = Some(format!("with noise: {reason}")),
        }
        if is_disturbed {
            let run = runs.run(Under::Disturbance, &mut part(watch, 2, parts))?;
            let bound = run.map(|run| self.errors(&run).from(self.reference.tail).largest());
            row.set(measures::ULTIMATE_BOUND, bound.clone().ok().flatten());
            let reason = bound.err().map(|e| format!("under the disturbance: {e}"));
            failure = failure.or(reason);
        }
        Ok(failure)
    }

    /// Scaled errors of the estimates, in the observer's order; an input is what the plant has
    /// of it, disturbance included.
    fn errors(&self, run: &impl Run) -> Errors {
        let error = |(place, estimate): (usize, &Estimate)| {
            let column = systems::column_of(self.plant, &estimate.variable)?;
            let (estimate, truth) = (run.column(Role::Estimate.at(place))?, run.column(column)?);
            let scale = self.reference.scale(column);
            let pairs = estimate.iter().zip(truth);
            Some(pairs.map(|(hat, x)| (hat - x) / scale).collect())
        };
        let estimates = self.observer.estimates.iter().enumerate();
        Errors {
            time: run.times(),
            scaled: estimates.filter_map(error).collect(),
        }
    }

    /// The figures of the run without noise.
    fn exact(&self, row: &mut Row, exact: &Errors, run: &impl Run) {
        let Reference { starts, tail, .. } = self.reference;
        let settling = exact.settling(starts, self.study.tune.tolerance);
        row.set(measures::SETTLING_TIME, settling);
        row.set(measures::ULTIMATE_BOUND, exact.from(*tail).largest());
        row.set(measures::EXACT_ERROR, Some(exact.mean()));
        let Some((at, quantity, size)) = exact.peak() else {
            return;
        };
        row.set(measures::PEAK_ERROR, Some(size));
        let estimate = self.observer.estimates.get(quantity);
        let course = run.column(Role::Estimate.at(quantity));
        row.peak = estimate.and_then(|estimate| {
            Some(Peak {
                name: estimate.variable.name.clone(),
                estimate: *course?.get(at)?,
                time: *exact.time.get(at)?,
            })
        });
    }

    /// The figures of the run with noise, against the one without.
    fn noisy(&self, row: &mut Row, exact: &Errors, run: &impl Run) {
        let noisy = self.errors(run);
        let caused = noisy.minus(exact);
        let level = self.noise_level(run);
        let tail = caused.from(self.reference.tail);
        // what process noise adds is no noise of a sensor that comes through
        let is_moved = self.reference.noise.process.values().any(|q| *q > 0.0);
        let gain = (level > 0.0 && !is_moved).then(|| tail.worst_rms() / level);
        row.set(measures::NOISE_GAIN, gain);
        row.set(measures::NOISE_ERROR, Some(caused.mean()));
        row.set(measures::TOTAL_ERROR, Some(noisy.mean()));
    }

    /// The root mean square of the scaled noise of the measured outputs, as drawn, in the tail.
    fn noise_level(&self, run: &impl Run) -> f64 {
        let drawn = |signal: &Signal| {
            let place = systems::output_of(self.plant, signal)?;
            let (exact, measured) = (Role::Output.at(place), Role::Measured.at(place));
            let scale = self.reference.scale(exact);
            let (exact, measured) = (run.column(exact)?, run.column(measured)?);
            let pairs = exact.iter().zip(measured);
            Some(pairs.map(|(y, m)| (m - y) / scale).collect::<Vec<f64>>())
        };
        let measured = self.observer.measured.iter();
        let noise = Errors {
            time: run.times(),
            scaled: measured.filter_map(drawn).collect(),
        };
        let squares: Vec<f64> = noise
            .from(self.reference.tail)
            .scaled
            .iter()
            .map(|e| rms(e))
            .collect();
        rms(&squares)
    }
}
