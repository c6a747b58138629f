//! C99: what the draft becomes there, a header, a source, a bench that replays a log, and how they are built.

use lynkeus_answer::visible::is_hidden;
use std::cell::RefCell;
use std::collections::BTreeSet;

use super::device::{CREDIBLE, Device, Entry, PATIENCE, READINGS, Tunable, codes, number_of};
use super::draft::{FUNCTIONS, comment, number};
use super::estimator::drafted;
use super::machine::{Field, Machine};
use super::syntax::Type;
use super::template::{chosen, exchanged, outside_comments};
use crate::Refusal;

const REPLAY: &str = include_str!("runtime/replay.c");
const LATE: &str = include_str!("runtime/late.c");
const CMAKE: &str = include_str!("runtime/CMakeLists.txt");

/// The type of numbers.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Precision {
    /// `double`
    #[default]
    F64,
    /// `float`
    F32,
}

/// A file of an export.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct File {
    /// its name in the folder
    pub name: String,
    /// its text
    pub text: String,
}

/// What an export is made of.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Sources {
    /// the files of its folder
    pub files: Vec<File>,
    /// numbers that its `float` makes 0 or infinite, each once; of other numbers none
    pub lost: Vec<String>,
}

impl From<File> for Sources {
    fn from(file: File) -> Self {
        Self {
            files: vec![file],
            lost: vec![],
        }
    }
}

/// The files of a device: `NAME.h`, `NAME.c`, `replay.c` and `CMakeLists.txt`.
///
/// # Errors
/// What cannot run there, or cannot be written.
pub fn files(device: &Device<'_>, precision: Precision) -> Result<Vec<File>, Refusal> {
    Ok(sources(device, precision)?.files)
}

/// The same, with what they lose.
///
/// # Errors
/// As [`files`].
pub fn sources(device: &Device<'_>, precision: Precision) -> Result<Sources, Refusal> {
    let machine = drafted(device)?;
    let frame = Frame {
        device,
        machine: &machine,
        precision,
        prefix: prefix(device.name),
    };
    let named = |text: &str| {
        text.replace("@NAME@", &frame.prefix)
            .replace("@CAPITALS@", &frame.capitals())
            .replace("@REAL@", frame.real())
    };
    let file = |name: String, text: String| File { name, text };
    Ok(Sources {
        files: vec![
            file(format!("{}.h", frame.prefix), frame.header()),
            file(format!("{}.c", frame.prefix), frame.source()),
            file("replay.c".into(), named(&chosen(REPLAY, &frame.holds()))),
            file("CMakeLists.txt".into(), named(CMAKE)),
        ],
        lost: lost(&machine, precision),
    })
}

/// Numbers of a device that `float` makes 0 or infinite.
///
/// # Errors
/// As [`files`].
pub fn lost_in_float(device: &Device<'_>) -> Result<Vec<String>, Refusal> {
    Ok(lost(&drafted(device)?, Precision::F32))
}

/// Numbers of a draft that `float` makes 0 or infinite.
pub(super) fn lost(machine: &Machine, precision: Precision) -> Vec<String> {
    if precision == Precision::F64 {
        return vec![];
    }
    let starts = machine.fields.iter().flat_map(|field| &field.start);
    let starts: String = starts.map(|value| number(value.abs()) + "\n").collect();
    let draft = [&machine.tables, &machine.source, &starts].map(String::as_str);
    numbers_lost(&draft.concat()).into_iter().collect()
}

/// Files that are there already: the bench, the answers of FMUs, the headers of C99 and of what
/// systems add to them.
const TAKEN: [&str; 30] = [
    "replay", "fmi2", "fmi3", "assert", "complex", "ctype", "errno", "fenv", "float", "inttypes",
    "iso646", "limits", "locale", "math", "setjmp", "signal", "stdarg", "stdbool", "stddef",
    "stdint", "stdio", "stdlib", "string", "strings", "tgmath", "time", "features", "unistd",
    "wchar", "wctype",
];

