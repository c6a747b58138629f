//! `check --lsp`: what is wrong with a study and its model, in the words of the Language Server Protocol: one
//! `PublishDiagnosticsParams` for each of the two files, so that an editor also forgets what is mended.

use std::ops::Range;
use std::path::{Path, absolute};

use lynkeus::model::Diagnostic;
use lynkeus::observability::Verdict;
use lynkeus::{CheckOptions, Error, ErrorKind, Report, Study, code};
use serde_json::{Value, json};

use super::ending::Ending;
use super::inputs::Source;
use super::limits::Limits;
use super::output;

/// How bad it is, as the protocol numbers it.
#[derive(Clone, Copy)]
enum Severity {
    Error = 1,
    Warning = 2,
    Information = 3,
}

/// Prints what is wrong with a study, or with a model alone. The exit code is that of `check`.
pub(super) fn lsp(
    path: &Path,
    model: Option<String>,
    options: &CheckOptions,
    limits: &Limits,
) -> Result<Ending, Error> {
    let mut sheets = Sheets::new(path);
    let source = Source::load_or_bare(path, model, limits.budget());
    let found = source.and_then(|source| {
        if let Some(plant) = &source.study.plant {
            sheets.open(plant);
        }
        let report = lynkeus::check(&source.study, options)?;
        Ok((source.study, report))
    });
    let ending = match found {
        Err(error) => {
            sheets.error(&error);
            Ending::of(&error)
        }
        Ok((study, report)) => {
            sheets.warnings(&study, &report);
            match report.is_positive() {
                true => Ending::Done,
                false => Ending::No,
            }
        }
    };
    output::print(output::json(&sheets.published()).as_bytes())?;
    Ok(ending)
}

/// A file, and what is wrong with it.
struct Sheet {
    name: String,
    text: String,
    diagnostics: Vec<Value>,
}

/// The study, then its model.
struct Sheets(Vec<Sheet>);

impl Sheets {
    fn new(study: &Path) -> Self {
        let mut sheets = Self(vec![]);
        sheets.open(study);
        sheets
    }

    /// Shows a file, as it is on the disk.
    fn open(&mut self, path: &Path) {
        let name = path.display().to_string();
        if self.0.iter().all(|sheet| sheet.name != name) {
            let text = std::fs::read_to_string(path).unwrap_or_default();
            let diagnostics = vec![];
            self.0.push(Sheet {
                name,
                text,
                diagnostics,
            });
        }
    }

    /// A message at the bytes of a file, which names the study where it is about the model.
    fn add(&mut self, file: usize, at: Range<usize>, severity: Severity, code: &str, text: &str) {
        let related = match (file, self.0.as_slice()) {
            (1, [study, ..]) => json!([{
                "location": { "uri": uri(&study.name), "range": range(&study.text, study.plant()) },
                "message": "the study with this plant",
            }]),
            _ => json!([]),
        };
        let Some(sheet) = self.0.get_mut(file) else {
            return;
        };
        sheet.diagnostics.push(json!({
            "range": range(&sheet.text, at),
            "severity": severity as u8,
            "code": code,
            "source": "lynkeus",
            "message": text,
            "relatedInformation": related,
        }));
    }

    /// Why there is no answer.
    fn error(&mut self, error: &Error) {
        let severity = match error.kind() {
            ErrorKind::Refused => Severity::Warning,
            ErrorKind::Ended => Severity::Information,
            _ => Severity::Error,
        };
        if let Some(diagnostic) = diagnostic(error) {
            return self.diagnostic(diagnostic, severity);
        }
        let message = with_hint(error.message(), error.remedy());
        let (file, at) = self.place(error.place().unwrap_or_default());
        self.add(file, at, severity, &error.code(), &message);
    }

    /// What the model's reader says.
    fn diagnostic(&mut self, found: &Diagnostic, severity: Severity) {
        let label = found.label.iter().map(|label| format!("\n{label}"));
        let message = found.message.clone() + &label.collect::<String>();
        let message = with_hint(&message, found.hint.as_deref());
        let file = self.0.iter().position(|sheet| sheet.name == found.file);
        let at = found.span.start as usize..found.span.end as usize;
        let code = code(found.origin());
        self.add(file.unwrap_or_default(), at, severity, &code, &message);
    }

