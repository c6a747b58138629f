//! Isolation of the switches of one mode on a stretch where its argument is smooth.

use lynkeus_expr::Interval;

use super::effort::{DOUBTFUL, Effort};
use super::indicator::{Indicator, ORDER};
use super::timeline::{apart, same};
use crate::Error;

/// The sweep over one stretch, from left to right.
pub(super) struct Isolation<'a> {
    indicator: &'a mut Indicator,
    effort: &'a mut Effort,
    start: f64,
    end: f64,
    /// the last time at which the mode was certain, and the mode there
    certain: Option<(f64, f64)>,
    instants: Vec<f64>,
}

/// What is known of a cell.
enum Cell {
    /// the mode stays
    Constant,
    /// the quantity is monotone between these times, ends included
    Monotone(Vec<f64>),
    Unknown,
}

impl<'a> Isolation<'a> {
    pub(super) fn new(
        indicator: &'a mut Indicator,
        start: f64,
        end: f64,
        effort: &'a mut Effort,
    ) -> Self {
        Self {
            indicator,
            effort,
            start,
            end,
            certain: None,
            instants: vec![],
        }
    }

    /// The instants strictly inside, increasing.
    pub(super) fn run(mut self) -> Result<Vec<f64>, Error> {
        let mut cells = vec![(self.start, self.end)];
        while let Some((a, b)) = cells.pop() {
            self.effort.look(a, self.indicator.expression())?;
            match self.cell(a, b) {
                Cell::Constant => self.settle(a + 0.5 * (b - a), a)?,
                Cell::Monotone(times) => {
                    for pair in times.windows(2) {
                        self.monotone(pair[0], pair[1])?;
                    }
                }
                Cell::Unknown if self.is_hidden(a, b)? => {
                    if self.is_certain(b) {
                        self.arrive(b)?;
                    }
                }
                Cell::Unknown => {
                    let middle = a + 0.5 * (b - a);
                    cells.extend([(middle, b), (a, middle)]);
                }
            }
        }
        Ok(self.instants)
    }

    fn cell(&self, a: f64, b: f64) -> Cell {
        let stretch = interval(a, b);
        if self.indicator.is_constant(stretch) {
            return Cell::Constant;
        }
        let slope = self.indicator.series::<2>(stretch)[1];
        if slope == Interval::ZERO {
            return Cell::Constant;
        }
        if slope.is_defined() && keeps_sign(slope) {
            return Cell::Monotone(vec![a, b]);
        }
        if slope.is_defined() && self.excluded(a, b, slope) {
            return Cell::Constant;
        }
        let series = self.indicator.series::<{ ORDER + 1 }>(stretch);
        let defined = series.iter().take_while(|c| c.is_defined()).count();
        let order = (2..defined).find(|&k| keeps_sign(series[k]));
        order.map_or(Cell::Unknown, |k| Cell::Monotone(self.parts(a, b, k)))
    }

    /// Whether the mean value form, with the derivative enclosed in `slope`, shows
    /// that the mode stays.
    fn excluded(&self, a: f64, b: f64, slope: Interval) -> bool {
        let middle = a + 0.5 * (b - a);
        let offset = interval(a, b) - Interval::point(middle);
        let [value] = self.indicator.series::<1>(Interval::point(middle));
        self.indicator.decides(value + slope * offset)
    }

    /// The ends and the extrema between them where derivative `order` keeps its sign:
    /// derivative k is monotone between the zeros of derivative k + 1.
    fn parts(&self, a: f64, b: f64, order: usize) -> Vec<f64> {
        debug_assert!(order <= ORDER);
        let mut times = vec![a, b];
        for k in (1..order).rev() {
            let zeros = times
                .windows(2)
                .filter_map(|pair| self.zero(k, pair[0], pair[1]));
            let zeros: Vec<f64> = zeros.collect();
            times.extend(zeros);
            times.sort_unstable_by(f64::total_cmp);
            times.dedup();
        }
        times
    }

    /// The zero of derivative `k`, monotone in [a, b], by regula falsi (Illinois). It
    /// ends early: near an extremum the function itself is flat.
    fn zero(&self, k: usize, mut a: f64, mut b: f64) -> Option<f64> {
        let close = 1e-10 * (b - a);
        let mut at_a = self.indicator.coefficient(k, a);
        let mut at_b = self.indicator.coefficient(k, b);
        let opposite = (at_a < 0.0 && at_b > 0.0) || (at_a > 0.0 && at_b < 0.0);
        if !opposite {
            return None;
        }
        for round in 0..100 {
            let middle = a + 0.5 * (b - a);
            let secant = (a * at_b - b * at_a) / (at_b - at_a);
            // every third cut in the middle, so that the end is in sight
            let t = if round % 3 < 2 && a < secant && secant < b {
                secant
            } else {
                middle
            };
            let value = self.indicator.coefficient(k, t);
            if value == 0.0 || b - a <= close || middle <= a || middle >= b {
                return Some(t);
            }
            if (value < 0.0) == (at_a < 0.0) {
                (a, at_a, at_b) = (t, value, 0.5 * at_b);
            } else {
                (b, at_b, at_a) = (t, value, 0.5 * at_a);
            }
        }
        Some(a + 0.5 * (b - a))
    }

