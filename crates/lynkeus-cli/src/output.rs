//! Words for people, and columns as text.

use std::io::{self, Read, Write};
use std::path::Path;

use lynkeus::model::Diagnostic;
use lynkeus::{Answer, Error, Series, table, visible};
use serde_json::Value;

use super::ending::Ending;

/// Columns as a CSV file, or as a Parquet file if it is called so.
pub(super) fn table(
    path: &Path,
    columns: &[(String, Series)],
    mut to: &mut (dyn Write + Send),
) -> io::Result<()> {
    let names: Vec<_> = columns.iter().map(|c| visible::line(&c.0)).collect();
    let named: Vec<(&str, &Series)> = names
        .iter()
        .zip(columns)
        .map(|(name, (_, values))| (name.as_ref(), values))
        .collect();
    if table::is_parquet(path) {
        return table::write_parquet(&mut to, &named);
    }
    let _ = path;
    table::write_csv(&mut to, &named)
}

/// A JSON object as text.
pub(super) fn json(value: &Value) -> String {
    visible::json(&format!("{value:#}\n")).into_owned()
}

/// Text to standard output; a reader that went away (`| head`) is no error.
pub(super) fn print(mut text: impl Read) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match io::copy(&mut text, &mut out).and_then(|_| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::input(format!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

/// A line to standard error.
pub(super) fn say(text: &str) {
    // nothing can be done where standard error is closed
    let _ = writeln!(io::stderr(), "{}", visible::lines(text));
}

pub(super) fn note(text: &str) {
    say(&format!("note: {text}"));
}

pub(super) fn warn(text: &str) {
    say(&format!("warning: {text}"));
}

pub(super) fn complain(error: &Error) {
    let heading = if brings_heading(error) { "" } else { "error: " };
    say(&format!("{heading}{error}"));
}

/// Tells what the user should know of an answer.
pub(super) fn remarks(answer: &dyn Answer, quiet: bool) {
    answer.warnings().iter().for_each(|text| warn(text));
    if !quiet {
        answer.notes().iter().for_each(|text| note(text));
    }
}

/// Tells what speaks against an answer; the exit code says the same.
pub(super) fn verdict(answer: &dyn Answer) -> Ending {
    if let Some(refusal) = answer.refusal() {
        complain(&refusal);
    }
    match answer.is_positive() {
        true => Ending::Done,
        false => Ending::No,
    }
}

/// A diagnostic of a model starts with its own "error".
fn brings_heading(error: &Error) -> bool {
    std::error::Error::source(error).is_some_and(|source| source.is::<Diagnostic>())
}
