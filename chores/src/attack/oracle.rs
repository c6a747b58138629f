//! What a command must never do, whatever it is given.

use super::commands::{Command, Form};
use super::run::{Ended, Snapshot};
use super::shape;

/// The sort of a finding.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Class {
    Panic,
    /// ended by a signal that nobody sent
    Signal,
    /// memory ended it
    Memory,
    Hang,
    ExitCode,
    /// exit code 1 or 2 without a word
    Silent,
    /// a control character to the terminal
    Terminal,
    /// a file that is no result of the command
    FileLeft,
    /// a file changed that is no result of the command
    InputChanged,
    /// exit code 2 with a result, or 0 without
    Result,
    /// a result that is not what it says
    Shape,
    NotANumber,
    HeaderTwice,
}

/// What was seen.
#[derive(Clone, Debug)]
pub struct Finding {
    pub class: Class,
    pub evidence: String,
}

impl Finding {
    pub fn new(class: Class, evidence: impl Into<String>) -> Self {
        let evidence = evidence.into();
        Self { class, evidence }
    }
}

/// The first thing that a command must not have done.
pub fn judge(
    command: &Command,
    ended: &Ended,
    before: &Snapshot,
    after: &Snapshot,
) -> Option<Finding> {
    let code = match exit(command, ended) {
        Ok(code) => code,
        Err(finding) => return Some(finding),
    };
    words(command, ended, code)
        .or_else(|| files(command, before, after, code))
        .or_else(|| contents(command, ended, before, after, code))
}

fn exit(command: &Command, ended: &Ended) -> Result<i32, Finding> {
    let err = String::from_utf8_lossy(&ended.err);
    let line = |word: &str| err.lines().find(|line| line.contains(word));
    let Some(status) = ended.status else {
        return Err(Finding::new(Class::Hang, "no end"));
    };
    if let Some(line) = line("panicked at") {
        return Err(Finding::new(Class::Panic, line));
    }
    match status.code() {
        Some(code @ 0..=2) => Ok(code),
        Some(code @ 3) if command.has_limit() => Ok(code),
        Some(code) => Err(Finding::new(Class::ExitCode, format!("exit code {code}"))),
        None => Err(match line("memory allocation") {
            Some(_) => Finding::new(Class::Memory, "memory allocation failed"),
            None => Finding::new(Class::Signal, format!("{status}")),
        }),
    }
}

fn words(command: &Command, ended: &Ended, code: i32) -> Option<Finding> {
    if code == 2 && ended.err.is_empty() {
        return Some(Finding::new(Class::Silent, "exit code 2 without a word"));
    }
    if code == 1 && ended.err.is_empty() && ended.out.is_empty() && command.results.is_empty() {
        return Some(Finding::new(Class::Silent, "exit code 1 without a word"));
    }
    for (name, bytes) in [("output", &ended.out), ("error", &ended.err)] {
        let Ok(text) = std::str::from_utf8(bytes) else {
            let what = format!("standard {name} is not UTF-8");
            return Some(Finding::new(Class::Terminal, what));
        };
        let is_command = |c: char| c.is_control() && c != '\n' && c != '\t';
        if let Some(at) = text.find(is_command) {
            let c = text[at..].chars().next();
            return Some(Finding::new(
                Class::Terminal,
                format!("standard {name} has {c:?}"),
            ));
        }
    }
    None
}

/// What is no input and named as a result may be replaced.
fn may_change(command: &Command, name: &String) -> bool {
    let is_result = command.results.iter().any(|(result, _)| result == name);
    let is_replaced = is_result && !command.inputs.contains(name);
    is_replaced || command.rewritten.as_ref() == Some(name)
}

fn files(command: &Command, before: &Snapshot, after: &Snapshot, code: i32) -> Option<Finding> {
    let is_result = |name: &String| command.results.iter().any(|(result, _)| result == name);
    for (name, bytes) in after {
        match before.get(name) {
            None if name.starts_with(".lynkeus-") || !is_result(name) => {
                return Some(Finding::new(Class::FileLeft, name));
            }
            None if code == 2 => {
                let what = format!("exit code 2, and {name} was written");
                return Some(Finding::new(Class::Result, what));
            }
            Some(old) if old != bytes && !may_change(command, name) => {
                return Some(Finding::new(Class::InputChanged, name));
            }
            Some(old) if old != bytes && code == 2 => {
                let what = format!("exit code {code}, and {name} was rewritten");
                return Some(Finding::new(Class::Result, what));
            }
            _ => {}
        }
    }
    if let Some((name, _)) = before.iter().find(|(name, _)| !after.contains_key(*name)) {
        return Some(Finding::new(Class::InputChanged, format!("{name} is gone")));
    }
    let missing = command
        .results
        .iter()
        .find(|(name, _)| !after.contains_key(name));
    match missing {
        Some((name, _)) if code == 0 => Some(Finding::new(
            Class::Result,
            format!("exit code 0, and no {name}"),
        )),
        _ => None,
    }
}

fn contents(
    command: &Command,
    ended: &Ended,
    before: &Snapshot,
    after: &Snapshot,
    code: i32,
) -> Option<Finding> {
    // where a picture cannot be drawn, what else there is takes its place
    let is_undrawn = code == 1 && command.printed == Form::Svg;
    // what is not printed is in a file
    if !ended.out.is_empty()
        && !is_undrawn
        && let Some(finding) = shape::judge(command.printed, &ended.out)
    {
        return Some(finding);
    }
    if let Some(study) = &command.rewritten
        && before.get(study) != after.get(study)
        && let (Some(old), Some(new)) = (before.get(study), after.get(study))
        && lines(old).abs_diff(lines(new)) > 3
    {
        return Some(Finding::new(
            Class::InputChanged,
            "more than the value was rewritten",
        ));
    }
    let new = command
        .results
        .iter()
        .filter(|(name, _)| before.get(name) != after.get(name));
    let written = new.filter_map(|(name, form)| Some((*form, after.get(name)?)));
    written
        .into_iter()
        .find_map(|(form, bytes): (Form, &Vec<u8>)| shape::judge(form, bytes))
}

fn lines(bytes: &[u8]) -> usize {
    bytes.iter().filter(|b| **b == b'\n').count()
}
