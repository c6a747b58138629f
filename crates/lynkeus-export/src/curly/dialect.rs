//! How operations are written in the draft.

use lynkeus_expr::{Binary, Unary};

use super::language::FUNCTIONS;
use super::words;
use crate::{Binding, Dialect, Form, Text};

/// C in which the type of numbers is `real` and their literals are `R(…)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draft;

/// Words of C99 and JavaScript, of their headers, and of the runtime.
const RESERVED: &[&str] = &[
    "abs",
    "arguments",
    "as",
    "async",
    "auto",
    "await",
    "began",
    "bool",
    "break",
    "c",
    "case",
    "catch",
    "char",
    "class",
    "complex",
    "const",
    "continue",
    "count",
    "debugger",
    "default",
    "delete",
    "do",
    "dot",
    "double",
    "dx",
    "else",
    "enum",
    "eval",
    "export",
    "extends",
    "extern",
    "false",
    "field",
    "finally",
    "float",
    "Float64Array",
    "for",
    "function",
    "goto",
    "h",
    "if",
    "implements",
    "import",
    "in",
    "Infinity",
    "inline",
    "instanceof",
    "int",
    "integer_power",
    "interface",
    "isfinite",
    "isnan",
    "larger",
    "let",
    "linux",
    "long",
    "Math",
    "math",
    "memcpy",
    "NaN",
    "new",
    "null",
    "Number",
    "package",
    "private",
    "protected",
    "public",
    "real",
    "register",
    "restrict",
    "return",
    "short",
    "sign",
    "signbit",
    "signed",
    "sizeof",
    "slopes",
    "smaller",
    "solve",
    "square",
    "static",
    "struct",
    "super",
    "switch",
    "t",
    "this",
    "throw",
    "true",
    "truth",
    "try",
    "typedef",
    "typeof",
    "undefined",
    "union",
    "unix",
    "unsigned",
    "var",
    "void",
    "volatile",
    "w",
    "while",
    "with",
    "x",
    "y",
    "yield",
];

/// Words in capitals that the runtime has a meaning for.
const SIZES: &[&str] = &[
    "CARRIED",
    "CARRIED_INSIDE",
    "DIMENSION",
    "DIMENSION_INSIDE",
    "ENTRIES",
    "ENTRIES_INSIDE",
    "ENTRIES_ROOM",
    "ENTRIES_ROOM_INSIDE",
    "EPSILON",
    "ESTIMATED",
    "INFINITY",
    "INPUTS",
    "LARGER",
    "NAN",
    "OUTPUTS",
    "OWN",
    "PARAMETERS",
    "POINTS",
    "R",
    "RANK",
    "REPORTED",
    "SENSORS",
    "SIGNALS",
    "SMALLEST",
    "STATE",
    "STATES",
    "TOLD",
    "TUNABLES",
    "TUNABLE_NAMES",
    "TUNED",
    "WIDTH",
    "WIDTH_INSIDE",
];

/// What math.h defines in capitals, here or there.
const MACROS: &[&str] = &[
    "DOMAIN",
    "FP_FAST_FMA",
    "FP_FAST_FMAF",
    "FP_ILOGB0",
    "FP_ILOGBNAN",
    "FP_INFINITE",
    "FP_NAN",
    "FP_NORMAL",
    "FP_SUBNORMAL",
    "FP_ZERO",
    "HUGE",
    "HUGE_VAL",
    "HUGE_VALF",
    "HUGE_VALL",
    "MATH_ERREXCEPT",
    "MATH_ERRNO",
    "MAXFLOAT",
    "M_1_PI",
    "M_2_PI",
    "M_2_SQRTPI",
    "M_E",
    "M_LN10",
    "M_LN2",
    "M_LOG10E",
    "M_LOG2E",
    "M_PI",
    "M_PI_2",
    "M_PI_4",
    "M_SQRT1_2",
    "M_SQRT2",
    "OVERFLOW",
    "PLOSS",
    "SING",
    "TLOSS",
    "UNDERFLOW",
];