/// A model's name in lower case, what C forbids replaced by `_`, and one more where a file of that
/// name is there already.
pub fn prefix(name: &str) -> String {
    let letters = name.chars().map(|c| match c.to_ascii_lowercase() {
        c if c.is_ascii_alphanumeric() => c,
        _ => '_',
    });
    let mut prefix: String = letters.collect();
    if !prefix.starts_with(|c: char| c.is_ascii_alphabetic()) {
        prefix.insert(0, '_');
    }
    if TAKEN.contains(&prefix.as_str()) {
        prefix.push('_');
    }
    prefix
}

/// What is said at the head of a file.
pub(super) fn title(what: &str, about: &[String]) -> String {
    let lines = about.iter().map(|line| comment(line));
    let lines = lines.map(|line| format!(" * {line}").trim_end().to_owned() + "\n");
    format!("/* {what}\n{} */\n", lines.collect::<String>())
}

/// The entries of an array with what they are, as lines of a comment.
pub(super) fn listed(entries: &[Entry]) -> String {
    let line = |(place, entry): (usize, &Entry)| {
        let about = comment(&format!("{} {}", entry.name, entry.about));
        format!(" *   {place}  {}\n", about.trim())
    };
    entries.iter().enumerate().map(line).collect()
}

struct Frame<'a> {
    device: &'a Device<'a>,
    machine: &'a Machine,
    precision: Precision,
    prefix: String,
}