    /// What a study that can be answered should be told: oddities of the model, unknowns that leave no trace, a family
    /// that does not fit.
    fn warnings(&mut self, study: &Study, report: &Report) {
        for warning in &report.warnings {
            self.diagnostic(warning, Severity::Warning);
        }
        let hidden = report.answer.quantities.iter();
        let hidden = hidden.filter(|(asked, _)| asked.verdict == Verdict::Unobservable);
        for name in hidden.filter_map(|(asked, _)| {
            let mut unknown = study.sensors.unknown.iter();
            unknown.find(|name| name.is_or_has(&asked.name))
        }) {
            let words =
                format!("{name} leaves no trace in what is measured: it cannot be estimated");
            self.error(&name.blame(Error::refused(words)));
        }
        let family = study.observer.family.as_ref();
        let unfit = family.filter(|_| !report.is_positive()).and_then(|name| {
            let entries = report.entries();
            let mut families = entries["families"].as_array()?.iter();
            let found = families.find(|found| found["family"] == name.text)?;
            let words = found["summary"].as_str()?;
            Some(name.blame(Error::refused(format!("{name}: {words}"))))
        });
        unfit.iter().for_each(|error| self.error(error));
    }

    /// The file and the bytes that `FILE:LINE:COLUMN` means, a word or a text; the study's first line where it says less.
    fn place(&self, place: &str) -> (usize, Range<usize>) {
        let found = self.0.iter().enumerate().find_map(|(file, sheet)| {
            let rest = place.strip_prefix(sheet.name.as_str())?;
            let mut numbers = rest.strip_prefix(':')?.split(':');
            // they count from 1
            let mut next = || numbers.next()?.parse::<usize>().ok()?.checked_sub(1);
            Some((file, sheet.word(next()?, next()?)))
        });
        found.unwrap_or((0, 0..0))
    }

    fn published(self) -> Value {
        let sheets = self.0.into_iter();
        sheets
            .map(|sheet| json!({ "uri": uri(&sheet.name), "diagnostics": sheet.diagnostics }))
            .collect()
    }
}

impl Sheet {
    /// The bytes of the word or text that begins there; line and column, in characters, count from 0.
    fn word(&self, line: usize, column: usize) -> Range<usize> {
        let mut lines = self.text.split_inclusive('\n');
        let before: usize = lines.by_ref().take(line).map(str::len).sum();
        let line = lines.next().unwrap_or_default().trim_end();
        let within: usize = line.chars().take(column).map(char::len_utf8).sum();
        let rest = &line[within..];
        let length = match rest.chars().next() {
            Some(quote @ ('"' | '\'')) => rest[1..].find(quote).map(|end| end + 2),
            _ => rest.find(|c: char| !c.is_alphanumeric() && !"_-.".contains(c)),
        };
        let start = before + within;
        start..start + length.unwrap_or(rest.len())
    }

    /// Where a study names its model.
    fn plant(&self) -> Range<usize> {
        let mut lines = self.text.lines().enumerate();
        let named = lines.find(|(_, line)| line.trim_start().starts_with("plant"));
        named.map_or(0..0, |(number, line)| {
            let value = line.find(['"', '\'']).unwrap_or_default();
            self.word(number, line[..value].chars().count())
        })
    }
}

/// The reader's own words, where an error comes from them.
fn diagnostic(error: &Error) -> Option<&Diagnostic> {
    let mut cause = std::error::Error::source(error);
    while let Some(found) = cause {
        if let Some(diagnostic) = found.downcast_ref() {
            return Some(diagnostic);
        }
        cause = found.source();
    }
    None
}

fn with_hint(message: &str, hint: Option<&str>) -> String {
    match hint {
        Some(hint) => format!("{message}\n{hint}"),
        None => message.to_owned(),
    }
}

/// A range as the protocol has it: lines from 0, columns in units of UTF-16.
fn range(text: &str, at: Range<usize>) -> Value {
    json!({ "start": position(text, at.start), "end": position(text, at.end.max(at.start)) })
}

fn position(text: &str, byte: usize) -> Value {
    let before = &text[..text.floor_char_boundary(byte.min(text.len()))];
    let line = before.rsplit('\n').next().unwrap_or_default();
    json!({ "line": before.matches('\n').count(), "character": line.encode_utf16().count() })
}

/// The address of a file.
fn uri(name: &str) -> String {
    let path = absolute(name).map_or(name.to_owned(), |path| path.display().to_string());
    let path = path.replace('\\', "/");
    let mut uri = match path.starts_with('/') {
        true => "file://".to_owned(),
        false => "file:///".to_owned(),
    };
    for byte in path.bytes() {
        match byte {
            b'/' | b'-' | b'_' | b'.' | b'~' => uri.push(char::from(byte)),
            byte if byte.is_ascii_alphanumeric() => uri.push(char::from(byte)),
            byte => uri += &format!("%{byte:02X}"),
        }
    }
    uri
}
