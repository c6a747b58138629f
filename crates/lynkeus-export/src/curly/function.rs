//! Functions of time, states and signals, drafted from code.

use crate::curly::dialect::Draft;
use crate::hidden::seen;
use crate::{Body, Code, Dialect, Names, Refusal, Text};

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

/// An entry of a vector.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Entry {
    /// what the model calls it
    pub name: String,
    /// its unit and what it is, in words
    pub about: String,
}

impl Entry {
    /// Without words.
    pub fn named(name: impl Into<String>) -> Self {
        Self {
            name: name.into(),
            about: String::new(),
        }
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
