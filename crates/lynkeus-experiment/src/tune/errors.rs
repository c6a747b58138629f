//! Errors of an estimate over time, each as a share of its quantity's scale, and what is read off them.

use crate::judge::RUN_AWAY;
use crate::judge::accuracy::settled_from;

/// Scaled errors: estimate minus truth, divided by the quantity's scale.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Errors {
    /// times of the rows
    pub time: Vec<f64>,
    /// by quantity, then by row
    pub scaled: Vec<Vec<f64>>,
}

impl Errors {
    /// The largest magnitude over the quantities, by row.
    pub fn worst(&self) -> Vec<f64> {
        let worst = |row: usize| {
            let values = self.scaled.iter().filter_map(|errors| errors.get(row));
            values.fold(0.0, |m: f64, e| m.max(e.abs()))
        };
        (0..self.time.len()).map(worst).collect()
    }

    /// The mean magnitude over quantities and time (trapezoidal over the rows).
    pub fn mean(&self) -> f64 {
        let span = match (self.time.first(), self.time.last()) {
            (Some(from), Some(to)) if to > from => to - from,
            _ => return 0.0,
        };
        let area = |errors: &Vec<f64>| -> f64 {
            let steps = self.time.windows(2).zip(errors.windows(2));
            steps
                .map(|(t, e)| (t[1] - t[0]) * (e[0].abs() + e[1].abs()) / 2.0)
                .sum()
        };
        let areas: f64 = self.scaled.iter().map(area).sum();
        areas / span / self.scaled.len().max(1) as f64
    }

    /// The longest time, counted from each of `starts`, until every error stays within
    /// `tolerance` up to the next of them; none if it does not before one of them or the end.
    pub fn settling(&self, starts: &[f64], tolerance: f64) -> Option<f64> {
        let worst = self.worst();
        let mut longest: f64 = 0.0;
        for (i, &start) in starts.iter().enumerate() {
            let end = starts.get(i + 1).copied().unwrap_or(f64::INFINITY);
            // the row at a jump shows the error that the jump makes
            let rows = self.time.iter().copied().zip(worst.iter().copied());
            let mut rows = rows.filter(|(t, _)| *t >= start && *t < end).peekable();
            let Some((first, _)) = rows.peek().copied() else {
                continue;
            };
            let settled = settled_from(rows, tolerance)?;
            // before its first row nothing was seen to be wrong
            if settled > first {
                longest = longest.max(settled - start);
            }
        }
        Some(longest)
    }

    /// Row and quantity of the largest error after the first row, with its magnitude.
    pub fn peak(&self) -> Option<(usize, usize, f64)> {
        let all = self
            .scaled
            .iter()
            .enumerate()
            .flat_map(|(quantity, errors)| {
                let rows = errors.iter().enumerate().skip(1);
                rows.map(move |(row, e)| (row, quantity, e.abs()))
            });
        let known = all.filter(|(.., e)| !e.is_nan());
        known.max_by(|a, b| a.2.total_cmp(&b.2))
    }

    /// The largest magnitude; none without rows.
    pub fn largest(&self) -> Option<f64> {
        self.worst().into_iter().max_by(f64::total_cmp)
    }

    /// What makes the difference to `other`, which has the same rows.
    pub fn minus(&self, other: &Self) -> Self {
        let pairs = self.scaled.iter().zip(&other.scaled);
        let difference =
            |(a, b): (&Vec<f64>, &Vec<f64>)| a.iter().zip(b).map(|(a, b)| a - b).collect();
        Self {
            time: self.time.clone(),
            scaled: pairs.map(difference).collect(),
        }
    }

    /// The rows from `time` on.
    pub fn from(&self, time: f64) -> Self {
        let first = self.time.partition_point(|t| *t < time);
        let first = first.min(self.time.len().saturating_sub(1));
        let tail = |values: &Vec<f64>| values.get(first..).unwrap_or_default().to_vec();
        Self {
            time: tail(&self.time),
            scaled: self.scaled.iter().map(tail).collect(),
        }
    }

    /// The largest root mean square over time of any quantity.
    pub fn worst_rms(&self) -> f64 {
        self.scaled.iter().map(|e| rms(e)).fold(0.0, f64::max)
    }
}

/// Why errors, by quantity, are those of no estimate: it ends too far away.
pub(super) fn run_away(scaled: &[Vec<f64>]) -> Option<String> {
    let ends = scaled.iter().filter_map(|errors| errors.last());
    let end = ends.fold(0.0, |m: f64, e| m.max(e.abs()));
    (end > RUN_AWAY)
        .then(|| format!("the estimate runs away: its error ends at {end:.1e} times the range"))
}

/// √(mean x²).
pub(super) fn rms(values: &[f64]) -> f64 {
    let squares: f64 = values.iter().map(|x| x * x).sum();
    (squares / values.len().max(1) as f64).sqrt()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two quantities; the first decays from 1 after t = 0 and after t = 5, the second stays at 0.01.
    fn decays() -> Errors {
        let time: Vec<f64> = (0..100).map(|i| f64::from(i) / 10.0).collect();
        let decay = |t: &f64| (-(t % 5.0) * 2.0).exp();
        Errors {
            scaled: vec![time.iter().map(decay).collect(), vec![-0.01; 100]],
            time,
        }
    }

    #[test]
    fn settling_is_counted_from_each_jump() {
        let errors = decays();
        // exp(−2 t) = 0.05 at t = 1.498
        let settled = errors.settling(&[0.0, 5.0], 0.05).unwrap();
        assert!((settled - 1.5).abs() < 1e-9, "{settled}");
        let whole = errors.settling(&[0.0], 0.05).unwrap();
        assert!((whole - 6.5).abs() < 1e-9, "{whole}");
        assert_eq!(errors.settling(&[0.0], 0.005), None);
        assert_eq!(
            errors.settling(&[0.0, 1.0, 5.0], 0.05),
            None,
            "not before t = 1"
        );
    }

    #[test]
    fn a_peak_is_no_run_away_and_an_end_is() {
        let ends = |values: [f64; 3]| run_away(&[vec![0.0; 3], values.to_vec()]).is_some();
        assert!(!ends([1e9, 1e9, -100.0]) && ends([0.0, 0.0, -101.0]));
    }

    #[test]
    fn peak_mean_and_tail() {
        let errors = decays();
        assert_eq!(errors.peak(), Some((50, 0, 1.0)));
        // ∫exp(−2 t) over [0, 5) is 1/2, twice, over 2 quantities and 10 units of time
        assert!(
            (errors.mean() - (0.05 + 0.005)).abs() < 5e-3,
            "{}",
            errors.mean()
        );
        assert_eq!(errors.from(9.0).time.len(), 10);
        assert_eq!(errors.from(99.0).time.len(), 1);
        assert_eq!(errors.minus(&errors).mean(), 0.0);
        assert!((errors.from(4.0).worst()[10] - 1.0).abs() < 1e-12);
        assert!((rms(&[3.0, -4.0]) - 12.5_f64.sqrt()).abs() < 1e-12);
    }
}
