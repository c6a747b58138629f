//! Usual changes of a log's column: another unit, a factor of ten, the other sign.

use lynkeus_model::Variable;

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

/// A share of readings that leaves out a few that are wrong by themselves.
pub(crate) const NEARLY_ALL: f64 = 0.9;

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

    /// Whether it moves the zero, as those of temperatures do.
    fn is_of_temperatures(&self) -> bool {
        self.offset != 0.0
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

/// The change with which nearly all readings of a variable lie in its declared range; none where several do that. Only a
/// temperature, or what has no declared unit, may be another temperature.
pub(crate) fn within(declared: &Variable, readings: &Series) -> Option<&'static Change> {
    let unit = declared.unit.as_deref();
    let fits = |change: &&Change| {
        let may_be = match unit {
            Some("K" | "degC" | "degF") => change.is_of_temperatures(),
            Some(_) => !change.is_of_temperatures(),
            None => true,
        };
        let known = readings.iter().map(|y| change.at(y));
        let known = known.filter(|y| y.is_finite());
        let (inside, all) = known.fold((0, 0), |(inside, all): (usize, usize), y| {
            let is_inside = declared.min <= y && y <= declared.max;
            (inside + usize::from(is_inside), all + 1)
        });
        may_be && all > 0 && inside as f64 >= NEARLY_ALL * all as f64
    };
    let mut found = CHANGES.iter().filter(fits);
    let first = found.next();
    first.filter(|_| found.next().is_none())
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;

    #[test]
    fn a_range_tells_the_only_unit_in_which_readings_lie_in_it() {
        let of = |[min, max]: [f64; 2], unit: Option<&str>, readings: &[f64]| {
            let unit = unit.map_or_else(String::new, |unit| format!(", unit = \"{unit}\""));
            let model = format!(
                "model M Real x(min = {min}, max = {max}{unit}); equation der(x) = -x; end M;"
            );
            let plant = Plant::from_modelica(&model, "m.mo", &LoadOptions::default()).unwrap();
            within(&plant.states[0], &readings.to_vec().into()).map(|change| change.cause)
        };
        let cause = |range, readings: &[f64]| of(range, None, readings);
        let kelvin = [280.0, 380.0];
        let found = cause(kelvin, &[31.0, 58.0, f64::NAN, 44.0]);
        assert_eq!(found, Some("in °C beside a model in kelvin"));
        // 300 to 340 as ten times as much, too
        assert_eq!(cause(kelvin, &[30.0, 34.0]), None);
        let found = of(kelvin, Some("K"), &[30.0, 34.0]);
        assert_eq!(found, Some("in °C beside a model in kelvin"));
        let celsius = [0.0, 100.0];
        assert_eq!(cause(celsius, &[300.0]), None);
        let found = of(celsius, Some("degC"), &[300.0]);
        assert_eq!(found, Some("in kelvin beside a model in °C"));
        assert_eq!(of(celsius, Some("m"), &[300.0]), None);
        assert_eq!(cause(kelvin, &[1e6]), None);
        assert_eq!(cause(kelvin, &[]), None);
        let bar = cause([0.5, 3.0], &[1e5, 2.2e5]);
        assert_eq!(bar, Some("in pascal beside a model in bar"));
    }
}
