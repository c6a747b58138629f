//! Files written whole or not at all, and words for people.

use std::io::{self, Write};
use std::path::Path;

use lynkeus::model::Diagnostic;
use lynkeus::{Error, table};

/// Writes a file through a temporary one beside it, so that it is whole or absent.
/// A link is followed; a device or a pipe is written to, never replaced.
pub(super) fn write(path: &Path, bytes: &[u8]) -> Result<(), Error> {
    let failed = |e: io::Error| Error::input(format!("cannot write {}: {e}", path.display()));
    let place = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    if std::fs::metadata(&place).is_ok_and(|data| !data.is_file()) {
        let mut device = std::fs::OpenOptions::new()
            .write(true)
            .open(&place)
            .map_err(failed)?;
        return device.write_all(bytes).map_err(failed);
    }
    let folder = match place.parent() {
        Some(folder) if !folder.as_os_str().is_empty() => folder,
        _ => Path::new("."),
    };
    let mut file = tempfile::Builder::new()
        .prefix(".lynkeus-")
        .tempfile_in(folder)
        .map_err(failed)?;
    file.write_all(bytes).map_err(failed)?;
    readable(file.as_file()).map_err(failed)?;
    file.persist(&place).map_err(|e| failed(e.error))?;
    Ok(())
}

/// Temporary files are private; results have the permissions of ordinary files.
#[cfg(unix)]
fn readable(file: &std::fs::File) -> io::Result<()> {
    use std::os::unix::fs::PermissionsExt;
    file.set_permissions(std::fs::Permissions::from_mode(0o644))
}

#[cfg(not(unix))]
fn readable(_: &std::fs::File) -> io::Result<()> {
    Ok(())
}

/// Columns as CSV text.
pub(super) fn csv(columns: &[(String, &[f64])]) -> Result<String, Error> {
    let mut bytes = vec![];
    table::write_csv(&mut bytes, &named(columns))
        .map_err(|e| Error::input(format!("cannot write CSV: {e}")))?;
    String::from_utf8(bytes).map_err(|e| Error::input(format!("cannot write CSV: {e}")))
}

fn named<'a>(columns: &'a [(String, &'a [f64])]) -> Vec<(&'a str, &'a [f64])> {
    let named = columns.iter();
    named
        .map(|(name, values)| (name.as_str(), *values))
        .collect()
}

/// Columns into a CSV file, or into a Parquet file if it is called so.
pub(super) fn write_table(path: &Path, columns: &[(String, &[f64])]) -> Result<(), Error> {
    #[cfg(feature = "parquet")]
    if table::is_parquet(path) {
        let mut bytes = vec![];
        table::write_parquet(&mut bytes, &named(columns))
            .map_err(|e| Error::input(format!("cannot write {}: {e}", path.display())))?;
        return write(path, &bytes);
    }
    write(path, csv(columns)?.as_bytes())
}

/// Text to standard output; a reader that went away (`| head`) is no error.
pub(super) fn print(text: &str) -> Result<(), Error> {
    let mut out = io::stdout().lock();
    match out.write_all(text.as_bytes()).and_then(|()| out.flush()) {
        Err(e) if e.kind() != io::ErrorKind::BrokenPipe => Err(Error::input(format!(
            "cannot write to standard output: {e}"
        ))),
        _ => Ok(()),
    }
}

pub(super) fn note(text: &str) {
    // nothing can be done where standard error is closed
    let _ = writeln!(io::stderr(), "note: {text}");
}

pub(super) fn complain(error: &Error) {
    let heading = if brings_heading(error) { "" } else { "error: " };
    let _ = writeln!(io::stderr(), "{heading}{error}");
}

/// A diagnostic of a model starts with its own "error".
fn brings_heading(error: &Error) -> bool {
    std::error::Error::source(error).is_some_and(|source| source.is::<Diagnostic>())
}
