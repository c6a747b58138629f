//! JavaScript: a module without dependencies, for pages and Node; without types, arrays of numbers as `Float64Array`.

use super::c::Precision;
use super::device::{CREDIBLE, Device, Entry, PATIENCE, number_of};
use super::draft::{FUNCTIONS, comment};
use super::estimator::drafted;
use super::machine::{Field, Machine};
use super::syntax::{
    Declaration, Expr, Function, If, Item, Line, Otherwise, Statement, Value, parsed,
};
use super::template::chosen;
use crate::Refusal;
use crate::names::seen;
use lynkeus_answer::visible::is_hidden;

/// What the library of the draft is in JavaScript, where that has it.
const OWN: [(&str, &str); 3] = [
    (
        "power_of_two",
        "/* The power of two of a number. */\nfunction power_of_two(a)\n{\n    return 2 ** Math.floor(Math.log2(a));\n}",
    ),
    (
        "smaller",
        "function smaller(a, b)\n{\n    return Math.min(a, b);\n}",
    ),
    (
        "larger",
        "function larger(a, b)\n{\n    return Math.max(a, b);\n}",
    ),
];

/// A module: `signals` and `estimates` (names), `tunables` (names of the entries of `tuning` in the
/// state, where there are any), `init()`, which gives a state, and `push(state, t, signals, estimates)`,
/// which writes the estimates and gives 0 or a code as the C export has it; where readings are judged
/// `credible(state)`, true or false.
///
/// # Errors
/// What cannot run there, or cannot be written.
pub fn module(device: &Device<'_>) -> Result<String, Refusal> {
    text(device, &drafted(device)?, "export ")
}

/// An expression whose value is an object with what a [`module`] exports, so that several live in
/// one script. It can stand in a page: nothing in it ends a script or begins a comment of HTML.
///
/// # Errors
/// As [`module`].
pub fn expression(device: &Device<'_>) -> Result<String, Refusal> {
    let machine = drafted(device)?;
    let text = text(device, &machine, "")?;
    // strings have no <, and in code and comments a blank after one changes nothing
    let text = text.replace("</", "< /").replace("<!", "< !");
    let tunables = match device.tunables {
        [] => "",
        _ => "tunables, ",
    };
    let verdict = if machine.is_judged() {
        ", credible"
    } else {
        ""
    };
    Ok(format!(
        "(function () {{\n\"use strict\";\n{text}return {{ signals, estimates, {tunables}init, push{verdict} }};\n}})()"
    ))
}

/// What a module exports, each with the word for it before.
fn text(device: &Device<'_>, machine: &Machine, export: &str) -> Result<String, Refusal> {
    let about: String = device
        .about
        .iter()
        .map(|line| format!("// {}\n", one_line(line)))
        .collect();
    let sizes = machine
        .sizes
        .iter()
        .map(|(name, size)| format!("const {name} = {size};\n"));
    let mut library = String::new();
    for (name, text) in machine.library() {
        let own = OWN.iter().find(|own| own.0 == name);
        library += &match own {
            Some((_, text)) => format!("{text}\n\n"),
            None => format!("{}\n", printed(text, word)?),
        };
    }
    let tunables = match device.tunables {
        [] => String::new(),
        tunables => {
            let entries = tunables.iter().map(|tunable| &tunable.entry);
            format!("{export}const tunables = {};\n", names(entries))
        }
    };
    let source = printed(&format!("{}\n{}", machine.tables, machine.source), word)?;
    let verdict = match machine.is_judged() {
        true => format!("\n{export}{}", VERDICT.replace("CREDIBLE", CREDIBLE)),
        false => String::new(),
    };
    Ok(format!(
        "{about}\n{export}const signals = {};\n{export}const estimates = {};\n{tunables}\n{}\n{}{}\n{export}{}\n{export}{}{verdict}",
        names(device.signals.iter()),
        names(device.estimates.iter()),
        sizes.collect::<String>(),
        library,
        source,
        init(&machine.fields),
        push(),
    ))
}

/// With the numbers of the words in it.
fn push() -> String {
    let number = |word: &str| number_of(word).unwrap_or_default().to_string();
    PUSH.replace("@DIVERGED@", &number("DIVERGED"))
        .replace("@NOT_FINITE@", &number("NOT_FINITE"))
        .replace("@PATIENCE@", &PATIENCE.to_string())
}

const PUSH: &str = "function push(s, t, signals, estimates)
{
    const before = structuredClone(s);
    const code = take(s, t, signals, estimates);
    if (code !== 0) {
        for (const name of Object.keys(before)) {
            if (ArrayBuffer.isView(s[name])) {
                s[name].set(before[name]);
            } else {
                s[name] = before[name];
            }
        }
    }
    if (code === @DIVERGED@ || code === @NOT_FINITE@) {
        s.refused += 1;
        // an absurd reading that was taken is behind it: from the next sample on it starts anew
        const fresh = s.refused < @PATIENCE@ ? {} : init();
        for (const name of Object.keys(fresh)) {
            if (name === \"tuning\") {
                // stays what it was made
            } else if (ArrayBuffer.isView(s[name])) {
                s[name].set(fresh[name]);
            } else {
                s[name] = fresh[name];
            }
        }
    }
    return code;
}
";

