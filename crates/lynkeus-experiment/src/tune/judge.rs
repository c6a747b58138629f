//! What the runs of one value in simulation say of it.

use lynkeus_observers::{Estimate, Signal};
use lynkeus_run::Role;

use super::errors::{Errors, rms, run_away};
use super::reference::Reference;
use super::trial::{Trial, Under};
use super::{Peak, Row, measures};
use crate::course::plant::Ran;
use crate::crew::{Watch, part};
use crate::{Error, prepare::systems};

impl Trial<'_> {
    /// Fills the row in; an estimate that diverges is a row with the reason.
    ///
    /// # Errors
    /// A study that cannot be simulated.
    pub fn judge(&self, mut row: Row, watch: &mut Watch<'_>) -> Result<Row, Error> {
        let is_disturbed = !self.prepared.study().tune.disturbance.is_empty();
        let parts = if is_disturbed { 3 } else { 2 };
        let run = match self.run(Under::Exact, &mut part(watch, 0, parts))? {
            Ok(run) => run,
            Err(reason) => return Ok(row.failed(reason)),
        };
        let exact = self.errors(&run);
        if let Some(reason) = run_away(&exact.scaled) {
            return Ok(row.failed(reason));
        }
        self.exact(&mut row, &exact, &run);
        row.set(measures::SAMPLING_MARGIN, self.margin(&run));
        let mut failure = None;
        match self.run(Under::Noise, &mut part(watch, 1, parts))? {
            Ok(run) => self.noisy(&mut row, &exact, &run),
            Err(reason) => failure = Some(format!("with noise: {reason}")),
        }
        if is_disturbed {
            let run = self.run(Under::Disturbance, &mut part(watch, 2, parts))?;
            let bound = run.map(|run| self.errors(&run).from(self.reference.tail).largest());
            row.set(measures::ULTIMATE_BOUND, bound.clone().ok().flatten());
            let reason = bound.err().map(|e| format!("under the disturbance: {e}"));
            failure = failure.or(reason);
        }
        row.failure = failure;
        Ok(row)
    }

    /// Scaled errors of the estimates, in the observer's order; an input is what the plant has
    /// of it, disturbance included.
    fn errors(&self, run: &Ran) -> Errors {
        let error = |(place, estimate): (usize, &Estimate)| {
            let column = systems::column_of(self.prepared.plant(), &estimate.variable)?;
            let (estimate, truth) = (run.course.estimates.get(place)?, run.run.column(column)?);
            let scale = self.reference.scale(column);
            let pairs = estimate.iter().zip(truth);
            Some(pairs.map(|(hat, x)| (hat - x) / scale).collect())
        };
        let estimates = self.design.observer.estimates.iter().enumerate();
        Errors {
            time: run.run.time.to_vec(),
            scaled: estimates.filter_map(error).collect(),
        }
    }

    /// The figures of the run without noise.
    fn exact(&self, row: &mut Row, exact: &Errors, run: &Ran) {
        let Reference { starts, tail, .. } = self.reference;
        let settling = exact.settling(starts, self.prepared.study().tune.tolerance);
        row.set(measures::SETTLING_TIME, settling);
        row.set(measures::ULTIMATE_BOUND, exact.from(*tail).largest());
        row.set(measures::EXACT_ERROR, Some(exact.mean()));
        let Some((at, quantity, size)) = exact.peak() else {
            return;
        };
        row.set(measures::PEAK_ERROR, Some(size));
        let estimate = self.design.observer.estimates.get(quantity);
        let course = run.course.estimates.get(quantity);
        row.peak = estimate.and_then(|estimate| {
            Some(Peak {
                name: estimate.variable.name.clone(),
                estimate: course?.get(at)?,
                time: *exact.time.get(at)?,
            })
        });
    }

    /// The figures of the run with noise, against the one without.
    fn noisy(&self, row: &mut Row, exact: &Errors, run: &Ran) {
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
    fn noise_level(&self, run: &Ran) -> f64 {
        let drawn = |signal: &Signal| {
            let place = systems::output_of(self.prepared.plant(), signal)?;
            let (exact, measured) = (Role::Output.at(place), Role::Measured.at(place));
            let scale = self.reference.scale(exact);
            let (exact, measured) = (run.run.column(exact)?, run.run.column(measured)?);
            let pairs = exact.iter().zip(measured);
            Some(pairs.map(|(y, m)| (m - y) / scale).collect::<Vec<f64>>())
        };
        let measured = self.design.observer.measured.iter();
        let noise = Errors {
            time: run.run.time.to_vec(),
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