impl Dialect for Draft {
    fn name(&self) -> &'static str {
        "C"
    }

    fn is_reserved(&self, word: &str) -> bool {
        let is_listed = |word: &str| RESERVED.contains(&word) || FUNCTIONS.contains(&word);
        // each function of math.h has a sibling for `float`
        is_listed(word)
            || word.strip_suffix('f').is_some_and(is_listed)
            || SIZES.contains(&word)
            || words::number(word).is_some()
            || MACROS.contains(&word)
            || word.ends_with("_matrix")
    }

    fn number(&self, value: f64) -> Text {
        let (text, is_negative) = match value {
            v if v.is_nan() => ("NAN".to_owned(), false),
            v if v.is_infinite() => ("INFINITY".to_owned(), v < 0.0),
            v => (format!("R({:?})", v.abs()), v.is_sign_negative()),
        };
        Text::signed(text, is_negative)
    }

    fn unary(&self, op: Unary) -> Option<Form> {
        Some(Form::Call(match op {
            Unary::Neg => return Some(Form::Prefix("-", Binding::Sign)),
            Unary::Not => return Some(Form::Prefix("!", Binding::Sign)),
            Unary::Abs => "fabs",
            Unary::Sign => "sign",
            Unary::Floor => "floor",
            Unary::Sqrt => "sqrt",
            Unary::Exp => "exp",
            Unary::Ln => "log",
            Unary::Sin => "sin",
            Unary::Cos => "cos",
            Unary::Tan => "tan",
            Unary::Asin => "asin",
            Unary::Acos => "acos",
            Unary::Atan => "atan",
            Unary::Sinh => "sinh",
            Unary::Cosh => "cosh",
            Unary::Tanh => "tanh",
        }))
    }

    fn binary(&self, op: Binary) -> Option<Form> {
        Some(match op {
            Binary::Add => Form::Infix(" + ", Binding::Sum),
            Binary::Sub => Form::Infix(" - ", Binding::Sum),
            Binary::Mul => Form::Infix(" * ", Binding::Product),
            Binary::Div => Form::Infix(" / ", Binding::Product),
            Binary::Pow => Form::Call("pow"),
            Binary::Atan2 => Form::Call("atan2"),
            Binary::Min => Form::Call("smaller"),
            Binary::Max => Form::Call("larger"),
            Binary::Less => Form::Infix(" < ", Binding::Relation),
            Binary::LessEq => Form::Infix(" <= ", Binding::Relation),
            Binary::Equal => Form::Infix(" == ", Binding::Relation),
            Binary::And => Form::Infix(" && ", Binding::Relation),
            Binary::Or => Form::Infix(" || ", Binding::Relation),
        })
    }

    fn power(&self, base: &Text, exponent: i32) -> Text {
        match exponent {
            // whose magnitude is no `int`
            i32::MIN => Text::call("pow", &[base, &self.number(f64::from(i32::MIN))]),
            2 => Text::call("square", &[base]),
            n => Text::atom(format!("integer_power({}, {n})", base.text)),
        }
    }

    fn select(&self, condition: &Text, x: &Text, y: &Text) -> Text {
        Text::atom(format!("({} ? {} : {})", condition.text, x.text, y.text))
    }

    fn assignment(&self, name: &str, value: &Text) -> String {
        format!("const real {name} = {};", value.text)
    }

    fn truth(&self, name: &str, value: &Text) -> String {
        format!("const truth {name} = {};", value.text)
    }

    /// The solution, then the reciprocal condition.
    fn solution(&self, name: &str, a: &[Text], b: &[Text]) -> Option<Vec<String>> {
        let n = b.len();
        let list = |texts: &[Text]| {
            let texts: Vec<&str> = texts.iter().map(|text| text.text.as_str()).collect();
            texts.join(", ")
        };
        Some(vec![
            format!("real {name}_matrix[{}] = {{{}}};", n * n, list(a)),
            format!("real {name}[{}] = {{{}, R(0.0)}};", n + 1, list(b)),
            format!("solve({n}, {name}_matrix, {name});"),
        ])
    }

    fn entry(&self, solution: &str, place: usize) -> Text {
        Text::atom(format!("{solution}[{place}]"))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{Body, Code, Names};
    use lynkeus_expr::{Graph, Tape};

    #[test]
    fn a_truth_that_is_used_twice_is_no_number() {
        let g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
        let is_less = a.less(b);
        let outputs = [is_less.select(a, c), is_less.select(c, b), is_less + c];
        let inputs = [a, b, c].map(|e| e.node());
        let tape = Tape::new(&g, &inputs, &outputs.map(|e| e.node())).unwrap();
        let texts = ["a", "b", "c"].map(Text::atom);
        let code = Code::of(&tape).unwrap();
        let body = Body::of(&code, &Draft, &texts, &mut Names::default()).unwrap();
        assert_eq!(body.lines, ["const truth v1 = a < b;"]);
        assert_eq!(body.outputs[0].text, "(v1 ? a : c)");
        assert_eq!(body.outputs[1].text, "(v1 ? c : b)");
        assert!(body.outputs[2].text.contains("(v1 ? R(1.0) : R(0.0))"));
    }
}
