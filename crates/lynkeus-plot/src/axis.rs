//! Axes: which values they show, where each lies, and where the ticks go.

use std::ops::Range;

use lynkeus_answer::Error;
use lynkeus_expr::real::rounded;

/// Ends of a logarithmic axis of a parameter differ at least by this ratio.
const RATIO: f64 = 2.5;

/// The depth of a logarithmic axis, as a ratio of its greatest value to its least.
const DEEP: f64 = 1e6;

/// The first digits of ticks on a logarithmic axis, from coarse to fine.
const DIGITS: &[&[f64]] = &[
    &[1.0],
    &[1.0, 3.0],
    &[1.0, 2.0, 5.0],
    &[1.0, 1.5, 2.0, 3.0, 5.0, 7.0],
    &[1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 8.0],
];

/// Which values an axis shows.
#[derive(Clone, Debug, Default, PartialEq)]
pub enum Scale {
    /// All of them; upwards the axis is cut where an estimate peaks far beyond the rest ([`Panel::limits`](crate::Panel::limits)).
    #[default]
    Whole,
    /// From zero; cut at eight times the value at [`Mark::Chosen`](crate::Mark::Chosen).
    FromZero,
    /// Positive ones, logarithmically: six decades at most. Of shares of a range: beyond ten times the range an estimate is
    /// lost, how far does not matter.
    Log,
    /// All values of a parameter, logarithmically where they are positive and far apart.
    Parameter,
    /// Those between these.
    Within(Range<f64>),
    /// Rows 0, 1, …, from the top, with their names.
    Rows(Vec<String>),
}

impl Scale {
    /// The axis for such values, from zero to `most` at most; none where there is nothing finite to show.
    pub(super) fn axis<I>(&self, values: impl Fn() -> I, most: Option<f64>) -> Option<Axis>
    where
        I: Iterator<Item = f64>,
    {
        match self {
            Self::Whole => extremes(values())
                .filter(|all| all.end > all.start)
                .map(Axis::linear),
            Self::FromZero => {
                let all = extremes(values())?;
                let top = all.end.min(most.unwrap_or(f64::INFINITY));
                let top = if top > 0.0 { 1.06 * top } else { 1.0 };
                Some(Axis::linear(all.start.min(0.0)..top))
            }
            Self::Log => {
                let top = extremes(values())?.end.min(10.0);
                let low = extremes(values().filter(|v| *v > 0.0 && *v <= top))?.start;
                let low = low.max(top / DEEP).min(top / 10.0);
                Some(Axis::log(low / 1.2..top * 1.2))
            }
            Self::Parameter => Some(parameter(extremes(values())?)),
            Self::Within(ends) => Some(Axis::linear(ends.clone())),
            Self::Rows(names) => Some(Axis {
                rows: names.clone(),
                ..Axis::linear(names.len() as f64 - 0.5..-0.5)
            }),
        }
    }

    /// Refuses ends that are no range.
    pub(super) fn check(&self, name: &str) -> Result<(), Error> {
        match self {
            Self::Within(Range { start, end }) if !(start < end && (end - start).is_finite()) => {
                Err(Error::refused(format!(
                    "nothing to draw over the range of {name}, [{start}, {end}]: declare min and max"
                )))
            }
            _ => Ok(()),
        }
    }
}

fn parameter(ends: Range<f64>) -> Axis {
    if ends.start == ends.end {
        let air = (0.5 * ends.start.abs()).max(1e-3);
        return Axis::linear(ends.start - air..ends.end + air);
    }
    match ends.start > 0.0 && ends.end > RATIO * ends.start {
        true => Axis::log(ends),
        false => Axis::linear(ends),
    }
}

/// An axis with its ends.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Axis {
    /// equal ratios are equal distances
    is_log: bool,
    /// values at its ends
    pub ends: Range<f64>,
    /// names of rows, if it has rows
    rows: Vec<String>,
}

impl Axis {
    pub fn linear(ends: Range<f64>) -> Self {
        Self {
            is_log: false,
            ends,
            rows: vec![],
        }
    }

    fn log(ends: Range<f64>) -> Self {
        Self {
            is_log: true,
            ..Self::linear(ends)
        }
    }

    /// Where a value lies, as a share of the axis; not finite where it cannot be shown.
    pub fn share(&self, value: f64) -> f64 {
        let place = |x: f64| if self.is_log { x.ln() } else { x };
        let (start, end) = (place(self.ends.start), place(self.ends.end));
        (place(value) - start) / (end - start)
    }

    /// Shares with what is written there, as many as asked for at most; rows have all their names.
    pub fn ticks(&self, most: usize) -> Vec<(f64, String)> {
        if !self.rows.is_empty() {
            let rows = self.rows.iter().enumerate();
            let ticks = rows.map(|(row, name)| (self.share(row as f64), name.clone()));
            return ticks.collect();
        }
        let values = self.values(most).into_iter();
        values.map(|x| (self.share(x), number(x))).collect()
    }

    /// Round values.
    fn values(&self, most: usize) -> Vec<f64> {
        match self.is_log {
            true => self.log_ticks(most),
            false => self.linear_ticks(most),
        }
    }

