//! Structured Text of IEC 61131-3, for programmable controllers: a function block, which is what a controller's
//! program sees of an estimator, and the functions that it calls.

use self::names::Identifiers;
use self::print::{Instance, Made, Printer, array_type, comment, lacks, library, plain, section};
use self::value::{listed, literal, part};
use super::c::{File, Precision, Sources, lost};
use super::device::{CREDIBLE, Device, Entry, PATIENCE, READINGS, codes, number_of};
use super::estimator::drafted;
use super::machine::{Field, Machine};
use super::syntax::{Program, Type, parsed};
use super::template::{chosen, parts};
use crate::Refusal;

mod names;
mod print;
mod statement;
#[cfg(test)]
mod tests;
mod value;

const LIBRARY: &str = include_str!("../runtime/library.st");

/// The files of a device: `NAME.st` with types, functions and the block, and `example.st`.
///
/// # Errors
/// What cannot run there, or cannot be written.
pub fn sources(device: &Device<'_>, precision: Precision) -> Result<Sources, Refusal> {
    let machine = drafted(device)?;
    let drafted_library = machine.library().into_iter();
    let drafted_library = drafted_library.filter(|(name, _)| library(name).is_none());
    let drafted_library: String = drafted_library
        .map(|(_, text)| format!("{text}\n\n"))
        .collect();
    let draft = format!("{}\n{drafted_library}{}", machine.tables, machine.source);
    let items = parsed(&chosen(&draft, precision.holds()))?;
    let program = Program::of(&items, &machine.fields);
    let prefix = block_name(device.name);
    let mut printer = Printer::new(
        &items,
        &program,
        (&machine.fields, &machine.sizes),
        (precision, &prefix),
    );
    let taken = printer.instance(Instance {
        function: "take".to_owned(),
        sizes: vec![device.signals.len(), device.estimates.len()],
        fields: vec![],
    })?;
    let verdict = match machine.is_judged() {
        true => Some(printer.instance(Instance {
            function: "is_credible".to_owned(),
            ..Instance::default()
        })?),
        false => None,
    };
    let frame = Frame {
        device,
        machine: &machine,
        real: printer.kind(Type::Real),
        prefix: &prefix,
    };
    let state = frame.state(&mut printer);
    let block = Block::of(&frame, verdict, &mut printer);
    let file = |name: String, text: String| File { name, text };
    let arrays = printer.arrays.iter().map(|(kind, size)| {
        let name = array_type(&prefix, kind, *size);
        format!(
            "TYPE\n    {name} : ARRAY [0..{}] OF {kind};\nEND_TYPE\n\n",
            size - 1
        )
    });
    let text = format!(
        "{}\n{}{state}{}{}{}{}",
        frame.head(),
        arrays.collect::<String>(),
        frame.library(&printer),
        frame.init()?,
        printer.text,
        block.text(&taken)
    );
    Ok(Sources {
        files: vec![
            file(format!("{prefix}.st"), text),
            file("example.st".to_owned(), block.example()),
        ],
        lost: lost(&machine, precision),
    })
}

struct Frame<'a> {
    device: &'a Device<'a>,
    machine: &'a Machine,
    real: &'static str,
    prefix: &'a str,
}

