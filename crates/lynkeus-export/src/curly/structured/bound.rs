//! Texts of values, with how tightly they bind.

use crate::curly::syntax::Operator;

/// How tightly a sign before a value, and what needs no parentheses bind.
pub(super) const SIGN: u8 = 8;
pub(super) const ATOM: u8 = 9;

/// The text of a value, and how tightly it binds.
pub(super) struct Bound {
    pub text: String,
    pub level: u8,
}

impl Bound {
    pub fn atom(text: impl Into<String>) -> Self {
        Self {
            text: text.into(),
            level: ATOM,
        }
    }

    pub fn infix(left: &str, operator: &str, right: &str, level: u8) -> Self {
        Self {
            text: format!("{left} {operator} {right}"),
            level,
        }
    }

    /// What follows a sign has none of its own, but in parentheses.
    pub fn after_a_sign(self, level: u8) -> String {
        match self.text.starts_with('-') {
            true => format!("({})", self.text),
            false => self.at_least(level),
        }
    }

    /// In parentheses where it does not bind so tightly.
    pub fn at_least(self, level: u8) -> String {
        match self.level >= level {
            true => self.text,
            false => format!("({})", self.text),
        }
    }
}

/// A number as the standard writes it: with a point. Factors take the place of exponents that `REAL` has not:
/// there are compilers that refuse them in `LREAL`, too.
pub(super) fn literal(digits: &str) -> Bound {
    const MOST: i32 = 30;
    let (mantissa, exponent) = match digits.split_once(['e', 'E']) {
        Some((mantissa, exponent)) => (mantissa, exponent.parse().unwrap_or(0)),
        None => (digits, 0),
    };
    let mut rest: i32 = exponent;
    let mut factors = vec![];
    while rest.abs() > MOST + 6 {
        let part = MOST * rest.signum();
        factors.push(written("1", part));
        rest -= part;
    }
    let first = written(mantissa, rest);
    match factors.is_empty() {
        true => Bound::atom(first),
        false => Bound {
            text: format!("{first} * {}", factors.join(" * ")),
            level: Operator::Mul.level(),
        },
    }
}

/// A number in a declaration, which has no factors.
pub(super) fn listed(value: f64) -> String {
    let digits = format!("{value:?}");
    match digits.split_once('e') {
        Some((mantissa, exponent)) => written(mantissa, exponent.parse().unwrap_or(0)),
        None => digits,
    }
}

/// With a point.
fn written(mantissa: &str, exponent: i32) -> String {
    let point = if mantissa.contains('.') { "" } else { ".0" };
    match exponent {
        0 => format!("{mantissa}{point}"),
        _ => format!("{mantissa}{point}E{exponent}"),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_have_points_and_exponents_that_every_compiler_takes() {
        for (digits, expected) in [
            ("0.5", "0.5"),
            ("2", "2.0"),
            ("1e-9", "1.0E-9"),
            ("2.5e16", "2.5E16"),
            (
                "1e-307",
                "1.0E-7 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30 * 1.0E-30",
            ),
        ] {
            assert_eq!(literal(digits).text, expected);
        }
        assert_eq!(listed(-2e-307), "-2.0E-307");
        assert_eq!(listed(3.0), "3.0");
    }
}
