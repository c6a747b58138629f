//! Readings at an end of what their sensors can show, over all runs.

use lynkeus_model::Plant;
use lynkeus_run::filter::Limits;
use lynkeus_run::{Column, Role};
use lynkeus_words::figures;

use super::Rig;
use super::runs::Whole;
use crate::course::recorded::Recorded;
use crate::judge::saturated::{Limited, TAKEN, limited};
use crate::prepare::Prepared;

/// A measured output whose sensor has limits, where runs have its readings.
#[derive(Clone, Debug)]
pub(super) struct Sensor {
    pub name: String,
    pub limits: Limits,
    pub readings: Column,
}

/// How often a sensor is at an end.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Clipped {
    /// runs with such a reading
    pub runs: usize,
    /// such readings in all of them
    pub readings: usize,
}

/// The sensors with limits.
pub(super) fn sensors(prepared: &Prepared<'_>, plant: &Plant) -> Vec<Sensor> {
    let of = |Limited { name, limits }| {
        let place = plant.outputs.iter().position(|o| o.name == name)?;
        let readings = Role::Measured.at(place);
        Some(Sensor {
            name,
            limits,
            readings,
        })
    };
    limited(prepared).into_iter().filter_map(of).collect()
}

impl Sensor {
    /// The readings of one run that are at an end.
    pub fn count(&self, run: &Recorded) -> usize {
        let readings = run.column(self.readings).into_iter().flatten();
        readings.filter(|y| self.limits.ends(*y)).count()
    }
}

impl Clipped {
    /// Of the counts of all runs.
    pub fn of(counts: impl Iterator<Item = usize>) -> Self {
        counts.fold(Self::default(), |sum, count| Self {
            runs: sum.runs + usize::from(count > 0),
            readings: sum.readings + count,
        })
    }

    /// By sensor, of runs that were kept whole.
    pub fn of_all(wholes: &[Whole], sensors: usize) -> Vec<Self> {
        let of = |place: usize| {
            let counts = wholes.iter().filter_map(|run| run.at_ends.get(place));
            Self::of(counts.copied())
        };
        (0..sensors).map(of).collect()
    }
}

/// What is to be said of so many runs of so many rows; none where no reading is at an end.
pub(super) fn told(
    sensors: &[Sensor],
    clipped: &[Clipped],
    rig: &Rig,
    runs: usize,
    rows: usize,
) -> Option<String> {
    let readings = (runs * rows) as f64;
    let pairs = sensors.iter().zip(clipped).filter(|(_, c)| c.runs > 0);
    let each = pairs.map(|(sensor, clipped)| {
        let share = figures(100.0 * clipped.readings as f64 / readings, 2);
        let Sensor { name, .. } = sensor;
        format!(
            "{name} in {} of {runs} runs, {share} % of all its readings",
            clipped.runs
        )
    });
    let each: Vec<String> = each.collect();
    let taken = match rig.design.observer.filter.is_some() {
        true => "this filter takes that for a bound",
        false => TAKEN,
    };
    (!each.is_empty()).then(|| {
        format!(
            "at an end of the sensor's range: {}; {taken}",
            each.join("; ")
        )
    })
}
