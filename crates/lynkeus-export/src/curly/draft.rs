//! The draft: how operations, functions of time, states and signals, and tables are written in it.

use lynkeus_expr::{Binary, Unary};

use super::device::{Entry, number_of};
use crate::names::seen;
use crate::{Binding, Body, Code, Dialect, Form, Names, Refusal, Text};

/// C in which the type of numbers is `real` and their literals are `R(…)`.
#[derive(Clone, Copy, Debug)]
pub(super) struct Draft;

/// Functions of the C library, which have an `f` at the end for `float`.
pub(super) const FUNCTIONS: [&str; 19] = [
    "acos", "asin", "atan", "atan2", "cos", "cosh", "exp", "fabs", "floor", "frexp", "ldexp",
    "log", "pow", "sin", "sinh", "sqrt", "tan", "tanh", "ceil",
];

/// Words of C99 and JavaScript, of their headers, and of the runtime.
const RESERVED: &str = "
abs arguments as async auto await began bool break c case catch char class complex const continue
count debugger default delete do dot double dx else enum eval export extends extern false field
finally float Float64Array for function goto h if implements import in Infinity inline instanceof
int integer_power interface isfinite isnan larger let linux long Math math memcpy NaN new null
Number package private protected public real register restrict return short sign signbit signed
sizeof slopes smaller solve square static struct super switch t this throw true truth try typedef
typeof undefined union unix unsigned var void volatile w while with x y yield
";

/// Words in capitals that the runtime has a meaning for.
const SIZES: &str = "
ALLOWED AT_ONCE CARRIED CARRIED_INSIDE CHANGES CLAUSES CONDITIONS CONDITIONS_ROOM DIMENSION
DIMENSION_INSIDE DISCRETE DRAWN ENDLESS ENTRIES ENTRIES_INSIDE ENTRIES_ROOM ENTRIES_ROOM_INSIDE
EPSILON ESTIMATED FROM HAPPENED HAS_LAST HURRY INFINITY INPUTS ITERATIONS LARGER LAST LEFT MEMORY
MIRRORS NAN NEWEST NEXT OUTPUTS OWN PARAMETERS POINTS R RANK RELATIONS RELATIONS_ROOM REPORTED
ROTATIONS SENSORS SHOWN SIGNALS SMALLEST STARTED STATE STATES SUSPECT TIMERS TOLD TRUTHS TUNABLES
TUNABLE_NAMES TUNED TURNS UNTIL VIEW WIDTH WIDTH_INSIDE
";

/// What math.h defines in capitals, here or there.
const MACROS: &str = "
DOMAIN FP_FAST_FMA FP_FAST_FMAF FP_ILOGB0 FP_ILOGBNAN FP_INFINITE FP_NAN FP_NORMAL FP_SUBNORMAL
FP_ZERO HUGE HUGE_VAL HUGE_VALF HUGE_VALL MATH_ERREXCEPT MATH_ERRNO MAXFLOAT M_1_PI M_2_PI
M_2_SQRTPI M_E M_LN10 M_LN2 M_LOG10E M_LOG2E M_PI M_PI_2 M_PI_4 M_SQRT1_2 M_SQRT2 OVERFLOW PLOSS
SING TLOSS UNDERFLOW
";