impl Frame<'_> {
    fn capitals(&self) -> String {
        self.prefix.to_ascii_uppercase()
    }

    fn real(&self) -> &'static str {
        match self.precision {
            Precision::F64 => "double",
            Precision::F32 => "float",
        }
    }

    /// The state that the equations have: all of it, but where late readings find their place.
    fn core(&self) -> String {
        match self.is_late() {
            true => format!("{}_core", self.prefix),
            false => format!("{}_state", self.prefix),
        }
    }

    fn is_late(&self) -> bool {
        !self.device.delays.is_empty()
    }

    /// Rows with the state before each, in the header.
    fn rows(&self) -> String {
        if !self.is_late() {
            return String::new();
        }
        let (name, capitals, real) = (&self.prefix, self.capitals(), self.real());
        let sensors = self.device.sensors();
        format!(
            "/* Rows that are kept, so that a late reading finds its place: at least those of the longest delay, and one\n\
             \x20  more for each late reading in it. */\n\
             #ifndef {capitals}_ROWS\n#define {capitals}_ROWS 64\n#endif\n\
             typedef char {name}_rows_suffice[{capitals}_ROWS > {sensors} + 2 ? 1 : -1];\n\n\
             /* What was read at a time (NaN: nothing), and the estimator before it. */\n\
             typedef struct {{\n    double t;\n    {real} signals[{capitals}_SIGNALS];\n    {name}_core before;\n}} {name}_row;\n\n\
             /* All there is to an estimator under way: a copy is a snapshot. */\n\
             typedef struct {{\n    {name}_core now; /* at the newest row */\n    int count; /* rows that are kept, in the order of their times */\n    int is_whole; /* whether the first row is among them */\n    int refused; /* samples in a row for which the equations had no value or an estimate ran away */\n    {name}_row rows[{capitals}_ROWS];\n}} {name}_state;\n\n"
        )
    }

    /// How late readings find their place, in the source.
    fn late(&self) -> String {
        let delays: Vec<String> = self
            .device
            .delays
            .iter()
            .map(|d| format!("{d:?}"))
            .collect();
        let longest = self.device.delays.iter().copied().fold(0.0, f64::max);
        LATE.replace("@NAME@", &self.prefix)
            .replace("@CAPITALS@", &self.capitals())
            .replace("@REAL@", self.real())
            .replace("@SENSORS@", &self.device.sensors().to_string())
            .replace("@DELAYS@", &delays.join(", "))
            .replace("@LONGEST@", &format!("{longest:?}"))
            .replace("@PATIENCE@", &PATIENCE.to_string())
    }

    fn header(&self) -> String {
        let (name, capitals, real) = (&self.prefix, self.capitals(), self.real());
        let Device {
            signals, estimates, ..
        } = self.device;
        let codes = codes(self.device).map(|reason| {
            let about = match reason.word {
                "ROOM" => reason.about.replace("ROWS", &format!("{capitals}_ROWS")),
                _ => reason.about.to_owned(),
            };
            format!(
                "#define {capitals}_{} {} /* {about} */\n",
                reason.word, reason.number
            )
        });
        let codes: String = codes.collect();
        let fields: String = self
            .machine
            .fields
            .iter()
            .map(|f| self.declared(f))
            .collect();
        let has_readings = self
            .machine
            .fields
            .iter()
            .any(|field| field.name == "became");
        let readings: String = match has_readings {
            false => String::new(),
            true => {
                let each = READINGS.iter().enumerate();
                let each = each.map(|(k, (word, about))| {
                    format!("#define {capitals}_{word} {k} /* {about} */\n")
                });
                format!(
                    "/* What became of a reading. */\n{}\n",
                    each.collect::<String>()
                )
            }
        };
        format!(
            "{title}#ifndef {capitals}_H\n#define {capitals}_H\n\n\
             #ifdef __cplusplus\nextern \"C\" {{\n#endif\n\n\
             /* Signals, as they are given (NaN: a sensor did not report, an input stays):\n{signal_list} */\n\
             #define {capitals}_SIGNALS {signal_count}\n\
             extern const char *const {name}_signal_names[{capitals}_SIGNALS];\n\n\
             /* Estimates, as they are returned:\n{estimate_list} */\n\
             #define {capitals}_ESTIMATES {estimate_count}\n\
             extern const char *const {name}_estimate_names[{capitals}_ESTIMATES];\n\n\
             {tunables}/* Why a sample was refused; nothing has changed then but `refused` of the state. When the\n\
             \x20  equations had no value, or an estimate ran away, {PATIENCE} times in a row, an absurd reading is behind it\n\
             \x20  that was taken before: the state is then what {name}_init makes it, and the next sample the first. */\n{codes}\n{readings}\
             /* {all} */\n\
             typedef struct {{\n{fields}}} {core};\n\n{rows}\
             /* Before the first sample. */\n\
             void {name}_init({name}_state *s);\n\n\
             /* Goes to time t and takes the signals there; 0, or one of the codes above, and then the\n\
             \x20  state and the estimates are what they were. The first sample only updates the start. */\n\
             int {name}_push({name}_state *s, double t, const {real} *signals, {real} *estimates);\n\n\
             {verdict}#ifdef __cplusplus\n}}\n#endif\n\n#endif\n",
            title = title(&format!("{name}.h"), self.device.about),
            signal_list = listed(signals),
            signal_count = signals.len(),
            core = self.core(),
            rows = self.rows(),
            all = match self.is_late() {
                true => "The estimator at a time.",
                false => "All there is to an estimator under way: a copy is a snapshot.",
            },
            tunables = self.tunables(),
            verdict = self.verdict_declared(),
            estimate_list = listed(estimates),
            estimate_count = estimates.len(),
        )
    }

    /// The verdict in the header, where there is one.
    fn verdict_declared(&self) -> String {
        let name = &self.prefix;
        match self.machine.is_judged() {
            true => format!(
                "/* 1: {CREDIBLE}; 0: the estimate is not credible. */\n\
                 int {name}_credible(const {name}_state *s);\n\n"
            ),
            false => "/* Whether the estimate is credible cannot be said: no noise is declared for any sensor. */\n\n".to_owned(),
        }
    }

    /// The verdict in the source.
    fn verdict(&self) -> String {
        let name = &self.prefix;
        match self.machine.is_judged() {
            true => format!(
                "\nint {name}_credible(const {name}_state *s)\n{{\n    return is_credible({now});\n}}\n",
                now = if self.is_late() { "&s->now" } else { "s" }
            ),
            false => String::new(),
        }
    }

    /// What holds in pieces of the runtime.
    fn holds(&self) -> Vec<&'static str> {
        match self.device.tunables.is_empty() {
            true => vec![],
            false => vec!["tunable"],
        }
    }

    /// The numbers that may be changed, in the header.
    fn tunables(&self) -> String {
        let (name, capitals, tunables) = (&self.prefix, self.capitals(), self.device.tunables);
        if tunables.is_empty() {
            return String::new();
        }
        let line = |(place, tunable): (usize, &Tunable)| {
            let Entry { name, about } = &tunable.entry;
            let about = comment(&format!("{name} {about}"));
            format!(" *   {place}  {}; {:?}\n", about.trim(), tunable.start)
        };
        let lines: String = tunables.iter().enumerate().map(line).collect();
        let count = tunables.len();
        format!(
            "/* Numbers that may be changed between any two samples, in `tuning` of the state, with what\n\
             \x20* {name}_init makes them: finite and above 0. A change counts from the last sample on. What\n\
             \x20* is guaranteed above holds for these values alone, and steps stay as long as they are:\n{lines} */\n\
             #define {capitals}_TUNABLES {count}\n\
             extern const char *const {name}_tunable_names[{capitals}_TUNABLES];\n\n"
        )
    }

    fn declared(&self, field: &Field) -> String {
        let kind = match field.kind {
            Type::Real => self.real(),
            Type::Double => "double",
            _ => "int",
        };
        let size = field
            .count
            .map_or(String::new(), |count| format!("[{count}]"));
        let about = match comment(&field.about) {
            words if words.is_empty() => words,
            words => format!(" /* {words} */"),
        };
        format!("    {kind} {}{size};{about}\n", field.name)
    }

    fn source(&self) -> String {
        let (name, capitals, machine) = (&self.prefix, self.capitals(), self.machine);
        let draft = machine.text() + &self.init();
        let draft = exchanged(&draft, |word| {
            if word == "STATE" {
                return Some(self.core());
            }
            number_of(word).map(|_| format!("{capitals}_{word}"))
        });
        let names = |entries: &[Entry]| -> String {
            let texts = entries
                .iter()
                .map(|e| format!("    \"{}\",\n", escaped(&e.name)));
            texts.collect()
        };
        let tunables = match self.device.tunables {
            [] => String::new(),
            tunables => {
                let entries: Vec<Entry> = tunables.iter().map(|t| t.entry.clone()).collect();
                format!(
                    "const char *const {name}_tunable_names[{capitals}_TUNABLES] = {{\n{}}};\n\n",
                    names(&entries)
                )
            }
        };
        format!(
            "{title}#include \"{name}.h\"\n\n#include <math.h>\n\n\
             const char *const {name}_signal_names[{capitals}_SIGNALS] = {{\n{signals}}};\n\n\
             const char *const {name}_estimate_names[{capitals}_ESTIMATES] = {{\n{estimates}}};\n\n\
             {tunables}{body}\n\
             {push}{verdict}",
            push = match self.is_late() {
                true => self.push_row() + &self.late(),
                false => self.push(),
            },
            verdict = self.verdict(),
            title = title(&format!("{name}.c"), self.device.about),
            signals = names(self.device.signals),
            estimates = names(self.device.estimates),
            body = self.precision.render(&draft),
        )
    }

    /// A sample; what is refused changes nothing.
    fn push(&self) -> String {
        let (name, capitals, real) = (&self.prefix, self.capitals(), self.real());
        let keeps = match self.device.tunables {
            [] => String::new(),
            _ => format!(
                "            for (int i = 0; i < {capitals}_TUNABLES; i++) {{\n                s->tuning[i] = before.tuning[i];\n            }}\n"
            ),
        };
        format!(
            "int {name}_push({name}_state *s, double t, const {real} *signals, {real} *estimates)\n{{\n\
             \x20   const {name}_state before = *s;\n\
             \x20   const int code = take(s, t, signals, estimates);\n\
             \x20   if (code != 0) {{\n        *s = before;\n    }}\n\
             \x20   if (code == {capitals}_DIVERGED || code == {capitals}_NOT_FINITE) {{\n        s->refused++;\n\
             \x20       if (s->refused >= {PATIENCE}) {{\n            {name}_init(s);\n{keeps}        }}\n    }}\n    return code;\n}}\n"
        )
    }

    /// The same of a row among others.
    fn push_row(&self) -> String {
        let (name, real) = (&self.prefix, self.real());
        format!(
            "static int push_row({name}_core *s, double t, const {real} *signals, {real} *estimates)\n{{\n\
             \x20   const {name}_core before = *s;\n\
             \x20   const int code = take(s, t, signals, estimates);\n\
             \x20   if (code != 0) {{\n        *s = before;\n    }}\n    return code;\n}}\n"
        )
    }

    /// The start, in the draft.
    fn init(&self) -> String {
        let (name, core) = (&self.prefix, self.core());
        let lines: String = self.machine.fields.iter().map(start).collect();
        match self.is_late() {
            true => format!("static void init_core({core} *s)\n{{\n{lines}}}\n"),
            false => format!("void {name}_init({core} *s)\n{{\n{lines}}}\n"),
        }
    }
}