impl Frame<'_> {
    fn head(&self) -> String {
        let about = self.device.about.iter();
        let about = about.map(|line| format!("   {}", plain(line)).trim_end().to_owned() + "\n");
        format!(
            "(* {}: an estimator as a function block\n{}*)\n",
            plain(self.device.name),
            about.collect::<String>()
        )
    }

    /// What is called of the library, and what that calls.
    fn library(&self, printer: &Printer<'_>) -> String {
        let all: Vec<(&str, &str)> = parts(LIBRARY).collect();
        let mut needed: Vec<(&str, &str)> = vec![];
        for part in all.into_iter().rev() {
            let name = format!("@_{}", part.0);
            let is_called = needed
                .iter()
                .any(|other| other.1.contains(&format!("{name}(")));
            if printer.own.contains(part.0) || is_called {
                needed.insert(0, part);
            }
        }
        let whole = if self.real == "REAL" {
            "8388608.0"
        } else {
            "4503599627370496.0"
        };
        let texts = needed.into_iter().map(|(_, text)| {
            let text = text.replace("LREAL", "$").replace("REAL", self.real);
            let text = text.replace('$', "LREAL").replace("WHOLE", whole);
            text.replace('@', self.prefix) + "\n\n"
        });
        texts.collect()
    }

    /// The type of the state.
    fn state(&self, printer: &mut Printer<'_>) -> String {
        let mut lines = String::new();
        for field in &self.machine.fields {
            let kind = match field.count {
                None => printer.kind(field.kind).to_owned(),
                Some(count) => printer.array(field.kind, count),
            };
            let about = about(&field.about);
            lines += &format!("        {} : {kind};{about}\n", part(field.name));
        }
        format!(
            "TYPE\n    {}_state : STRUCT\n{lines}    END_STRUCT;\nEND_TYPE\n\n",
            self.prefix
        )
    }

    /// The function that makes a state what it is before the first sample.
    fn init(&self) -> Result<String, Refusal> {
        let prefix = self.prefix;
        let mut lines = String::new();
        for field in &self.machine.fields {
            lines += &self.start(field)?;
        }
        let shared = section("VAR_IN_OUT", &[format!("s : {prefix}_state;")]);
        let own = section("VAR", &["k : DINT;".to_owned()]);
        Ok(format!(
            "(* Before the first sample. *)\nFUNCTION {prefix}_init : BOOL\n{shared}{own}{lines}    \
             {prefix}_init := TRUE;\nEND_FUNCTION\n\n"
        ))
    }

    /// A field at the start, entry by entry where they are not 0.
    fn start(&self, field: &Field) -> Result<String, Refusal> {
        if field.start.iter().any(|value| !value.is_finite()) {
            return Err(lacks("a start that is no finite number"));
        }
        let name = part(field.name);
        let line = |target: &str, value: f64| {
            format!("    s.{target} := {};\n", self.number(field.kind, value))
        };
        let Some(count) = field.count else {
            return Ok(line(name, field.start.first().copied().unwrap_or(0.0)));
        };
        let zeros = format!(
            "    FOR k := 0 TO {} DO\n    {}    END_FOR;\n",
            count.max(1) - 1,
            line(&format!("{name}[k]"), 0.0)
        );
        let others = field.start.iter().enumerate();
        let others = others.filter(|start| *start.1 != 0.0);
        let others = others.map(|(place, value)| line(&format!("{name}[{place}]"), *value));
        Ok(zeros + &others.collect::<String>())
    }

    /// A number in a statement.
    fn number(&self, kind: Type, value: f64) -> String {
        match kind {
            Type::Int => format!("{}", value as i64),
            Type::Truth => if value == 0.0 { "FALSE" } else { "TRUE" }.to_owned(),
            _ => {
                let is_single = self.real == "REAL" && kind == Type::Real;
                let most = if is_single { 3.4e38 } else { f64::MAX };
                let sign = if value < 0.0 { "-" } else { "" };
                let size = value.abs().min(most);
                format!("{sign}{}", literal(&format!("{size:?}")).text)
            }
        }
    }
}

/// Words behind a declaration.
fn about(words: &str) -> String {
    match comment(words).replace('\n', " ").trim_end() {
        "" => String::new(),
        words => format!(" {words}"),
    }
}

/// The block, with its variables named.
struct Block<'a> {
    frame: &'a Frame<'a>,
    /// measured outputs and known inputs, with what says whether there is one
    signals: Vec<Signal>,
    tunables: Vec<String>,
    estimates: Vec<String>,
    /// what became of readings
    readings: Vec<String>,
    verdict: Option<Verdict>,
    /// types of the arrays that are handed over
    signals_type: String,
    estimates_type: String,
}

struct Signal {
    name: String,
    is_valid: String,
}

/// Whether the estimate is credible.
struct Verdict {
    /// of the variable
    name: String,
    function: Made,
}

/// Names that are not the model's.
const VARIABLES: [&str; 10] = [
    "t",
    "restart",
    "restarted",
    "code",
    "s",
    "begun",
    "before",
    "signals",
    "estimates",
    "done",
];

/// What else no block is called: names in the example, and files that there are already or can never be.
const OTHERS: [&str; 7] = ["estimator", "cycle", "example", "con", "prn", "aux", "nul"];

/// What the block of a model is called.
fn block_name(model: &str) -> String {
    let mut names = Identifiers::without(&VARIABLES).and_without(&OTHERS);
    names.of(&model.to_ascii_lowercase())
}

/// A reading that is none: it is beyond what counts as a number.
const MISSING: &str = "3.0E38";

