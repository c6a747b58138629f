//! What the draft becomes in C.

use std::cell::RefCell;
use std::collections::BTreeSet;

use super::template::{chosen, exchanged, outside_comments};

/// A kind of C.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Language {
    /// C99 with `double`
    C,
    /// C99 with `float`
    SingleC,
}

/// Functions of the C library, which have an `f` at the end for `float`.
pub(super) const FUNCTIONS: [&str; 19] = [
    "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "fabs", "floor", "frexp", "ldexp",
    "log", "pow", "sin", "sinh", "sqrt", "tan", "tanh", "ceil",
];

impl Language {
    /// A draft in this language.
    /// What is between `//? single` and `//?` is for `float` alone, with `!single` for all others.
    pub(super) fn render(self, draft: &str) -> String {
        match self {
            Self::C => self.c(&chosen(draft, &[])),
            Self::SingleC => self.c(&chosen(draft, &["single"])),
        }
    }

    /// Types, and numbers that depend on them.
    pub(super) fn constant(self, word: &str) -> Option<&'static str> {
        let is_single = self == Self::SingleC;
        Some(match (word, is_single) {
            ("truth", _) => "int",
            ("real", false) => "double",
            ("real", true) => "float",
            ("EPSILON", false) => "2.220446049250313e-16",
            ("EPSILON", true) => "1.1920929e-7f",
            ("SMALLEST", false) => "2.2250738585072014e-308",
            ("SMALLEST", true) => "1.1754944e-38f",
            ("RANK", false) => "1e-13",
            ("RANK", true) => "1e-6f",
            // what math.h calls so is `float`
            ("NAN", false) => "(double)NAN",
            ("INFINITY", false) => "(double)INFINITY",
            _ => return None,
        })
    }

    fn c(self, draft: &str) -> String {
        let draft = match self {
            // time is `double`, too
            Self::C => draft.replace("(real)", ""),
            _ => draft.to_owned(),
        };
        let words = exchanged(&draft, |word| {
            if let Some(constant) = self.constant(word) {
                return Some(constant.to_owned());
            }
            let is_single = self == Self::SingleC && word != "ceil" && FUNCTIONS.contains(&word);
            is_single.then(|| format!("{word}f"))
        });
        let literal = |number: &str| match self {
            Self::SingleC => single(number),
            Self::C => number.to_owned(),
        };
        outside_comments(&words, |code| literals(code, literal))
    }
}

/// The text with `R(number)` written as the number.
fn literals(text: &str, write: impl Fn(&str) -> String) -> String {
    let mut result = String::with_capacity(text.len());
    let mut rest = text;
    let mut before = None;
    while let Some(place) = rest.find("R(") {
        let head = &rest[..place];
        let last = head.chars().last().or(before);
        let is_word = last.is_some_and(|c: char| c.is_ascii_alphanumeric() || c == '_');
        result += head;
        let body = &rest[place + 2..];
        match body.find(')') {
            Some(end) if !is_word => {
                result += &write(&body[..end]);
                rest = &body[end + 1..];
                before = Some(')');
            }
            _ => {
                result += "R(";
                rest = body;
                before = Some('(');
            }
        }
    }
    result + rest
}

/// Numbers of a draft that `float` has not: it makes 0 or an infinity of them.
pub(super) fn lost_in_float(draft: &str) -> BTreeSet<String> {
    let lost = RefCell::new(BTreeSet::new());
    outside_comments(draft, |code| {
        literals(code, |number| {
            let value = number.parse::<f64>().unwrap_or_default();
            let is_held = value == 0.0 || ((value as f32) != 0.0 && (value as f32).is_finite());
            if !is_held {
                lost.borrow_mut().insert(number.to_owned());
            }
            String::new()
        })
    });
    lost.into_inner()
}

/// A literal of type `float`.
fn single(number: &str) -> String {
    match number.parse::<f64>() {
        Ok(value) if (value as f32).is_infinite() => "INFINITY".to_owned(),
        Ok(value) => format!("{:?}f", value as f32),
        Err(_) => number.to_owned(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAFT: &str = "static truth half(STATE *s, const real *a, int i)\n{\n    real b[3];\n    const real c = R(0.5) * a[i];\n    (void)i;\n    s->x[0] = sqrt(fabs(c)) + (real)i;\n    return c;\n}\n";

    #[test]
    fn a_draft_is_text_in_each_language() {
        let c = Language::C.render(DRAFT);
        assert!(c.starts_with("static int half(STATE *s, const double *a, int i)\n"));
        assert!(c.contains("const double c = 0.5 * a[i];"));
        let single = Language::SingleC.render(DRAFT);
        assert!(single.contains("const float c = 0.5f * a[i];"));
        assert!(single.contains("sqrtf(fabsf(c)) + (float)i"));
        assert!(c.contains("sqrt(fabs(c)) + i;"));
    }

    #[test]
    fn no_number_changes_its_precision_unasked() {
        let draft = "    const real a = (b ? NAN : -INFINITY);\n//? single\n    const real h = R(1.0);\n//?\n//? !single\n    const real h = R(2.0);\n//?\n";
        assert_eq!(
            Language::C.render(draft),
            "    const double a = (b ? (double)NAN : -(double)INFINITY);\n    const double h = 2.0;\n"
        );
        assert_eq!(
            Language::SingleC.render(draft),
            "    const float a = (b ? NAN : -INFINITY);\n    const float h = 1.0f;\n"
        );
    }

    #[test]
    fn numbers_that_float_has_not_are_found() {
        let draft = "/* R(1e300) */ a = R(1e-46) + R(0.1) - R(1e39) + R(0.0) + R(1e-44);";
        let lost: Vec<String> = lost_in_float(draft).into_iter().collect();
        assert_eq!(lost, ["1e-46", "1e39"]);
    }

    #[test]
    fn literals_of_float_fit() {
        assert_eq!(single("0.1"), "0.1f");
        assert_eq!(single("1e300"), "INFINITY");
        assert_eq!(
            literals("FOR(1) R(2.5) + R(1e-9)", single),
            "FOR(1) 2.5f + 1e-9f"
        );
    }
}
