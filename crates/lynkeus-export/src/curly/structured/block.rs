//! The function block: what a controller's program sees of an estimator.

use super::bound::listed;
use super::names::Identifiers;
use super::print::{Made, Printer, comment, section};
use super::{Frame, about};
use crate::curly::function::Entry;
use crate::curly::syntax::Type;
use crate::curly::words::{self, CREDIBLE, PATIENCE, READINGS, codes};

/// The block, with its variables named.
pub(super) struct Block<'a> {
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
const OWN: [&str; 10] = [
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
pub(super) fn program(model: &str) -> String {
    let mut names = Identifiers::without(&OWN).and_without(&OTHERS);
    names.of(&model.to_ascii_lowercase())
}

/// A reading that is none: it is beyond what counts as a number.
const MISSING: &str = "3.0E38";

impl<'a> Block<'a> {
    pub fn of(frame: &'a Frame<'a>, verdict: Option<Made>, printer: &mut Printer<'_>) -> Self {
        let device = frame.device;
        let mut names = printer.identifiers().and_without(&OWN);
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
        let codes = codes(self.frame.device).enumerate();
        let codes = codes.map(|(k, (_, about))| format!("{}: {about}", k + 1));
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
        let number = |word: &str| words::number(word).unwrap_or_default();
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