impl<'a> Block<'a> {
    pub fn of(frame: &'a Frame<'a>, verdict: Option<Made>, printer: &mut Printer<'_>) -> Self {
        let device = frame.device;
        let mut names = printer.identifiers().and_without(&VARIABLES);
        let signals = device.signals.iter().map(|signal| {
            let name = names.of(&signal.name);
            let is_valid = names.of(&format!("{name}_valid"));
            Signal { name, is_valid }
        });
        let signals = signals.collect();
        let mut of = |entries: &[Entry]| -> Vec<String> {
            entries.iter().map(|entry| names.of(&entry.name)).collect()
        };
        let tunables: Vec<Entry> = device.tunables.iter().map(|t| t.entry.clone()).collect();
        let has_readings = frame.machine.fields.iter().any(|f| f.name == "became");
        let sensors = if has_readings { device.sensors() } else { 0 };
        let readings = device.signals[..sensors].iter();
        let readings: Vec<Entry> = readings
            .map(|signal| Entry::named(format!("{}_reading", signal.name)))
            .collect();
        Self {
            frame,
            signals,
            tunables: of(&tunables),
            estimates: of(device.estimates),
            readings: of(&readings),
            verdict: verdict.map(|function| Verdict {
                name: names.of("credible"),
                function,
            }),
            signals_type: printer.array(Type::Real, device.signals.len()),
            estimates_type: printer.array(Type::Real, device.estimates.len()),
        }
    }

    /// Its text; `take` is the function that takes a sample.
    pub fn text(&self, take: &Made) -> String {
        let codes = codes(self.frame.device);
        let codes = codes.map(|reason| format!("{}: {}", reason.number, reason.about));
        let codes: Vec<String> = codes.collect();
        format!(
            "(* Takes a sample at each call. Where it is refused, nothing changes but code:\n   {}.\n\
             \x20  {PATIENCE} times in a row an estimate has run away, or no value: it starts anew with the next sample. *)\n\
             FUNCTION_BLOCK {}\n{}{}{}{}END_FUNCTION_BLOCK\n",
            codes.join(";\n   "),
            self.frame.prefix,
            section("VAR_INPUT", &self.inputs()),
            section("VAR_OUTPUT", &self.outputs()),
            section("VAR", &self.variables()),
            self.body(take),
        )
    }

    fn inputs(&self) -> Vec<String> {
        let (device, real) = (self.frame.device, self.frame.real);
        let mut lines =
            vec!["t : LREAL; (* the time of the sample, in the unit of the study *)".to_owned()];
        let sensors = device.sensors();
        for (place, (signal, entry)) in self.signals.iter().zip(device.signals).enumerate() {
            let Signal { name, is_valid } = signal;
            let words = match place < sensors {
                true => "FALSE: the sensor did not report",
                false => "FALSE: it stays what it was",
            };
            lines.push(format!("{name} : {real};{}", told(name, entry)));
            lines.push(format!("{is_valid} : BOOL := TRUE; (* {words} *)"));
        }
        for (name, tunable) in self.tunables.iter().zip(device.tunables) {
            let (start, words) = (listed(tunable.start), told(name, &tunable.entry));
            lines.push(format!("{name} : {real} := {start};{words}"));
        }
        lines.push(
            "restart : BOOL; (* where it becomes TRUE: from the start, before the sample *)"
                .to_owned(),
        );
        lines
    }

    fn outputs(&self) -> Vec<String> {
        let real = self.frame.real;
        let estimates = self.estimates.iter().zip(self.frame.device.estimates);
        let estimates =
            estimates.map(|(name, entry)| format!("{name} : {real};{}", told(name, entry)));
        let meanings = READINGS.iter().enumerate();
        let meanings = meanings.map(|(k, (_, about))| format!("{k}: {about}"));
        let meanings = meanings.collect::<Vec<_>>().join("; ");
        let readings = self.readings.iter();
        let readings = readings.map(|name| format!("{name} : DINT; (* {meanings} *)"));
        let code = "code : DINT; (* 0, or why the sample was refused *)".to_owned();
        let verdict = self.verdict.iter();
        let verdict = verdict.map(|own| format!("{} : BOOL; (* {CREDIBLE} *)", own.name));
        let all = estimates.chain(readings).chain(verdict);
        all.chain([code]).collect()
    }

    fn variables(&self) -> Vec<String> {
        let state = format!("{}_state", self.frame.prefix);
        vec![
            format!("s : {state};"),
            format!("before : {state};"),
            "begun : BOOL; (* whether s is a state *)".to_owned(),
            "restarted : BOOL; (* whether restart has been heard *)".to_owned(),
            "done : BOOL;".to_owned(),
            format!("signals : {};", self.signals_type),
            format!("estimates : {};", self.estimates_type),
        ]
    }

