//! Numbers and ranges as people read them.

/// Four significant digits.
pub(crate) fn number(value: f64) -> String {
    if value == 0.0 || !value.is_finite() {
        return format!("{value}");
    }
    let digits = 3 - value.abs().log10().floor() as i32;
    match digits {
        0..=8 => {
            let text = format!("{value:.*}", digits as usize);
            match text.contains('.') {
                true => text.trim_end_matches('0').trim_end_matches('.').to_owned(),
                false => text,
            }
        }
        -3..0 => format!("{value:.0}"),
        _ => format!("{value:.3e}"),
    }
}

/// `x in [0, 1]`, or `x = 4.69` for a point.
pub(crate) fn side(name: &str, low: f64, high: f64) -> String {
    match low == high {
        true => format!("{name} = {}", number(low)),
        false => format!("{name} in [{}, {}]", number(low), number(high)),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_four_digits() {
        for (value, text) in [
            (0.123456, "0.1235"),
            (4.69, "4.69"),
            (1234.5, "1234"),
            (-0.5, "-0.5"),
            (1e18, "1.000e18"),
            (12.0, "12"),
            (1e-12, "1.000e-12"),
        ] {
            assert_eq!(number(value), text);
        }
    }
}