const VERDICT: &str = "function credible(s)
{
    // true: CREDIBLE
    return Boolean(is_credible(s));
}
";

/// What a name of the draft is called.
fn word(name: &str) -> Option<String> {
    if let Some(number) = number_of(name) {
        return Some(number.to_string());
    }
    Some(match name {
        "EPSILON" | "SMALLEST" | "RANK" => Precision::F64.constant(name)?.to_owned(),
        "isfinite" => "Number.isFinite".to_owned(),
        "isnan" => "Number.isNaN".to_owned(),
        "INFINITY" => "Infinity".to_owned(),
        "NAN" => "NaN".to_owned(),
        "fabs" => "Math.abs".to_owned(),
        function if FUNCTIONS.contains(&function) => format!("Math.{function}"),
        _ => return None,
    })
}

fn init(fields: &[Field]) -> String {
    let entry = |field: &Field| {
        let value = match field.count {
            None => format!("{:?}", field.start.first().copied().unwrap_or(0.0)),
            Some(_) => {
                let numbers: Vec<String> = field.start.iter().map(|v| format!("{v:?}")).collect();
                format!("Float64Array.of({})", numbers.join(", "))
            }
        };
        let about = match comment(&field.about) {
            words if words.is_empty() => words,
            words => format!(" /* {words} */"),
        };
        format!("        {}: {value},{about}\n", field.name)
    };
    let entries: String = fields.iter().map(entry).collect();
    format!("function init()\n{{\n    return {{\n{entries}    }};\n}}\n")
}

fn names<'e>(entries: impl Iterator<Item = &'e Entry>) -> String {
    let texts: Vec<String> = entries.map(|entry| string(&entry.name)).collect();
    format!("[{}]", texts.join(", "))
}

/// A string, safe inside of a page, too.
fn string(text: &str) -> String {
    let escaped = text.chars().map(|c| match c {
        '"' | '\\' => format!("\\{c}"),
        '<' => "\\u003c".to_owned(),
        // the same name, whatever shows it; two code units beyond the first plane, where nothing is hidden
        c if is_hidden(c) => format!("\\u{:04x}", u32::from(c)),
        c => c.to_string(),
    });
    format!("\"{}\"", escaped.collect::<String>())
}

/// A line of a comment.
fn one_line(text: &str) -> String {
    seen(text).replace("</", "< /")
}

/// A draft in JavaScript; `word` exchanges names.
///
/// # Errors
/// [`Refusal::Draft`]
fn printed(draft: &str, word: fn(&str) -> Option<String>) -> Result<String, Refusal> {
    let mut printer = Printer {
        word,
        text: String::new(),
    };
    for item in parsed(&chosen(draft, &[]))? {
        printer.item(&item);
    }
    Ok(printer.text)
}

struct Printer {
    word: fn(&str) -> Option<String>,
    text: String,
}

impl Printer {
    fn item(&mut self, item: &Item) {
        match item {
            Item::Blank => self.line(0, ""),
            Item::Comment(words) => self.line(0, words),
            Item::Alias(_) => {}
            Item::Table(table) => {
                let table = self.declared(table);
                self.line(0, &format!("{table};"));
            }
            Item::Function(function) => self.function(function),
        }
    }

    fn line(&mut self, depth: usize, text: &str) {
        let indent = if text.is_empty() { 0 } else { 4 * depth };
        self.text += &format!("{:indent$}{text}\n", "");
    }

    fn function(&mut self, function: &Function) {
        let parameters = function.parameters.iter().map(|p| p.name.as_str());
        let parameters: Vec<&str> = parameters.collect();
        let head = format!("function {}({})", function.name, parameters.join(", "));
        self.line(0, &head);
        self.line(0, "{");
        self.block(1, &function.body);
        self.line(0, "}");
    }

    fn block(&mut self, depth: usize, lines: &[Line]) {
        for line in lines {
            self.statement(depth, line);
        }
    }

    fn statement(&mut self, depth: usize, line: &Line) {
        match &line.statement {
            Statement::Unused(_) => {}
            Statement::If(conditional) => self.conditional(depth, "", conditional),
            Statement::For {
                start,
                condition,
                step,
                body,
            } => {
                let start = start.as_ref().map(|start| self.declared(start));
                let head = format!(
                    "for ({}; {}; {}) {{",
                    start.unwrap_or_default(),
                    self.value(condition),
                    self.simple(step)
                );
                self.loop_of(depth, &head, body);
            }
            Statement::While { condition, body } => {
                let head = format!("while ({}) {{", self.value(condition));
                self.loop_of(depth, &head, body);
            }
            Statement::Comment(words) => self.line(depth, words),
            simple => {
                let comment = line.comment.as_ref();
                let comment = comment.map_or(String::new(), |words| format!(" {words}"));
                let text = format!("{};{comment}", self.simple(simple));
                self.line(depth, &text);
            }
        }
    }

