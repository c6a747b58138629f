//! Numbers as people read them.

/// Powers of ten between which numbers are written without an exponent.
const PLAIN: std::ops::Range<i32> = -5..6;

/// So many significant digits, without zeros at the end: `0.3`, `-12.5`, `1.2e-9`.
///
/// ```
/// use lynkeus_words::figures;
/// assert_eq!(figures(0.1 + 0.2, 6), "0.3");
/// assert_eq!(figures(31.4159, 4), "31.42");
/// assert_eq!(figures(3e20, 4), "3e20");
/// ```
pub fn figures(value: f64, count: usize) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return format!("{value}");
    }
    let behind = count.saturating_sub(1);
    let scientific = format!("{value:.behind$e}");
    let (mantissa, exponent) = scientific.split_once('e').unwrap_or((&scientific, "0"));
    // that of the rounded number
    let power: i32 = exponent.parse().unwrap_or(0);
    if !PLAIN.contains(&power) {
        return format!("{}e{power}", trimmed(mantissa));
    }
    let decimals = usize::try_from(behind as i32 - power).unwrap_or(0);
    trimmed(&format!("{value:.decimals$}")).to_owned()
}

/// Six significant digits.
pub fn short(value: f64) -> String {
    figures(value, 6)
}

fn trimmed(text: &str) -> &str {
    match text.contains('.') {
        true => text.trim_end_matches('0').trim_end_matches('.'),
        false => text,
    }
}

/// `1 slope`, `2 slopes`, for a noun whose plural has an s.
pub fn counted(count: usize, noun: &str) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} {noun}{plural}")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_read_well() {
        for (value, text) in [
            (0.0, "0"),
            (-0.0, "0"),
            (0.5, "0.5"),
            (-1.0, "-1"),
            (1234567.8, "1.23457e6"),
            (123456.7, "123457"),
            (999999.7, "1e6"),
            (1e-9, "1e-9"),
            (-3.05684123e-9, "-3.05684e-9"),
            (0.000012, "0.000012"),
            (100.0, "100"),
            (f64::INFINITY, "inf"),
        ] {
            assert_eq!(short(value), text);
        }
    }

    #[test]
    fn nouns_are_counted() {
        assert_eq!(counted(1, "slope"), "1 slope");
        assert_eq!(counted(0, "state"), "0 states");
    }
}
