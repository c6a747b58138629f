//! What a value is judged by.

use lynkeus_expr::real::rounded;

/// One figure of every row.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Measure {
    /// Its name in tables and JSON.
    pub name: &'static str,
    /// What it is, for people.
    pub title: &'static str,
    /// It is a time.
    pub is_time: bool,
    /// Significant digits that are shown.
    pub digits: usize,
}

const fn measure(name: &'static str, title: &'static str) -> Measure {
    Measure {
        name,
        title,
        is_time: false,
        digits: 3,
    }
}

impl Measure {
    /// A figure in its digits.
    pub fn shown(&self, x: f64) -> String {
        brief(x, self.digits)
    }
}

/// So many significant digits.
pub(crate) fn brief(x: f64, digits: usize) -> String {
    let rounded = rounded(x, digits);
    match rounded.abs() {
        1e5.. => format!("{rounded:e}"),
        y if y > 0.0 && y < 1e-4 => format!("{rounded:e}"),
        _ => format!("{rounded}"),
    }
}

/// The figures of a sweep in simulation, of filters or of observers.
pub(super) fn simulated(is_filters: bool) -> &'static [Measure] {
    match is_filters {
        // they correct nothing between samples
        true => &SIMULATED[..SAMPLING_MARGIN],
        false => SIMULATED,
    }
}

/// The figures of a sweep in simulation: the last is that of observers.
const SIMULATED: &[Measure] = &[
    measure("mean_error", "mean error, noise included"),
    measure("mean_error_exact", "mean error without noise"),
    measure("mean_error_noise", "mean error that the noise makes"),
    Measure {
        is_time: true,
        ..measure("settling_time", "settling time")
    },
    measure("peak_error", "peak error"),
    measure("noise_gain", "noise gain"),
    measure("ultimate_bound", "ultimate bound"),
    measure("sampling_margin", "longest stable step / sampling step"),
];

pub(super) const TOTAL_ERROR: usize = 0;
pub(super) const EXACT_ERROR: usize = 1;
pub(super) const NOISE_ERROR: usize = 2;
pub(super) const SETTLING_TIME: usize = 3;
pub(super) const PEAK_ERROR: usize = 4;
pub(super) const NOISE_GAIN: usize = 5;
pub(super) const ULTIMATE_BOUND: usize = 6;
pub(super) const SAMPLING_MARGIN: usize = 7;

/// What decides of filters on a log; of many readings small differences tell.
pub(super) const LIKELIHOOD: Measure = Measure {
    digits: 6,
    ..measure("nll_per_reading", "\u{2212}log likelihood per reading")
};

/// The figures of a sweep on a log: the first is that of filters, the last that of observers.
const LOGGED: &[Measure] = &[
    LIKELIHOOD,
    measure("held_out_error", "error on held-out samples"),
    measure("innovation", "innovation, root mean square"),
    measure("ljung_box", "Ljung–Box statistic per lag (white: 1)"),
    measure("outside_band", "autocorrelations outside the 95 % band"),
    measure("sampling_margin", "longest stable step / step of the log"),
];

/// The figures of a sweep on a log, of filters or of observers.
pub(super) fn of_log(is_filters: bool) -> &'static [Measure] {
    match is_filters {
        true => &LOGGED[..5],
        false => &LOGGED[1..],
    }
}

/// The figure that is made least: the first of each list.
pub(super) const OBJECTIVE: usize = 0;
/// That of filters where likelihoods are of different readings.
pub(super) const FILTERS_HELD_OUT: usize = 1;

/// The figures of a row as entries: those of both lists. A test holds them together.
#[cfg(any(test, feature = "schema"))]
#[derive(schemars::JsonSchema)]
#[allow(dead_code)]
pub(super) struct Figures {
    /// mean error, noise included; in simulation
    mean_error: Option<f64>,
    /// mean error without noise
    mean_error_exact: Option<f64>,
    /// mean error that the noise makes
    mean_error_noise: Option<f64>,
    /// the time from which on the error is small
    settling_time: Option<f64>,
    /// the largest error
    peak_error: Option<f64>,
    /// noise of the estimates beside that of the sensors
    noise_gain: Option<f64>,
    /// the error in the end under `disturbance`
    ultimate_bound: Option<f64>,
    /// the longest stable step beside the step of the samples
    sampling_margin: Option<f64>,
    /// −log of the likelihood of the innovations, over the number of readings that count; of filters on a log
    nll_per_reading: Option<f64>,
    /// error on samples that were held out; on a log
    held_out_error: Option<f64>,
    /// innovation, root mean square
    innovation: Option<f64>,
    /// Ljung–Box statistic per lag; of white innovations 1
    ljung_box: Option<f64>,
    /// share of autocorrelations outside of the 95 % band
    outside_band: Option<f64>,
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeSet;

    use super::*;

    #[test]
    fn every_measure_is_an_entry_of_the_schema() {
        let schema = schemars::schema_for!(Figures);
        let entries = schema.as_object().unwrap()["properties"].as_object();
        let entries: BTreeSet<&str> = entries.unwrap().keys().map(String::as_str).collect();
        let measures = SIMULATED.iter().chain(LOGGED).map(|measure| measure.name);
        assert_eq!(entries, measures.collect());
    }
}
