//! What an observer makes of samples, whatever kind of observer it is.

use lynkeus_observers::Observer;
use lynkeus_run::Error as RunError;
use lynkeus_run::filter::SensorHealth;

use crate::Quantity;
use crate::systems::Reported;

/// Samples for an observer: what each sensor and each known input reads, NaN where it does not.
#[derive(Clone, Debug, Default)]
pub(crate) struct Samples<'a> {
    pub time: &'a [f64],
    /// one per measured output
    pub readings: Vec<&'a [f64]>,
    /// one per known input
    pub inputs: Vec<&'a [f64]>,
}

impl Samples<'_> {
    /// Values of row k, column by column: the readings, then the inputs.
    pub fn write_row(&self, k: usize, row: &mut [f64]) {
        let columns = self.readings.iter().chain(&self.inputs);
        for (value, column) in row.iter_mut().zip(columns) {
            *value = column[k];
        }
    }

    /// Whether a reading is missing somewhere.
    pub fn have_gaps(&self) -> bool {
        let mut all = self
            .readings
            .iter()
            .chain(&self.inputs)
            .flat_map(|c| c.iter());
        all.any(|x| !x.is_finite())
    }
}

/// The estimates of a run, and what is known of how good they are.
#[derive(Debug, Default)]
pub(crate) struct Course {
    /// by estimate, then by row
    pub estimates: Vec<Vec<f64>>,
    /// by monitor, then by row
    pub monitors: Vec<Vec<f64>>,
    /// standard deviations of the estimates
    pub deviations: Option<Vec<Vec<f64>>>,
    /// estimates given later rows, too
    pub smoothed: Option<Vec<Vec<f64>>>,
    /// how readings and model went together, by sensor; none where it was not followed
    pub sensors: Vec<SensorHealth>,
    /// the same over the last half of the rows
    pub late: Vec<SensorHealth>,
    /// values of known inputs that were missing, where the last one held
    pub inputs_held: usize,
    /// what was chosen for the user
    pub notes: Vec<String>,
    /// why the run ended early, with the rows before
    pub ended: Option<RunError>,
}

impl Course {
    /// Of a run of the observer's own system.
    pub fn of_run(observer: &Observer, reported: &Reported<'_>) -> Self {
        let column = |values: Option<&[f64]>| values.unwrap_or_default().to_vec();
        let estimates = (0..observer.estimates.len()).map(|i| column(reported.estimate(i)));
        let monitors = (0..observer.monitors.len()).map(|i| column(reported.monitor(i)));
        Self {
            estimates: estimates.collect(),
            monitors: monitors.collect(),
            ..Self::default()
        }
    }

    /// What was found of estimate `i`, to the quantity that it is of.
    pub fn give(&mut self, i: usize, with_deviation: bool, quantity: &mut Quantity) {
        quantity.estimate = self.estimates.get_mut(i).map(std::mem::take);
        let of = |columns: &mut Option<Vec<Vec<f64>>>| {
            columns
                .as_mut()
                .and_then(|c| c.get_mut(i))
                .map(std::mem::take)
        };
        quantity.deviation = of(&mut self.deviations).filter(|_| with_deviation);
        quantity.smoothed = of(&mut self.smoothed);
    }
}

/// Adds a row to columns.
pub(crate) fn add_row(columns: &mut [Vec<f64>], row: impl IntoIterator<Item = f64>) {
    for (column, x) in columns.iter_mut().zip(row) {
        column.push(x);
    }
}
