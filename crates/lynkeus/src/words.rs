//! Numbers, ranges and verdicts as people read them.

use std::fmt;

use lynkeus_observers::Check;
use lynkeus_structure::{Verdict, figures};

/// Four significant digits.
pub(crate) fn number(value: f64) -> String {
    figures(value, 4)
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
    let proved = |check: &&&Check| check.is_proved();
    let count = checks.iter().filter(proved).count();
    let brief = count > LISTED;
    if brief {
        writeln!(f, "  proved     {count} {what}")?;
    }
    for check in checks.iter().filter(|c| !(brief && proved(c))) {
        let word = check.verdict.word();
        writeln!(f, "  {word:<10} {}: {}", check.statement, check.detail)?;
        if let Verdict::Refuted(_) = check.verdict {
            writeln!(f, "             {}", check.verdict)?;
        }
    }
    Ok(())
}
