//! How well an estimate foretells the log that it runs on: what can be said of it where no truth is known.

use serde::Serialize;

/// How well an estimate foretells the log that it runs on; what there is no figure of is none.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Foretold {
    /// −log of the likelihood of the innovations, over the number of readings that count; of filters
    pub nll_per_reading: Option<f64>,
    /// readings that count in it: those that corrected, and those at a limit of their sensor
    pub readings: Option<usize>,
    /// root mean square error of the prediction on samples that were held out, over the span of the output
    pub held_out_error: Option<f64>,
    /// root mean square of the innovations, over the span of the output
    pub innovation: Option<f64>,
    /// Ljung–Box statistic of the innovations per lag; of white ones 1
    pub ljung_box: Option<f64>,
    /// share of their autocorrelations outside of the 95 % band
    pub outside_band: Option<f64>,
}
