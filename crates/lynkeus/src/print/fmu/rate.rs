//! Units of derivatives.

use lynkeus_model::BaseUnit;

/// A unit by a unit of time, as Modelica writes units (one `/`, behind it one factor or parentheses); none
/// where a part is not known, or where the zero of a unit matters.
pub(super) fn rate(unit: &str, time: &str) -> Option<String> {
    let is_known = |text: &str| BaseUnit::of(text).is_some_and(|unit| unit.offset == 0.0);
    let is_time = time.chars().all(char::is_alphabetic)
        && BaseUnit::of(time)
            .is_some_and(|unit| unit.powers == [0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 0.0]);
    let divided = divided(unit, time);
    (is_time && is_known(unit) && is_known(&divided)).then_some(divided)
}

fn divided(unit: &str, time: &str) -> String {
    let Some((above, below)) = unit.split_once('/') else {
        return format!("{unit}/{time}");
    };
    let inside = below.strip_prefix('(').and_then(|b| b.strip_suffix(')'));
    let is_plain = |part: &str| !part.contains(['/', '(', ')']);
    match inside {
        // a product in parentheses takes one factor more
        Some(product) if is_plain(above) && is_plain(product) => {
            format!("{above}/({product}.{time})")
        }
        None if is_plain(above) && below.chars().all(char::is_alphanumeric) => {
            match power(below, time) {
                Some(power) => format!("{above}/{time}{}", power + 1),
                None => format!("{above}/({below}.{time})"),
            }
        }
        _ => format!("({unit})/{time}"),
    }
}

/// Of the unit of time, where the factor is one.
fn power(factor: &str, time: &str) -> Option<u32> {
    match factor.strip_prefix(time)? {
        "" => Some(1),
        exponent => exponent.parse().ok(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Each by hand, after the grammar of the Modelica specification.
    #[test]
    fn a_rate_is_a_unit_by_time() {
        for (unit, time, expected) in [
            ("1", "min", "1/min"),
            ("m", "min", "m/min"),
            ("N.m", "s", "N.m/s"),
            ("kg.m-3", "h", "kg.m-3/h"),
            ("1/s", "min", "1/(s.min)"),
            ("1/s", "s", "1/s2"),
            ("m/s", "s", "m/s2"),
            ("m/s2", "s", "m/s3"),
            ("m/s-2", "s", "(m/s-2)/s"),
            ("mol/m3", "min", "mol/(m3.min)"),
            ("kg.m2/s", "min", "kg.m2/(s.min)"),
            ("J/(kg.K)", "s", "J/(kg.K.s)"),
            ("J/(kg/m)", "s", "(J/(kg/m))/s"),
            ("(m/s)", "s", "((m/s))/s"),
            ("m/min", "s", "m/(min.s)"),
        ] {
            assert_eq!(rate(unit, time).as_deref(), Some(expected), "{unit}");
            let [before, after, of_time] = [unit, expected, time].map(|u| BaseUnit::of(u).unwrap());
            for (place, power) in after.powers.iter().enumerate() {
                assert_eq!(
                    *power,
                    before.powers[place] - of_time.powers[place],
                    "{unit}"
                );
            }
            let factor = before.factor / of_time.factor;
            assert!((after.factor / factor - 1.0).abs() < 1e-14, "{unit}");
        }
        // another zero, a word that is no unit, and times that are none
        for (unit, time) in [
            ("degC", "s"),
            ("barrels", "s"),
            ("m", "ticks"),
            ("m", "1/Hz"),
            ("m", "m"),
        ] {
            assert_eq!(rate(unit, time), None, "{unit} {time}");
        }
    }
}
