//! A tube over equal parts of the time.

use lynkeus_expr::Interval;

use lynkeus_experiment::words::number;

/// Parts of the time in which the tube is told.
const ROWS: usize = 200;

/// Where the states are, in equal parts of the time.
pub(crate) struct Seen {
    pub rows: Vec<Row>,
    /// until when
    pub reached: f64,
    /// where the states are then
    pub end: Vec<Interval>,
}

/// From when, to when, and where each state is between; none of them before it is seen.
pub type Row = (f64, f64, Vec<Interval>);

impl Seen {
    pub fn new(from: f64, until: f64) -> Self {
        let time = |k: usize| match k {
            ROWS => until,
            _ => from + (until - from) * k as f64 / ROWS as f64,
        };
        Self {
            rows: (0..ROWS).map(|k| (time(k), time(k + 1), vec![])).collect(),
            reached: from,
            end: vec![],
        }
    }

    /// Counts ranges in all rows that have something of a time.
    pub fn add(&mut self, from: f64, to: f64, ranges: &[Interval]) {
        let first = self.rows.partition_point(|row| row.1 < from);
        let rows = self.rows[first..].iter_mut().take_while(|row| row.0 <= to);
        for (_, _, all) in rows {
            join(all, ranges);
        }
    }

    /// Leaves out what is beyond the end.
    pub fn cut(&mut self) {
        self.rows.retain(|row| row.0 < self.reached);
        if let Some(last) = self.rows.last_mut() {
            last.1 = last.1.min(self.reached);
        }
    }

    /// All of both.
    pub fn join(&mut self, other: &Self) {
        for (row, other) in self.rows.iter_mut().zip(&other.rows) {
            join(&mut row.2, &other.2);
        }
        join(&mut self.end, &other.end);
    }

    /// Over all of the time.
    pub fn range(&self) -> Vec<Interval> {
        let mut all = vec![];
        for (_, _, ranges) in &self.rows {
            join(&mut all, ranges);
        }
        if all.is_empty() {
            self.end.clone()
        } else {
            all
        }
    }
}

/// The hulls, state by state.
fn join(all: &mut Vec<Interval>, ranges: &[Interval]) {
    if all.is_empty() {
        all.extend_from_slice(ranges);
    }
    for (all, range) in all.iter_mut().zip(ranges) {
        *all = all.hull(*range);
    }
}

/// What is nearer to zero is told by this or zero: units of its digits are no numbers any more.
const TINY: f64 = 1e-300;

/// Four significant digits that hold all of the range.
pub(crate) fn outward(range: Interval) -> String {
    let digits = |x: f64, up: bool| {
        if x == 0.0 || !x.is_finite() {
            return number(x);
        }
        if x.abs() < TINY {
            let towards_zero = (x > 0.0) != up;
            return number(if towards_zero { 0.0 } else { TINY.copysign(x) });
        }
        let unit = 10_f64.powi(x.abs().log10().floor() as i32 - 3);
        let near = (x / unit).round();
        let text = number(near * unit);
        let shown: f64 = text.parse().unwrap_or(f64::NAN);
        let step = if up { 1.0 } else { -1.0 };
        match (up && shown < x) || (!up && shown > x) {
            true => number((near + step) * unit),
            false => text,
        }
    };
    format!(
        "[{}, {}]",
        digits(range.lo(), false),
        digits(range.hi(), true)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A state that rests at 0 has a range of a few of the smallest numbers: it was told as NaN.
    #[test]
    fn digits_hold_the_range_however_small_it_is() {
        let least = f64::from_bits(1);
        let told = |low: f64, high: f64| outward(Interval::new(low, high).unwrap());
        assert_eq!(told(-least, least), "[-1e-300, 1e-300]");
        assert_eq!(told(least, 2.0 * least), "[0, 1e-300]");
        assert_eq!(told(0.0, 0.0), "[0, 0]");
        assert_eq!(told(-1.00001, 1.00001), "[-1.001, 1.001]");
    }
}
