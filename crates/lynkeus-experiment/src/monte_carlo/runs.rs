//! What one run gives, and what many give.

use lynkeus_run::Column;

use crate::Coverage;
use lynkeus_study::Name;

/// What many runs of a study give.
#[derive(Clone, Debug)]
pub struct MonteCarlo {
    /// Name of the plant.
    pub plant: String,
    /// The family of the observer.
    pub family: &'static str,
    /// The study, for messages.
    pub file: String,
    /// How many runs were asked for.
    pub asked: usize,
    /// The seeds of the runs that reached the end, increasing: the figures are of these.
    pub seeds: Vec<u64>,
    /// The runs that did not, in the order of their seeds.
    pub failures: Vec<Failure>,
    /// Those among `seeds` whose estimates are not credible.
    pub doubtful: Vec<Failure>,
    /// What a limit of time or memory left undone, in words.
    pub limit: Option<String>,
    /// What repeats one of the runs.
    pub again: Again,
    /// Times of the rows.
    pub time: Vec<f64>,
    /// Header of their column.
    pub time_header: String,
    /// Everything that is estimated and whose true course is known.
    pub quantities: Vec<Scattered>,
    /// The unit of time, where the study has one.
    pub time_unit: Option<String>,
    /// The quantities that the picture shows, where the study says so.
    pub show: Option<Vec<Name>>,
    /// What the user should know.
    pub notes: Vec<String>,
}

/// What repeats one of many runs to the last digit.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Again {
    /// [`simulate`](crate::simulate()) with its seed.
    Alone,
    /// [`monte_carlo`](crate::monte_carlo()) of this seed alone: exp, sin and the like are those of
    /// [`lanes`](lynkeus_expr::lanes), which [`simulate`](crate::simulate()) rounds otherwise.
    InABatch,
}

/// A run that did not reach its end, or whose estimate is not credible.
#[derive(Clone, Debug, PartialEq)]
pub struct Failure {
    /// Its seed.
    pub seed: u64,
    /// Why.
    pub reason: String,
}

/// One quantity over all runs.
#[derive(Clone, Debug)]
pub struct Scattered {
    /// Its name in the plant.
    pub name: String,
    /// Its unit, if declared.
    pub unit: Option<String>,
    /// Its description, if declared.
    pub description: Option<String>,
    /// An input that nobody measures.
    pub unknown_input: bool,
    /// A sensor shows it.
    pub is_measured: bool,
    /// What it truly is.
    pub truth: Bands,
    /// Estimate − truth.
    pub error: Bands,
    /// The largest |error| of all runs, row by row.
    pub error_worst: Vec<f64>,
    /// √(mean error²) over the last half of the rows, by run, in the order of the seeds.
    pub rms: Vec<f64>,
    /// The run with the greatest of these, by its place among the seeds.
    pub worst_run: usize,
    /// The error of that run; NaN from where a limit ended its repetition.
    pub worst_course: Vec<f64>,
    /// Errors beside the standard deviations told, over the last half of the rows of all runs; none where
    /// there are no deviations.
    pub coverage: Option<Coverage>,
    /// Headers of its columns: mean and quantiles of truth and error, then the largest |error|.
    pub headers: [String; 7],
}

/// How a value scatters over the runs, row by row; NaN where no run has a value.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Bands {
    /// The mean.
    pub mean: Vec<f64>,
    /// The 5 % quantile.
    pub low: Vec<f64>,
    /// The 95 % quantile.
    pub high: Vec<f64>,
}

/// What is followed: an estimate by its place, beside the column of its true value.
#[derive(Clone, Debug)]
pub(super) struct Followed {
    pub estimate: usize,
    pub truth: Column,
    /// of a quaternion as a whole: its name, and the columns of its true numbers, which begin there
    pub rotation: Option<(String, [Column; 4])>,
}

/// True course and estimate of one quantity in one run.
#[derive(Clone, Debug, Default)]
pub(super) struct Track {
    pub truth: Vec<f64>,
    pub estimate: Vec<f64>,
    /// its errors beside the deviations told
    pub coverage: Option<Coverage>,
}

/// A run that reached its end.
#[derive(Debug)]
pub(super) struct Whole {
    /// by quantity
    pub tracks: Vec<Track>,
    /// readings at an end, by sensor with limits
    pub at_ends: Vec<usize>,
    /// why its estimate is not credible, where it is not
    pub doubt: Option<String>,
}