/// A field at the start, entry by entry where they differ.
fn start(field: &Field) -> String {
    let Field {
        name,
        kind,
        count,
        start,
        ..
    } = field;
    let value = |value: f64| match kind {
        Type::Real => number(value),
        Type::Double => format!("{value:?}"),
        _ => format!("{}", value as i64),
    };
    match count {
        None => format!(
            "    s->{name} = {};\n",
            value(start.first().copied().unwrap_or(0.0))
        ),
        Some(count) => {
            let zeros = format!(
                "    for (int i = 0; i < {count}; i++) {{\n        s->{name}[i] = {};\n    }}\n",
                value(0.0)
            );
            let others = start.iter().enumerate().filter(|(_, v)| **v != 0.0);
            let others = others.map(|(i, v)| format!("    s->{name}[{i}] = {};\n", value(*v)));
            zeros + &others.collect::<String>()
        }
    }
}

/// In a string of C.
fn escaped(name: &str) -> String {
    let plain = |c: char| match c {
        '"' | '\\' => format!("\\{c}"),
        '?' => "\\?".to_owned(),
        // the same name, byte by byte
        c if is_hidden(c) => {
            let mut bytes = [0; 4];
            let bytes = c.encode_utf8(&mut bytes).bytes();
            bytes.map(|byte| format!("\\{byte:03o}")).collect()
        }
        c => c.to_string(),
    };
    name.chars().map(plain).collect()
}

