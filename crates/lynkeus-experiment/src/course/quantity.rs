//! What is known of one quantity over a run.

use crate::Series;

/// One quantity of the result with everything that is known of it.
#[derive(Clone, Debug, Default)]
pub struct Quantity {
    /// name in the plant
    pub name: String,
    /// unit, if declared
    pub unit: Option<String>,
    /// description, if declared
    pub description: Option<String>,
    /// what it truly is: simulated, or logged although it is not used
    pub truth: Option<Series>,
    /// what the sensor reads
    pub measured: Option<Series>,
    /// the measured output that shows it, where that has another name
    pub sensor: Option<String>,
    /// what the observer makes of it
    pub estimate: Option<Series>,
    /// what the estimate says of a measured output that is no state
    pub expected: Option<Series>,
    /// its standard deviation, where it is asked for
    pub deviation: Option<Series>,
    /// the estimate given later rows, too
    pub smoothed: Option<Series>,
    /// the standard deviation of that, where it is asked for
    pub smoothed_deviation: Option<Series>,
    /// header of the estimate's column: `<name>_hat` unless the model has that name
    pub estimate_header: String,
    /// header of the standard deviation's column
    pub deviation_header: String,
    /// header of the column of the estimate given later rows
    pub smoothed_header: String,
    /// header of the column of its standard deviation
    pub smoothed_deviation_header: String,
    /// an input that nobody measures
    pub unknown_input: bool,
    /// an input of the plant
    pub is_input: bool,
}

impl Quantity {
    /// √(mean (estimate − truth)²) over the last half of the rows, where the truth is known; none
    /// where it is not.
    pub fn settled_error(&self) -> Option<f64> {
        let (truth, estimate) = (self.truth.as_ref()?, self.estimate.as_ref()?);
        settled_error(truth.iter().zip(estimate))
    }
}

/// √(mean (estimate − truth)²) over the last half of the rows; rows without a value count nowhere.
pub(crate) fn settled_error(pairs: impl ExactSizeIterator<Item = (f64, f64)>) -> Option<f64> {
    let half = pairs.len() / 2;
    let squares = pairs.skip(half).map(|(x, hat)| (hat - x).powi(2));
    let known = squares.filter(|e| e.is_finite());
    let (sum, count) = known.fold((0.0, 0.0), |(sum, count), e| (sum + e, count + 1.0));
    (count > 0.0).then(|| (sum / count).sqrt())
}