impl Dialect for Draft {
    fn name(&self) -> &'static str {
        "C"
    }

    fn is_reserved(&self, word: &str) -> bool {
        let is_among = |words: &str, word: &str| words.split_whitespace().any(|own| own == word);
        let is_listed = |word: &str| is_among(RESERVED, word) || FUNCTIONS.contains(&word);
        // each function of math.h has a sibling for `float`
        is_listed(word)
            || word.strip_suffix('f').is_some_and(is_listed)
            || is_among(SIZES, word)
            || number_of(word).is_some()
            || is_among(MACROS, word)
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

/// What functions read: x and w, entry by entry.
#[derive(Clone, Debug)]
pub(super) struct Arguments {
    pub x: Vec<Entry>,
    pub w: Vec<Entry>,
}

impl Arguments {
    fn vectors(&self) -> [(&'static str, &[Entry]); 2] {
        [("x", &self.x), ("w", &self.w)]
    }
}

/// Where the outputs of a function go.
#[derive(Clone, Debug)]
pub(super) struct Target {
    /// the vector
    pub name: &'static str,
    /// the place in it of each output
    pub places: Vec<usize>,
}

impl Target {
    /// Every place of a vector.
    pub fn all(name: &'static str, count: usize) -> Self {
        Self {
            name,
            places: (0..count).collect(),
        }
    }
}

/// Words in a comment, whatever they hold.
pub(super) fn comment(words: &str) -> String {
    let mut words = seen(words).replace("*/", "* /").replace("/*", "/ *");
    // no trigraphs, and no line that goes on
    while words.contains("??") {
        words = words.replace("??", "? ?");
    }
    words.trim_end().trim_end_matches('\\').to_owned()
}

/// A function `static void name(real t, const real *x, …, real *target, …)` in the draft.
///
/// # Errors
/// As [`Body::of`].
pub(super) fn draft(
    about: &str,
    name: &str,
    code: &Code,
    arguments: &Arguments,
    targets: &[Target],
) -> Result<String, Refusal> {
    let mut names = Names::default();
    let needed = code.operations();
    let is_needed = |place: usize| {
        let input = code.inputs().get(place);
        input.is_some_and(|input| needed.binary_search(input).is_ok())
    };
    let mut lines = vec![];
    if !is_needed(0) {
        lines.push("(void)t;".to_owned());
    }
    let mut inputs = vec![Text::atom("t")];
    for (vector, entries) in arguments.vectors() {
        let before = lines.len();
        for (place, entry) in entries.iter().enumerate() {
            if !is_needed(inputs.len()) {
                inputs.push(Text::atom("R(0.0)"));
                continue;
            }
            let identifier = Draft.identifier(&mut names, &entry.name);
            let about = match identifier == entry.name {
                true => entry.about.clone(),
                false => format!("{} {}", entry.name, entry.about),
            };
            let about = match comment(about.trim()) {
                words if words.is_empty() => words,
                words => format!(" /* {words} */"),
            };
            lines.push(format!(
                "const real {identifier} = {}[{place}];{about}",
                vector
            ));
            inputs.push(Text::atom(identifier));
        }
        if lines.len() == before {
            lines.push(format!("(void){};", vector));
        }
    }
    let body = Body::of(code, &Draft, &inputs, &mut names)?;
    lines.extend(body.lines);
    let places = targets
        .iter()
        .flat_map(|target| target.places.iter().map(|place| (target.name, *place)));
    for ((target, place), output) in places.zip(&body.outputs) {
        lines.push(format!("{target}[{place}] = {};", output.text));
    }
    for target in targets.iter().filter(|target| target.places.is_empty()) {
        lines.push(format!("(void){};", target.name));
    }
    let parameters = arguments
        .vectors()
        .into_iter()
        .map(|(vector, _)| format!("const real *{vector}"));
    let results = targets
        .iter()
        .map(|target| format!("real *{}", target.name));
    let parameters: Vec<String> = parameters.chain(results).collect();
    let lines: String = lines.iter().map(|line| format!("    {line}\n")).collect();
    Ok(format!(
        "/* {} */\nstatic void {name}(real t, {})\n{{\n{lines}}}\n",
        comment(about),
        parameters.join(", ")
    ))
}

/// A number.
pub(super) fn number(value: f64) -> String {
    match value {
        v if v == f64::INFINITY => "INFINITY".to_owned(),
        v if v == f64::NEG_INFINITY => "-INFINITY".to_owned(),
        v if v < 0.0 => format!("-R({:?})", -v),
        v => format!("R({v:?})"),
    }
}

/// A table of numbers.
pub(super) fn table(name: &str, values: &[f64]) -> String {
    let texts: Vec<String> = values.iter().map(|value| number(*value)).collect();
    listed("real", name, texts, "R(0.0)")
}

/// A table of times, or of what counts them.
pub(super) fn times(name: &str, values: impl Iterator<Item = f64>) -> String {
    let texts = values.map(|value| format!("{value:?}")).collect();
    listed("double", name, texts, "0.0")
}

/// A table of places.
pub(super) fn places(name: &str, values: impl Iterator<Item = usize>) -> String {
    let texts = values.map(|value| value.to_string()).collect();
    listed("int", name, texts, "0")
}

/// No language has a table without entries.
fn listed(kind: &str, name: &str, mut texts: Vec<String>, zero: &str) -> String {
    if texts.is_empty() {
        texts.push(zero.to_owned());
    }
    let count = texts.len();
    format!(
        "static const {kind} {name}[{count}] = {{{}}};\n",
        texts.join(", ")
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::code::Solver;
    use crate::{Body, Code, Names};
    use lynkeus_expr::Graph;

    #[test]
    fn a_truth_that_is_used_twice_is_no_number() {
        let g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
        let is_less = a.less(b);
        let outputs = [is_less.select(a, c), is_less.select(c, b), is_less + c];
        let inputs = [a, b, c].map(|e| e.node());
        let texts = ["a", "b", "c"].map(Text::atom);
        let outputs = outputs.map(|e| e.node());
        let code = Code::of(&g, &inputs, &[&outputs], Solver::Plain).unwrap();
        let body = Body::of(&code, &Draft, &texts, &mut Names::default()).unwrap();
        assert_eq!(body.lines, ["const truth v1 = a < b;"]);
        assert_eq!(body.outputs[0].text, "(v1 ? a : c)");
        assert_eq!(body.outputs[1].text, "(v1 ? c : b)");
        assert!(body.outputs[2].text.contains("(v1 ? R(1.0) : R(0.0))"));
    }
}
