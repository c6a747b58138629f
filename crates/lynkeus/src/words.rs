//! Numbers, ranges and verdicts as people read them.

use std::fmt;

use lynkeus_structure::{Check, Condition};

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

/// Conditions listed one by one: more proved ones than this become a count.
const LISTED: usize = 12;

/// One condition a line, the proved ones counted where they are many.
pub(crate) fn conditions<'a>(
    f: &mut fmt::Formatter<'_>,
    checks: impl IntoIterator<Item = &'a Check>,
    what: &str,
) -> fmt::Result {
    let checks: Vec<&Check> = checks.into_iter().collect();
    let proved = |check: &&&Check| check.verdict == Condition::Proved;
    let count = checks.iter().filter(proved).count();
    let brief = count > LISTED;
    if brief {
        writeln!(f, "  proved     {count} {what}")?;
    }
    for check in checks.iter().filter(|c| !(brief && proved(c))) {
        let word = check.verdict.word();
        writeln!(f, "  {word:<10} {}: {}", check.name, check.detail)?;
        if let Condition::Refuted(_) = check.verdict {
            writeln!(f, "             {}", check.verdict)?;
        }
    }
    Ok(())
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
