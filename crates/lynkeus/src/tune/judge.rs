//! What the runs of one value say of it, whoever made them.

use lynkeus_model::Plant;
use lynkeus_observers::{Estimate, Observer, Signal};
use lynkeus_run::{Column, Role, Trajectory};

use super::errors::{Errors, rms};
use super::reference::Reference;
use super::{Peak, Row, measures};
use crate::{Study, systems};

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

/// What the runs are measured by.
pub(super) struct Judge<'a> {
    pub study: &'a Study,
    pub plant: &'a Plant,
    pub observer: Observer,
    pub reference: &'a Reference,
}

impl Judge<'_> {
    /// Scaled errors of the estimates, in the observer's order; an input is what the plant has
    /// of it, disturbance included.
    pub fn errors(&self, run: &impl Run) -> Errors {
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
    pub fn exact(&self, row: &mut Row, exact: &Errors, run: &impl Run) {
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
    pub fn noisy(&self, row: &mut Row, exact: &Errors, run: &impl Run) {
        let noisy = self.errors(run);
        let caused = noisy.minus(exact);
        let level = self.noise_level(run);
        let tail = caused.from(self.reference.tail);
        let gain = (level > 0.0).then(|| tail.worst_rms() / level);
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