    /// Whether a cell that nothing is known of is not worth another cut: time does not
    /// resolve it, or rounding errors hide the mode in it.
    fn is_hidden(&mut self, a: f64, b: f64) -> Result<bool, Error> {
        let width = b - a;
        if width <= apart(self.start.abs().max(self.end.abs())) {
            return Ok(true);
        }
        let middle = a + 0.5 * width;
        if width > 0.5 * DOUBTFUL * (self.effort.to - self.effort.from)
            || [a, middle, b].iter().any(|&t| self.is_certain(t))
        {
            return Ok(false);
        }
        let expression = self.indicator.expression();
        self.effort.doubt(a, width, expression)?;
        Ok(true)
    }

    /// Whether the mode at `t` is beyond rounding errors.
    fn is_certain(&self, t: f64) -> bool {
        self.indicator.is_constant(Interval::point(t))
    }

    /// Finds the switches of a part on which the quantity is monotone.
    fn monotone(&mut self, a: f64, b: f64) -> Result<(), Error> {
        if self.indicator.counts() {
            let levels = (self.indicator.value(b) - self.indicator.value(a)).abs();
            self.effort
                .check(levels.max(0.0), self.indicator.expression())?;
        }
        let expression = self.indicator.expression();
        let (Some(first), Some(last)) = (self.probe(a, b), self.probe(b, a)) else {
            return self.effort.doubt(a, b - a, expression);
        };
        self.effort.doubt(a, first - a, expression)?;
        self.effort.doubt(b, b - last, expression)?;
        self.arrive(first)?;
        if first < last {
            self.arrive(last)?;
        }
        Ok(())
    }

    /// The time nearest to `end` at which the mode is certain, on the way to `other`.
    fn probe(&self, end: f64, other: f64) -> Option<f64> {
        let shares = (1..=17).rev().map(|k| 0.5_f64.powi(3 * k));
        std::iter::once(0.0)
            .chain(shares)
            .chain([0.5])
            .map(|share| end + share * (other - end))
            .find(|&t| self.is_certain(t))
    }

    /// The mode is certain at `t`.
    fn arrive(&mut self, t: f64) -> Result<(), Error> {
        let value = self.indicator.value(t);
        self.reach(t, value)
    }

    /// The mode is what it is at `inside` from `t` on.
    fn settle(&mut self, inside: f64, t: f64) -> Result<(), Error> {
        let value = self.indicator.value(inside);
        self.reach(t, value)?;
        self.certain = Some((inside, value));
        Ok(())
    }

    /// Finds every switch between the last certain time and `t`, where the mode is `value`.
    fn reach(&mut self, t: f64, value: f64) -> Result<(), Error> {
        while let Some((left, current)) = self.certain
            && !same(current, value)
        {
            let switch = self.bisect(left, t, current);
            self.push(switch)?;
            let next = if switch < t {
                self.indicator.value(switch)
            } else {
                value
            };
            self.certain = Some((switch, next));
        }
        self.certain = Some((t, value));
        Ok(())
    }

    fn push(&mut self, switch: f64) -> Result<(), Error> {
        let last = self.instants.last().copied().unwrap_or(self.start);
        if switch - last <= apart(switch) || self.end - switch <= apart(self.end) {
            return Ok(());
        }
        self.effort.switch(self.indicator.expression())?;
        self.instants.push(switch);
        Ok(())
    }

    /// The first float after the mode's value `current` ends in (`left`, `right`].
    fn bisect(&mut self, mut left: f64, mut right: f64, current: f64) -> f64 {
        loop {
            let middle = left + 0.5 * (right - left);
            if middle <= left || middle >= right {
                return right;
            }
            if same(self.indicator.value(middle), current) {
                left = middle;
            } else {
                right = middle;
            }
        }
    }
}

fn keeps_sign(c: Interval) -> bool {
    c.lo() >= 0.0 || c.hi() <= 0.0
}

/// [a, b] for a ≤ b.
fn interval(a: f64, b: f64) -> Interval {
    Interval::new(a, b).unwrap_or(Interval::ENTIRE)
}
