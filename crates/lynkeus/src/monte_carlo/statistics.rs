//! Means, quantiles and the worst of many runs.

use super::{Bands, Series};
use crate::quantity::settled_error;

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
}

/// Of the quantity at a place of every run.
pub(super) fn of_runs(runs: &[Vec<Series>], place: usize) -> Found {
    let own: Vec<&Series> = runs.iter().filter_map(|run| run.get(place)).collect();
    let rows = own.first().map_or(0, |series| series.truth.len());
    let (mut truth, mut error) = (Bands::default(), Bands::default());
    let mut error_worst = Vec::with_capacity(rows);
    let mut values = Vec::with_capacity(own.len());
    for row in 0..rows {
        gather(&mut values, own.iter().map(|s| s.truth[row]));
        truth.add(&mut values);
        gather(&mut values, own.iter().map(|s| s.error(row)));
        let worst = values.iter().map(|e| e.abs()).reduce(f64::max);
        error_worst.push(worst.unwrap_or(f64::NAN));
        error.add(&mut values);
    }
    let rms: Vec<f64> = own
        .iter()
        .map(|s| {
            let pairs = s.truth.iter().copied().zip(s.estimate.iter().copied());
            settled_error(pairs).unwrap_or(f64::NAN)
        })
        .collect();
    let worst_run = (0..rms.len()).max_by(|a, b| rms[*a].total_cmp(&rms[*b]).then(b.cmp(a)));
    let worst_run = worst_run.unwrap_or(0);
    let worst = own
        .get(worst_run)
        .map(|s| (0..rows).map(|row| s.error(row)));
    Found {
        truth,
        error,
        error_worst,
        worst_run,
        worst_course: worst.map_or(vec![], Iterator::collect),
        rms,
    }
}

fn gather(values: &mut Vec<f64>, of: impl Iterator<Item = f64>) {
    values.clear();
    values.extend(of.filter(|x| x.is_finite()));
}

impl Series {
    fn error(&self, row: usize) -> f64 {
        self.estimate
            .get(row)
            .map_or(f64::NAN, |hat| hat - self.truth[row])
    }
}

impl Bands {
    /// One more row, of these values.
    fn add(&mut self, values: &mut [f64]) {
        self.mean.push(mean(values));
        values.sort_unstable_by(f64::total_cmp);
        self.low.push(quantile(values, LOW));
        self.high.push(quantile(values, HIGH));
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
        }
        assert_eq!(quantile(&[3.0], 0.95), 3.0);
        assert!(quantile(&[], 0.5).is_nan());
    }

    #[test]
    fn the_worst_error_has_no_sign_and_a_gap_counts_nowhere() {
        let series = |estimate: [f64; 2]| {
            vec![Series {
                truth: vec![1.0, 1.0],
                estimate: estimate.to_vec(),
            }]
        };
        let runs = [
            series([-4.0, 2.0]),
            series([3.0, f64::NAN]),
            series([1.0, 0.5]),
        ];
        let found = of_runs(&runs, 0);
        assert_eq!(found.error_worst, [5.0, 1.0]);
        assert_eq!(found.error.mean, [-1.0, 0.25]);
        assert_eq!(found.truth.mean, [1.0, 1.0]);
        assert_eq!((found.rms[0], found.rms[2]), (1.0, 0.5));
    }
}