    fn loop_of(&mut self, depth: usize, head: &str, body: &[Line]) {
        self.line(depth, head);
        self.block(depth + 1, body);
        self.line(depth, "}");
    }

    fn conditional(&mut self, depth: usize, before: &str, conditional: &If) {
        let head = format!("{before}if ({}) {{", self.value(&conditional.condition));
        self.line(depth, &head);
        self.block(depth + 1, &conditional.then);
        match &conditional.otherwise {
            Otherwise::Nothing => self.line(depth, "}"),
            Otherwise::If(other) => self.conditional(depth, "} else ", other),
            Otherwise::Block(lines) => self.loop_of(depth, "} else {", lines),
        }
    }

    /// A statement of one line, without its semicolon.
    fn simple(&self, statement: &Statement) -> String {
        match statement {
            Statement::Declare(declaration) => self.declared(declaration),
            Statement::Assign {
                target,
                operator,
                value,
            } => {
                let sign = operator.map_or("", |operator| operator.sign());
                format!("{} {sign}= {}", self.value(target), self.value(value))
            }
            Statement::Count { target, is_up } => {
                let sign = if *is_up { "++" } else { "--" };
                format!("{}{sign}", self.value(target))
            }
            Statement::Call(call) => self.value(call),
            Statement::Return(value) => format!("return {}", self.value(value)),
            Statement::Continue => "continue".to_owned(),
            // the others take several lines
            _ => String::new(),
        }
    }

    fn declared(&self, declaration: &Declaration) -> String {
        let Declaration {
            name, size, value, ..
        } = declaration;
        match (size, value) {
            (Some(_), Value::List(list)) => format!("const {name} = [{}]", self.list(list)),
            (Some(size), _) => format!("const {name} = new Float64Array({})", self.value(size)),
            (None, Value::One(value)) => {
                let word = if declaration.is_const { "const" } else { "let" };
                format!("{word} {name} = {}", self.value(value))
            }
            (None, _) => format!("let {name}"),
        }
    }

    fn list(&self, values: &[Expr]) -> String {
        let texts: Vec<String> = values.iter().map(|value| self.value(value)).collect();
        texts.join(", ")
    }

    fn name(&self, name: &str) -> String {
        (self.word)(name).unwrap_or_else(|| name.to_owned())
    }

    fn value(&self, value: &Expr) -> String {
        match value {
            Expr::Name(name) => self.name(name),
            Expr::Real(digits) | Expr::Number(digits) => digits.clone(),
            Expr::Part(name) => format!("s.{name}"),
            Expr::Index(array, place) => format!("{}[{}]", self.value(array), self.value(place)),
            Expr::Call(name, arguments) => {
                format!("{}({})", self.name(name), self.list(arguments))
            }
            Expr::Cast(_, inner) => self.value(inner),
            Expr::Prefix(sign, inner) => format!("{sign}{}", self.value(inner)),
            Expr::Binary(operator, left, right) => format!(
                "{} {} {}",
                self.value(left),
                operator.sign(),
                self.value(right)
            ),
            Expr::Choice(condition, then, otherwise) => format!(
                "{} ? {} : {}",
                self.value(condition),
                self.value(then),
                self.value(otherwise)
            ),
            Expr::Group(inner) => format!("({})", self.value(inner)),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_draft_is_text_without_types() {
        let draft = "static const real table[2] = {R(1.0), -INFINITY};\n\n/* Half\n   of it. */\nstatic truth half(STATE *s, const real *a, int i)\n{\n    real b[3]; /* room */\n    const real c = R(0.5) * a[i];\n    (void)i;\n    for (int k = 0; k < 3; k++) {\n        b[k] = (real)k;\n    }\n    if (c < b[0]) {\n        s->x[0] = sqrt(fabs(c)) + (real)i;\n    } else if (!isfinite(c)) {\n        return 0;\n    } else {\n        /* nothing */\n    }\n    return 1;\n}\n";
        let expected = "const table = [1.0, -Infinity];\n\n/* Half\n   of it. */\nfunction half(s, a, i)\n{\n    const b = new Float64Array(3); /* room */\n    const c = 0.5 * a[i];\n    for (let k = 0; k < 3; k++) {\n        b[k] = k;\n    }\n    if (c < b[0]) {\n        s.x[0] = Math.sqrt(Math.abs(c)) + i;\n    } else if (!Number.isFinite(c)) {\n        return 0;\n    } else {\n        /* nothing */\n    }\n    return 1;\n}\n";
        assert_eq!(printed(draft, word).unwrap(), expected);
    }
}
