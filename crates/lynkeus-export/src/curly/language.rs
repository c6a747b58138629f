//! What the draft becomes in each language.

use super::template::{chosen, exchanged};

/// A language with braces.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Language {
    /// C99 with `double`
    C,
    /// C99 with `float`
    SingleC,
    /// JavaScript, a module
    JavaScript,
}

/// Functions of the C library, which have an `f` at the end for `float`.
const FUNCTIONS: [&str; 21] = [
    "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "fabs", "floor", "frexp", "ldexp",
    "log", "pow", "sin", "sinh", "sqrt", "tan", "tanh", "ceil", "fmin", "fmax",
];

impl Language {
    /// A draft in this language.
    /// What is between `//? single` and `//?` is for `float` alone, with `!single` for all others.
    pub(super) fn render(self, draft: &str) -> String {
        match self {
            Self::C => self.c(&chosen(draft, &[])),
            Self::SingleC => self.c(&chosen(draft, &["single"])),
            Self::JavaScript => javascript(&chosen(draft, &[])),
        }
    }

    /// Numbers that depend on their type.
    fn constant(self, word: &str) -> Option<&'static str> {
        let is_single = self == Self::SingleC;
        Some(match (word, is_single) {
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
        literals(&words, |number| match self {
            Self::SingleC => single(number),
            _ => number.to_owned(),
        })
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

/// A literal of type `float`.
fn single(number: &str) -> String {
    match number.parse::<f64>() {
        Ok(value) if (value as f32).is_infinite() => "INFINITY".to_owned(),
        Ok(value) => format!("{:?}f", value as f32),
        Err(_) => number.to_owned(),
    }
}

/// A draft is written one statement per line, comments on lines of their own or at the end of one.
fn javascript(draft: &str) -> String {
    let mut is_comment = false;
    let mut result = String::new();
    for line in draft.lines() {
        is_comment |= line.trim_start().starts_with("/*");
        match is_comment {
            true => result += &format!("{line}\n"),
            false => result += &statement(line).unwrap_or_default(),
        }
        is_comment &= !line.contains("*/");
    }
    result
}

fn statement(line: &str) -> Option<String> {
    let (line, comment) = match line.find("/*") {
        Some(place) => line.split_at(place),
        None => (line, ""),
    };
    let (indent, code) = line.split_at(line.len() - line.trim_start().len());
    if code.starts_with("(void)") || code.starts_with("typedef ") {
        return None;
    }
    let mut code = ["(real)", "(double)", "(int)"]
        .iter()
        .fold(code.to_owned(), |code, cast| code.replace(cast, ""));
    code = code.replace("s->", "s.");
    code = literals(&code, str::to_owned);
    code = code
        .replace("for (int ", "for (let ")
        .replace("(STATE *s", "(s");
    code = declaration(&code);
    let words = exchanged(&code, |word| {
        Some(match word {
            "EPSILON" | "SMALLEST" | "RANK" => Language::C.constant(word)?.to_owned(),
            "isfinite" => "Number.isFinite".to_owned(),
            "isnan" => "Number.isNaN".to_owned(),
            "INFINITY" => "Infinity".to_owned(),
            "NAN" => "NaN".to_owned(),
            "fabs" => "Math.abs".to_owned(),
            function if FUNCTIONS.contains(&function) => format!("Math.{function}"),
            _ => return None,
        })
    });
    Some(format!("{indent}{words}{comment}\n"))
}

/// Functions and variables without types.
fn declaration(code: &str) -> String {
    const TYPES: [&str; 5] = ["real ", "int ", "double ", "void ", "STATE "];
    let is_static = code.starts_with("static ");
    let bare = code.strip_prefix("static ").unwrap_or(code);
    let is_const = bare.starts_with("const ");
    let bare = bare.strip_prefix("const ").unwrap_or(bare);
    let Some(rest) = TYPES.iter().find_map(|kind| bare.strip_prefix(kind)) else {
        return code.to_owned();
    };
    if is_static && rest.ends_with(')') {
        return function(rest);
    }
    let name_end = rest.find(|c: char| !(c.is_ascii_alphanumeric() || c == '_'));
    let (name, tail) = rest.split_at(name_end.unwrap_or(rest.len()));
    let Some(size) = tail.strip_prefix('[') else {
        let word = if is_const { "const" } else { "let" };
        return format!("{word} {name}{tail}");
    };
    let (size, value) = size.split_once(']').unwrap_or((size, ";"));
    match value.trim().strip_prefix('=') {
        Some(list) => {
            let list = list.replace('{', "[").replace('}', "]");
            format!("const {name} ={list}")
        }
        None => format!("const {name} = new Float64Array({size});"),
    }
}

/// The head of a function, its parameters without types.
fn function(head: &str) -> String {
    let (name, rest) = head.split_once('(').unwrap_or((head, ""));
    let parameters = rest.trim_end_matches(')').split(',').map(|parameter| {
        let name = parameter.rsplit([' ', '*']).next();
        name.unwrap_or_default()
    });
    let parameters: Vec<&str> = parameters.collect();
    format!("function {name}({})", parameters.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    const DRAFT: &str = "static real half(STATE *s, const real *a, int i)\n{\n    real b[3];\n    const real c = R(0.5) * a[i];\n    (void)i;\n    s->x[0] = sqrt(fabs(c)) + (real)i;\n    return c;\n}\n";

    #[test]
    fn a_draft_is_text_in_each_language() {
        let c = Language::C.render(DRAFT);
        assert!(c.starts_with("static double half(STATE *s, const double *a, int i)\n"));
        assert!(c.contains("const double c = 0.5 * a[i];"));
        let single = Language::SingleC.render(DRAFT);
        assert!(single.contains("const float c = 0.5f * a[i];"));
        assert!(single.contains("sqrtf(fabsf(c)) + (float)i"));
        assert!(c.contains("sqrt(fabs(c)) + i;"));
        assert_eq!(
            Language::JavaScript.render(DRAFT),
            "function half(s, a, i)\n{\n    const b = new Float64Array(3);\n    const c = 0.5 * a[i];\n    s.x[0] = Math.sqrt(Math.abs(c)) + i;\n    return c;\n}\n"
        );
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
        assert_eq!(
            Language::JavaScript.render(draft),
            "    const a = (b ? NaN : -Infinity);\n    const h = 2.0;\n"
        );
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
