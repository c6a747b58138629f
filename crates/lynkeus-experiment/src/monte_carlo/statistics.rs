//! Means, quantiles and the worst of many runs.

use super::runs::{Bands, Track, Whole};
use crate::Coverage;

/// The quantiles that a band reaches over.
const LOW: f64 = 0.05;
pub(super) const HIGH: f64 = 0.95;

/// What the runs say of one quantity.
pub(super) struct Found {
    pub truth: Bands,
    pub error: Bands,
    pub error_worst: Vec<f64>,
    pub rms: Vec<f64>,
    pub worst_run: usize,
    pub worst_course: Vec<f64>,
    pub coverage: Option<Coverage>,
}

/// What is made of one quantity, row after row.
pub(super) trait Keep: Send {
    /// One more row: true value and estimate of every run.
    fn add(&mut self, pairs: impl Iterator<Item = (f64, f64)>, is_late: bool);
}

/// All rows of every run.
impl Keep for Vec<Track> {
    fn add(&mut self, pairs: impl Iterator<Item = (f64, f64)>, _: bool) {
        for (tracks, (truth, estimate)) in self.iter_mut().zip(pairs) {
            tracks.truth.push(truth);
            tracks.estimate.push(estimate);
        }
    }
}

/// Of the quantity at a place of every run.
pub(super) fn of_runs(runs: &[Whole], place: usize) -> Found {
    let own = runs.iter().filter_map(|run| run.tracks.get(place));
    let own: Vec<&Track> = own.collect();
    let rows = own.first().map_or(0, |track| track.truth.len());
    let mut scatter = Scatter::new(own.len());
    for row in 0..rows {
        let pairs = own.iter().map(|s| (s.truth[row], s.estimate(row)));
        scatter.add(pairs, row >= rows / 2);
    }
    let mut found = scatter.found(rows);
    if let Some(worst) = own.get(found.worst_run) {
        let errors = (0..rows).map(|row| worst.estimate(row) - worst.truth[row]);
        found.worst_course.extend(errors);
    }
    found.coverage = Coverage::of_all(own.iter().filter_map(|track| track.coverage));
    found
}

/// A quantity over all runs, row after row.
#[derive(Clone, Debug)]
pub(super) struct Scatter {
    truth: Bands,
    error: Bands,
    error_worst: Vec<f64>,
    /// sums of the squared errors over the last half of the rows, by run
    squares: Vec<f64>,
    values: Vec<f64>,
    errors: Vec<f64>,
}

impl Scatter {
    /// Of so many runs.
    pub fn new(runs: usize) -> Self {
        Self {
            truth: Bands::default(),
            error: Bands::default(),
            error_worst: vec![],
            squares: vec![0.0; runs],
            values: Vec::with_capacity(runs),
            errors: Vec::with_capacity(runs),
        }
    }

    /// What the rows say, but for the course of the worst run.
    pub fn found(self, rows: usize) -> Found {
        let late = (rows - rows / 2).max(1) as f64;
        let rms: Vec<f64> = self.squares.iter().map(|s| (s / late).sqrt()).collect();
        let worst = (0..rms.len()).max_by(|a, b| rms[*a].total_cmp(&rms[*b]).then(b.cmp(a)));
        Found {
            truth: self.truth,
            error: self.error,
            error_worst: self.error_worst,
            worst_run: worst.unwrap_or(0),
            worst_course: vec![],
            coverage: None,
            rms,
        }
    }
}

impl Keep for Scatter {
    fn add(&mut self, pairs: impl Iterator<Item = (f64, f64)>, is_late: bool) {
        self.values.clear();
        self.errors.clear();
        for ((truth, estimate), square) in pairs.zip(&mut self.squares) {
            let error = estimate - truth;
            self.values.extend(Some(truth).filter(|x| x.is_finite()));
            self.errors.extend(Some(error).filter(|x| x.is_finite()));
            if is_late {
                *square += error.powi(2);
            }
        }
        let worst = self.errors.iter().map(|e| e.abs()).reduce(f64::max);
        self.error_worst.push(worst.unwrap_or(f64::NAN));
        self.truth.add(&mut self.values);
        self.error.add(&mut self.errors);
    }
}

impl Track {
    fn estimate(&self, row: usize) -> f64 {
        self.estimate.get(row).copied().unwrap_or(f64::NAN)
    }
}

impl Bands {
    /// One more row, of these values.
    fn add(&mut self, values: &mut [f64]) {
        self.mean.push(mean(values));
        self.low.push(selected(values, LOW));
        self.high.push(selected(values, HIGH));
    }
}

/// The mean; NaN of nothing.
pub(super) fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len() as f64
}

/// The quantile of sorted values, linear between the two beside it (the definition 7 of
/// Hyndman and Fan, as NumPy's); NaN of nothing.
pub(super) fn quantile(sorted: &[f64], share: f64) -> f64 {
    let Some(last) = sorted.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = share * last as f64;
    let below = place.floor();
    let (low, high) = (below as usize, (below as usize + 1).min(last));
    sorted[low] + (place - below) * (sorted[high] - sorted[low])
}

/// The [`quantile`] of values in any order, which change places.
fn selected(values: &mut [f64], share: f64) -> f64 {
    let Some(last) = values.len().checked_sub(1) else {
        return f64::NAN;
    };
    let place = share * last as f64;
    let below = place.floor();
    let (_, low, above) = values.select_nth_unstable_by(below as usize, f64::total_cmp);
    let next = above.iter().copied().min_by(f64::total_cmp);
    *low + (place - below) * (next.unwrap_or(*low) - *low)
}

#[cfg(test)]
mod tests {
    use super::*;

    /// `numpy.quantile([1, 2, 4, 8], [0.05, 0.5, 0.95])`
    #[test]
    fn quantiles_lie_between_their_neighbours() {
        let sorted = [1.0, 2.0, 4.0, 8.0];
        for (share, expected) in [
            (0.0, 1.0),
            (0.05, 1.15),
            (0.5, 3.0),
            (0.95, 7.4),
            (1.0, 8.0),
        ] {
            let found = quantile(&sorted, share);
            assert!((found - expected).abs() < 1e-12, "{share}: {found}");
            assert_eq!(selected(&mut [4.0, 1.0, 8.0, 2.0], share), found);
        }
        assert_eq!(quantile(&[3.0], 0.95), 3.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn the_worst_error_has_no_sign_and_a_gap_counts_nowhere() {
        let track = |estimate: [f64; 2]| Whole {
            tracks: vec![Track {
                truth: vec![1.0, 1.0],
                estimate: estimate.to_vec(),
                coverage: None,
            }],
            at_ends: vec![],
            doubt: None,
        };
        let runs = [
            track([-4.0, 2.0]),
            track([3.0, f64::NAN]),
            track([1.0, 0.5]),
        ];
        let found = of_runs(&runs, 0);
        assert_eq!(found.error_worst, [5.0, 1.0]);
        assert_eq!(found.error.mean, [-1.0, 0.25]);
        assert_eq!(found.truth.mean, [1.0, 1.0]);
        assert_eq!((found.rms[0], found.rms[2]), (1.0, 0.5));
    }
}