impl Precision {
    /// What holds of a draft: what is between `//? single` and `//?` is for `float` alone, with `!single` for
    /// `double`.
    pub(super) fn holds(self) -> &'static [&'static str] {
        match self {
            Self::F64 => &[],
            Self::F32 => &["single"],
        }
    }

    /// Types, and numbers that depend on them.
    pub(super) fn constant(self, word: &str) -> Option<&'static str> {
        let is_single = self == Self::F32;
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

    /// A draft in C.
    pub(super) fn render(self, draft: &str) -> String {
        let draft = chosen(draft, self.holds());
        let draft = match self {
            // time is `double`, too
            Self::F64 => draft.replace("(real)", ""),
            Self::F32 => draft,
        };
        let words = exchanged(&draft, |word| {
            if let Some(constant) = self.constant(word) {
                return Some(constant.to_owned());
            }
            let is_single = self == Self::F32 && word != "ceil" && FUNCTIONS.contains(&word);
            is_single.then(|| format!("{word}f"))
        });
        let literal = |number: &str| match self {
            Self::F32 => single(number),
            Self::F64 => number.to_owned(),
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
fn numbers_lost(draft: &str) -> BTreeSet<String> {
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
        let c = Precision::F64.render(DRAFT);
        assert!(c.starts_with("static int half(STATE *s, const double *a, int i)\n"));
        assert!(c.contains("const double c = 0.5 * a[i];"));
        let single = Precision::F32.render(DRAFT);
        assert!(single.contains("const float c = 0.5f * a[i];"));
        assert!(single.contains("sqrtf(fabsf(c)) + (float)i"));
        assert!(c.contains("sqrt(fabs(c)) + i;"));
    }

    #[test]
    fn no_number_changes_its_precision_unasked() {
        let draft = "    const real a = (b ? NAN : -INFINITY);\n//? single\n    const real h = R(1.0);\n//?\n//? !single\n    const real h = R(2.0);\n//?\n";
        assert_eq!(
            Precision::F64.render(draft),
            "    const double a = (b ? (double)NAN : -(double)INFINITY);\n    const double h = 2.0;\n"
        );
        assert_eq!(
            Precision::F32.render(draft),
            "    const float a = (b ? NAN : -INFINITY);\n    const float h = 1.0f;\n"
        );
    }

    #[test]
    fn numbers_that_float_has_not_are_found() {
        let draft = "/* R(1e300) */ a = R(1e-46) + R(0.1) - R(1e39) + R(0.0) + R(1e-44);";
        let lost: Vec<String> = numbers_lost(draft).into_iter().collect();
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
