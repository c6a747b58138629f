//! Usual changes of a log's column: another unit, a factor of ten, the other sign.

use crate::Series;

/// A usual change of a reading y: factor·y + offset.
pub(crate) struct Change {
    factor: f64,
    offset: f64,
    /// over the header `{}`
    pub expression: &'static str,
    /// what was read then
    pub cause: &'static str,
}

/// Of so many readings of all it is asked.
const NEARLY_ALL: f64 = 0.9;

const fn change(factor: f64, offset: f64, expression: &'static str, cause: &'static str) -> Change {
    Change {
        factor,
        offset,
        expression,
        cause,
    }
}

/// Those that are tried.
pub(crate) const CHANGES: [Change; 15] = [
    change(0.1, 0.0, "{} / 10", "ten times too large"),
    change(10.0, 0.0, "{} * 10", "ten times too small"),
    change(1e-2, 0.0, "{} / 100", "in per cent, or in centimetres"),
    change(1e2, 0.0, "{} * 100", "a hundred times too small"),
    change(1e-3, 0.0, "{} / 1000", "in thousandths"),
    change(1e3, 0.0, "{} * 1000", "in thousands"),
    change(1e-5, 0.0, "{} / 1e5", "in pascal beside a model in bar"),
    change(1e5, 0.0, "{} * 1e5", "in bar beside a model in pascal"),
    change(1.0 / 1.8, -32.0 / 1.8, "({} - 32) / 1.8", "in °F"),
    change(
        1.0,
        -273.15,
        "{} - 273.15",
        "in kelvin beside a model in °C",
    ),
    change(1.0, 273.15, "{} + 273.15", "in °C beside a model in kelvin"),
    change(
        std::f64::consts::PI / 180.0,
        0.0,
        "{} * pi / 180",
        "in degrees",
    ),
    change(
        180.0 / std::f64::consts::PI,
        0.0,
        "{} * 180 / pi",
        "in radians",
    ),
    change(1.0 / 3.6, 0.0, "{} / 3.6", "in km/h"),
    change(-1.0, 0.0, "-{}", "with the other sign"),
];

impl Change {
    /// Another unit that makes smaller numbers still.
    pub fn smaller(&self, by: f64) -> Self {
        change(
            by * self.factor,
            by * self.offset,
            self.expression,
            self.cause,
        )
    }

    /// Whether it is a factor alone.
    pub fn is_scale(&self) -> bool {
        self.offset == 0.0 && self.factor > 0.0
    }

    /// What a reading is then.
    pub fn at(&self, y: f64) -> f64 {
        self.factor * y + self.offset
    }

    pub fn of(&self, readings: &Series) -> Series {
        let values = readings.iter().map(|y| self.at(y));
        values.collect::<Vec<_>>().into()
    }
}

/// The change with which nearly all readings lie within a range; none where several do that.
pub(crate) fn within(range: [f64; 2], readings: &Series) -> Option<&'static Change> {
    let fits = |change: &&Change| {
        let values = readings.iter().map(|y| change.at(y));
        let known = values.filter(|y| y.is_finite());
        let (inside, all) = known.fold((0, 0), |(inside, all): (usize, usize), y| {
            let is_inside = range[0] <= y && y <= range[1];
            (inside + usize::from(is_inside), all + 1)
        });
        all > 0 && inside as f64 >= NEARLY_ALL * all as f64
    };
    let mut found = CHANGES.iter().filter(fits);
    let first = found.next();
    first.filter(|_| found.next().is_none())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_range_tells_the_only_unit_in_which_readings_lie_in_it() {
        let cause = |range, readings: &[f64]| {
            within(range, &readings.to_vec().into()).map(|change| change.cause)
        };
        let kelvin = [280.0, 380.0];
        let found = cause(kelvin, &[31.0, 58.0, f64::NAN, 44.0]);
        assert_eq!(found, Some("in °C beside a model in kelvin"));
        // 300 to 340 as ten times as much, too
        assert_eq!(cause(kelvin, &[30.0, 34.0]), None);
        assert_eq!(cause(kelvin, &[1e6]), None);
        assert_eq!(cause(kelvin, &[]), None);
        let bar = cause([0.5, 3.0], &[1e5, 2.2e5]);
        assert_eq!(bar, Some("in pascal beside a model in bar"));
    }
}