    fn body(&self, take: &Made) -> String {
        let mut lines = vec![
            "before := s;".to_owned(),
            "IF NOT begun OR (restart AND NOT restarted) THEN".to_owned(),
            format!("    done := {}_init(s := s);", self.frame.prefix),
            "END_IF;".to_owned(),
        ];
        for (place, Signal { name, is_valid }) in self.signals.iter().enumerate() {
            lines.push(format!("signals[{place}] := {name};"));
            lines.push(format!("IF NOT {is_valid} THEN"));
            lines.push(format!("    signals[{place}] := {MISSING};"));
            lines.push("END_IF;".to_owned());
        }
        for (place, name) in self.tunables.iter().enumerate() {
            lines.push(format!("s.tuning[{place}] := {name};"));
        }
        // as `take` is drafted
        let given = ["s", "t", "signals", "estimates"];
        let given = take.parameters.iter().zip(given);
        let given: Vec<String> = given
            .map(|(name, own)| format!("{name} := {own}"))
            .collect();
        lines.push(format!("code := {}({});", take.name, given.join(", ")));
        lines.push("IF code <> 0 THEN".to_owned());
        lines.push("    s := before;".to_owned());
        // an absurd reading that was taken is behind it: the next sample is the first
        let number = |word: &str| number_of(word).unwrap_or_default();
        let (diverged, not_finite) = (number("DIVERGED"), number("NOT_FINITE"));
        lines.push(format!(
            "    IF code = {diverged} OR code = {not_finite} THEN"
        ));
        lines.push("        s.refused := s.refused + 1;".to_owned());
        lines.push(format!("        IF s.refused >= {PATIENCE} THEN"));
        lines.push("            begun := FALSE;".to_owned());
        lines.push("        END_IF;".to_owned());
        lines.push("    END_IF;".to_owned());
        lines.push("ELSE".to_owned());
        lines.push("    begun := TRUE;".to_owned());
        for (place, name) in self.estimates.iter().enumerate() {
            lines.push(format!("    {name} := estimates[{place}];"));
        }
        for (place, name) in self.readings.iter().enumerate() {
            lines.push(format!("    {name} := s.became[{place}];"));
        }
        lines.push("END_IF;".to_owned());
        if let Some(Verdict { name, function }) = &self.verdict {
            let given = function.parameters.join("");
            lines.push(format!("{name} := {}({given} := s);", function.name));
        }
        lines.push("IF code = 0 OR NOT restart THEN".to_owned());
        lines.push("    restarted := restart;".to_owned());
        lines.push("END_IF;".to_owned());
        lines.iter().map(|line| format!("    {line}\n")).collect()
    }

    /// A program that calls it.
    pub fn example(&self) -> String {
        let Frame { prefix, real, .. } = self.frame;
        let signals = self.signals.iter();
        let declared = signals.clone().map(|s| format!("{} : {real};", s.name));
        let given = signals.map(|s| format!("{0} := {0}, {1} := TRUE", s.name, s.is_valid));
        let given: Vec<String> = std::iter::once("t := t".to_owned()).chain(given).collect();
        let taken: Vec<&str> = self.signals.iter().map(|s| s.name.as_str()).collect();
        let mut names = Identifiers::without(&taken);
        let (estimator, cycle) = (names.of("estimator"), names.of("cycle"));
        let variables: Vec<String> = [
            format!("{estimator} : {prefix};"),
            "t : LREAL;".to_owned(),
            format!("{cycle} : LREAL := 0.1;"),
        ]
        .into_iter()
        .chain(declared)
        .collect();
        let first = self.estimates.first().map_or("code", String::as_str);
        format!(
            "{}PROGRAM {prefix}_example\n{}    (* read the sensors and inputs here *)\n    \
             {estimator}({});\n    (* use {estimator}.{first} here, where {estimator}.code is 0 *)\n    \
             t := t + {cycle};\nEND_PROGRAM\n",
            comment(
                "Calls the estimator once in each cycle: `cycle` is the interval of the task, in the unit of time of the study."
            ),
            section("VAR", &variables),
            given.join(", "),
        )
    }
}

/// What is said of a variable: what the model calls it, where that is no name here, and what it is.
fn told(name: &str, entry: &Entry) -> String {
    match name == entry.name {
        true => about(&entry.about),
        false => about(&format!("{} {}", entry.name, entry.about)),
    }
}
