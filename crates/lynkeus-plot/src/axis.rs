//! An axis for a parameter: where its values lie and where its ticks go.

use std::ops::Range;

/// Ticks that an axis has at most.
const MOST_TICKS: usize = 10;

/// The first digits of ticks on a logarithmic axis, from coarse to fine.
const DIGITS: &[&[f64]] = &[
    &[1.0],
    &[1.0, 3.0],
    &[1.0, 2.0, 5.0],
    &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
    &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
];

/// An axis; places are what is drawn, values what is meant.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// equal ratios are equal distances
    pub is_log: bool,
    /// values at its ends
    pub ends: Range<f64>,
}

impl Axis {
    /// Where a value lies; none where it cannot be shown.
    pub fn place(&self, value: f64) -> Option<f64> {
        let place = if self.is_log { value.ln() } else { value };
        place.is_finite().then_some(place)
    }

    /// The places of the ends.
    pub fn range(&self) -> Range<f64> {
        let place = |x| self.place(x).unwrap_or_default();
        place(self.ends.start)..place(self.ends.end)
    }

    /// Values for ticks, at most ten.
    pub fn ticks(&self) -> Vec<f64> {
        match self.is_log {
            true => self.log_ticks(),
            false => self.linear_ticks(),
        }
    }

    fn log_ticks(&self) -> Vec<f64> {
        let Range { start, end } = self.ends;
        let (low, high) = (start.log10().floor() as i32, end.log10().ceil() as i32);
        let fits = |x: &f64| *x >= start * (1.0 - 1e-9) && *x <= end * (1.0 + 1e-9);
        let with = |digits: &[f64]| -> Vec<f64> {
            let decades = (low..=high).flat_map(|e| digits.iter().map(move |d| scaled(*d, e)));
            decades.filter(fits).collect()
        };
        let all = DIGITS.iter().map(|digits| with(digits));
        let few = all.take_while(|ticks| ticks.len() <= MOST_TICKS).last();
        let Some(ticks) = few else {
            // more than ten decades
            let every = ((high - low) as usize).div_ceil(MOST_TICKS);
            return (low..=high)
                .step_by(every)
                .map(|e| scaled(1.0, e))
                .filter(fits)
                .collect();
        };
        // a range too narrow for round numbers
        if ticks.len() < 3 {
            self.linear_ticks()
        } else {
            ticks
        }
    }

    fn linear_ticks(&self) -> Vec<f64> {
        let Range { start, end } = self.ends;
        let rough = (end - start) / (MOST_TICKS as f64 - 2.0);
        if rough.is_nan() || rough <= 0.0 {
            return vec![start];
        }
        let decade = rough.log10().floor() as i32;
        let steps = [1.0, 2.0, 5.0, 10.0].map(|d| scaled(d, decade));
        let step = steps.into_iter().find(|s| *s >= rough).unwrap_or(rough);
        let first = (start / step - 1e-9).ceil() as i64;
        let last = (end / step + 1e-9).floor() as i64;
        (first..=last).map(|i| i as f64 * step).collect()
    }
}

/// d·10ᵉ, as close as its text.
fn scaled(d: f64, e: i32) -> f64 {
    format!("{d}e{e}").parse().unwrap_or(d * 10_f64.powi(e))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(is_log: bool, ends: Range<f64>) -> Vec<f64> {
        Axis { is_log, ends }.ticks()
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(
            ticks(true, 0.875..14.0),
            [1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0]
        );
        assert_eq!(
            ticks(true, 0.001..1000.0),
            [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0]
        );
        assert_eq!(ticks(true, 1e-12..1e12).len(), 9);
        assert_eq!(ticks(false, 0.0..6.0), [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]);
        assert_eq!(ticks(true, 3.1..3.3).len(), 5);
        assert_eq!(ticks(false, 2.0..2.0), [2.0]);
    }
}