    fn log_ticks(&self, most: usize) -> Vec<f64> {
        let Range { start, end } = self.ends;
        let (low, high) = (start.log10().floor() as i32, end.log10().ceil() as i32);
        let with = |digits: &[f64], every: usize| -> Vec<f64> {
            let decades = (low..=high).step_by(every);
            let all = decades.flat_map(|e| digits.iter().map(move |d| scaled(*d, e)));
            all.filter(|x| *x >= start * (1.0 - 1e-9) && *x <= end * (1.0 + 1e-9))
                .collect()
        };
        let all = DIGITS.iter().map(|digits| with(digits, 1));
        match all.take_while(|ticks| ticks.len() <= most).last() {
            // a range too narrow for round numbers
            Some(ticks) if ticks.len() < 3 => self.linear_ticks(most),
            Some(ticks) => ticks,
            // more decades than ticks
            None => with(&[1.0], ((high - low) as usize).div_ceil(most)),
        }
    }

    /// Multiples of the finest 1, 2 or 5 times a power of ten that are not too many.
    fn linear_ticks(&self, most: usize) -> Vec<f64> {
        let Range { start, end } = self.ends;
        let decade = (end - start).log10().floor();
        if !decade.is_finite() {
            return vec![start];
        }
        let steps = (-2..=1).rev().flat_map(|e| {
            let step = move |d| scaled(d, decade as i32 + e);
            [5.0, 2.0, 1.0].map(step)
        });
        let multiples = |step: f64| {
            let first = (start / step - 1e-9).ceil() as i64;
            let last = (end / step + 1e-9).floor() as i64;
            (first..=last).map(move |i| i as f64 * step)
        };
        let fitting = steps.take_while(|step| multiples(*step).count() <= most);
        fitting
            .last()
            .map_or(vec![], |step| multiples(step).collect())
    }
}

/// d·10ᵉ, as close as its text.
fn scaled(d: f64, e: i32) -> f64 {
    format!("{d}e{e}").parse().unwrap_or(d * 10_f64.powi(e))
}

/// A tick's number without the dust of binary fractions.
pub(super) fn number(value: f64) -> String {
    let value = rounded(value, 9);
    if value == 0.0 {
        return "0".to_owned();
    }
    match value.abs() {
        1e-4..1e6 => format!("{value}").replace('-', "\u{2212}"),
        _ => format!("{value:e}").replace('-', "\u{2212}"),
    }
}

/// The least and the greatest of the finite values.
pub(super) fn extremes(values: impl Iterator<Item = f64>) -> Option<Range<f64>> {
    values.filter(|v| v.is_finite()).fold(None, |range, v| {
        Some(range.map_or(v..v, |r: Range<f64>| r.start.min(v)..r.end.max(v)))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn ticks(axis: Axis) -> Vec<f64> {
        axis.values(10)
    }

    #[test]
    fn ticks_are_round_and_few() {
        assert_eq!(
            ticks(Axis::log(0.875..14.0)),
            [1.0, 1.5, 2.0, 3.0, 5.0, 7.0, 10.0]
        );
        assert_eq!(
            ticks(Axis::log(0.001..1000.0)),
            [1e-3, 1e-2, 0.1, 1.0, 10.0, 100.0, 1000.0]
        );
        assert_eq!(ticks(Axis::log(1e-12..1e12)).len(), 9);
        assert_eq!(
            ticks(Axis::linear(0.0..6.0)),
            [0.0, 1.0, 2.0, 3.0, 4.0, 5.0, 6.0]
        );
        assert_eq!(ticks(Axis::log(3.1..3.3)).len(), 5);
        assert_eq!(ticks(Axis::linear(2.0..2.0)), [2.0]);
    }

    #[test]
    fn numbers_are_plain() {
        assert_eq!(number(0.300_000_000_000_000_04), "0.3");
        assert_eq!(number(-2.0), "\u{2212}2");
        assert_eq!(number(1e7), "1e7");
        assert_eq!(number(0.0), "0");
    }

    #[test]
    fn a_parameter_has_room_and_ratios() {
        let of = |values: &[f64]| Scale::Parameter.axis(|| values.iter().copied(), None);
        assert_eq!(of(&[1.0, 3.0]), Some(Axis::log(1.0..3.0)));
        assert_eq!(of(&[1.0, 2.0]), Some(Axis::linear(1.0..2.0)));
        assert_eq!(of(&[4.0]), Some(Axis::linear(2.0..6.0)));
        assert_eq!(of(&[f64::NAN]), None);
    }

    #[test]
    fn a_logarithmic_axis_has_a_floor() {
        let of = |values: &[f64]| Scale::Log.axis(|| values.iter().copied(), None);
        let axis = of(&[0.1, 1e-15, 0.0, 1e9]).unwrap();
        assert!((axis.ends.start - 1e-5 / 1.2).abs() < 1e-9, "{axis:?}");
        assert_eq!(axis.ends.end, 12.0);
        assert_eq!(of(&[0.0]), None);
    }
}
