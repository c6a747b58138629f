//! The one engine of experiments: a study's plant through time, and an observer over samples of it or of a log.
//! What simulates, estimates, sweeps or compares asks here.

pub(crate) mod checkpoint;
pub mod columns;
pub(crate) mod computed;
pub(crate) mod corrections;
pub(crate) mod curved;
pub(crate) mod doubt;
pub(crate) mod ended;
pub mod filter;
pub mod fixed_steps;
pub mod inputs;
pub(crate) mod lines;
pub mod plant;
pub(crate) mod quantity;
pub mod recorded;
pub(crate) mod replay;
pub mod rig;
pub mod run;
pub(crate) mod sampled;
pub mod sampling;
mod screen;
pub(crate) mod taken;
pub(crate) mod trace;
pub(crate) mod units;

use lynkeus_expr::Spent;
use lynkeus_observers::Observer;
use lynkeus_run::filter::{ParticleHealth, SensorHealth};
use lynkeus_run::{Error as RunError, Role};

use crate::course::corrections::Corrections;
use crate::course::doubt::Doubt;
use crate::course::recorded::Recorded;
use crate::course::trace::Trace;
use crate::prepare::systems::monitor_column;
use crate::{Error, Quantity, Series};
use lynkeus_study::Records;
use lynkeus_table::series::{Iter, Store};

/// Samples for an observer: what each sensor and each known input reads, NaN where it does not.
#[derive(Clone, Debug, Default)]
pub struct Samples {
    /// times of the rows
    pub time: Series,
    /// one per measured output
    pub readings: Vec<Series>,
    /// one per known input
    pub inputs: Vec<Series>,
}

/// The rows of samples, one after the other.
pub struct Rows<'s> {
    time: Iter<'s>,
    columns: Vec<Iter<'s>>,
}

impl Rows<'_> {
    /// The next row's values, column by column (the readings, then the inputs), and its time.
    pub fn next(&mut self, values: &mut [f64]) -> Option<f64> {
        for (value, column) in values.iter_mut().zip(&mut self.columns) {
            *value = column.next().unwrap_or(f64::NAN);
        }
        self.time.next()
    }
}

impl Samples {
    /// From the first time to the last.
    pub fn span(&self) -> f64 {
        self.time.last().unwrap_or(0.0) - self.time.first().unwrap_or(0.0)
    }

    /// The rows from one of them on.
    pub fn rows_from(&self, row: usize) -> Rows<'_> {
        Rows {
            time: self.time.iter_from(row),
            columns: self.columns().map(|c| c.iter_from(row)).collect(),
        }
    }

    /// The readings, then the inputs.
    pub fn columns(&self) -> impl Iterator<Item = &Series> {
        self.readings.iter().chain(&self.inputs)
    }

    /// Whether every number is what it was.
    ///
    /// # Errors
    /// The disk was full, or failed.
    pub fn check(&self) -> Result<(), Error> {
        std::iter::once(&self.time)
            .chain(self.columns())
            .try_for_each(Series::check)
    }

    /// Whether a reading is missing somewhere.
    pub fn have_gaps(&self) -> bool {
        let mut all = self.columns().flatten();
        all.any(|x| !x.is_finite())
    }
}

/// The estimates of a run, and what is known of how good they are.
#[derive(Debug, Default)]
pub struct Course {
    /// by estimate, then by row
    pub estimates: Vec<Series>,
    /// by monitor, then by row
    pub monitors: Vec<Series>,
    /// standard deviations of the estimates
    pub deviations: Option<Vec<Series>>,
    /// estimates given later rows, too
    pub smoothed: Option<Vec<Series>>,
    /// their standard deviations
    pub smoothed_deviations: Option<Vec<Series>>,
    /// how readings and model went together, by sensor; none where it was not followed
    pub sensors: Vec<SensorHealth>,
    /// the same over the last half of the rows
    pub late: Vec<SensorHealth>,
    /// the innovations of each, by stretches
    pub traces: Vec<Trace>,
    /// the same beside what is expected once the start is forgotten
    pub settled: Vec<Trace>,
    /// values of known inputs that were missing, where the last one held
    pub inputs_held: usize,
    /// whether the innovations are kept, row by row
    pub keeps_innovations: bool,
    /// where they are: of each sensor its innovations, then their standard deviations; NaN where it
    /// did not report
    pub innovations: Vec<Series>,
    /// what is kept of a filter's corrections
    pub records: Records,
    /// whether the effective numbers of particles are kept, row by row
    pub keeps_effective: bool,
    /// where they are: one column, or none
    pub effective: Vec<Series>,
    /// how the particles went, and how many there are; of a particle filter
    pub particles: Option<(usize, ParticleHealth)>,
    /// what they are made of, where all is kept
    pub corrections: Option<Corrections>,
    /// ŷ of each sensor before it corrects, where the likelihood is kept
    pub predicted: Vec<Series>,
    /// Σ over the rows of −½(log det 2πS + νᵀS⁻¹ν), where the likelihood is kept
    pub log_likelihood: f64,
    /// what speaks against the estimates beside what is seen in them
    pub doubts: Vec<Doubt>,
    /// what was chosen for the user
    pub notes: Vec<String>,
    /// what of the log contradicts itself, or counts nowhere
    pub warnings: Vec<String>,
    /// why the run ended early, with the rows before
    pub ended: Option<RunError>,
    /// the limit that ended it, where it was one
    pub limit: Option<Spent>,
    /// keeps what is long of the columns
    pub store: Store,
}

impl Course {
    /// Of a run of the observer's own system.
    pub fn of_run(observer: &Observer, run: &Recorded) -> Self {
        let column = |column| run.column(column).cloned().unwrap_or_default();
        let estimates = (0..observer.estimates.len()).map(|i| column(Role::Estimate.at(i)));
        let monitors = (0..observer.monitors.len()).map(|i| column(monitor_column(observer, i)));
        Self {
            estimates: estimates.collect(),
            monitors: monitors.collect(),
            store: run.store.clone(),
            ..Self::default()
        }
    }

    /// So many columns without rows.
    pub fn columns(&self, count: usize) -> Vec<Series> {
        vec![Series::within(&self.store); count]
    }

    /// Whether every number of the columns is what it was.
    ///
    /// # Errors
    /// The disk was full, or failed.
    pub fn check(&self) -> Result<(), Error> {
        self.store.check()
    }

    /// What was found of estimate `i`, to the quantity that it is of.
    pub fn give(&mut self, i: usize, with_deviation: bool, quantity: &mut Quantity) {
        quantity.estimate = self.estimates.get_mut(i).map(std::mem::take);
        let of = |columns: &mut Option<Vec<Series>>| {
            columns
                .as_mut()
                .and_then(|c| c.get_mut(i))
                .map(std::mem::take)
        };
        if with_deviation {
            quantity.deviation = of(&mut self.deviations);
        }
        quantity.smoothed = of(&mut self.smoothed);
        quantity.smoothed_deviation = of(&mut self.smoothed_deviations);
    }
}

/// Adds a row to columns.
pub(crate) fn add_row(columns: &mut [Series], row: impl IntoIterator<Item = f64>) {
    for (column, x) in columns.iter_mut().zip(row) {
        column.push(x);
    }
}
