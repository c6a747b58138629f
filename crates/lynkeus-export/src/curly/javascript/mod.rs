//! JavaScript: a module without dependencies, for pages and Node.

mod print;

use self::print::printed;
use super::device::Device;
use super::function::{Entry, comment};
use super::language::{FUNCTIONS, Language};
use super::machine::{Field, Machine};
use super::words;
use crate::Refusal;
use crate::hidden::{is_hidden, seen};

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
    text(device, &Machine::of(device)?, "export ")
}

/// An expression whose value is an object with what a [`module`] exports, so that several live in
/// one script. It can stand in a page: nothing in it ends a script or begins a comment of HTML.
///
/// # Errors
/// As [`module`].
pub fn expression(device: &Device<'_>) -> Result<String, Refusal> {
    let machine = Machine::of(device)?;
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
        true => format!("\n{export}{}", VERDICT.replace("CREDIBLE", words::CREDIBLE)),
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
    let number = |word: &str| words::number(word).unwrap_or_default().to_string();
    PUSH.replace("@DIVERGED@", &number("DIVERGED"))
        .replace("@NOT_FINITE@", &number("NOT_FINITE"))
        .replace("@PATIENCE@", &words::PATIENCE.to_string())
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
    if let Some(number) = words::number(name) {
        return Some(number.to_string());
    }
    Some(match name {
        "EPSILON" | "SMALLEST" | "RANK" => Language::C.constant(name)?.to_owned(),
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
