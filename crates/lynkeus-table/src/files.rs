//! Reading whole text files, with errors that name the file.

use std::fs::File;
use std::io::{self, Read};
use std::path::Path;

use lynkeus_answer::Error;

/// Bytes of the largest text that is read whole.
const LARGEST: u64 = 64 << 20;

/// The text of a file; `what` says in messages what the file is for.
pub fn read_text(path: &Path, what: &str) -> Result<String, Error> {
    let mut bytes = vec![];
    let mut file = open(path, what)?.take(LARGEST + 1);
    file.read_to_end(&mut bytes)
        .map_err(|e| unreadable(path, what, &e))?;
    if bytes.len() as u64 > LARGEST {
        return Err(Error::input(format!(
            "the {what} file has more than {LARGEST} bytes: it is none"
        ))
        .at(path.display()));
    }
    let text = String::from_utf8(bytes).map_err(|e| {
        let good = e.utf8_error().valid_up_to();
        let line = e
            .as_bytes()
            .iter()
            .take(good)
            .filter(|b| **b == b'\n')
            .count()
            + 1;
        Error::input(format!(
            "the {what} file must be UTF-8 text, found other bytes"
        ))
        .at(format!("{}:{line}", path.display()))
        .hint("save it as UTF-8")
    })?;
    Ok(match text.strip_prefix('\u{feff}') {
        Some(rest) => rest.to_owned(),
        None => text,
    })
}

/// A file or a stream opened for reading; a folder is refused.
pub fn open(path: &Path, what: &str) -> Result<File, Error> {
    let file = File::open(path).map_err(|e| unreadable(path, what, &e))?;
    match file.metadata() {
        Ok(data) if data.is_dir() => Err(Error::input(format!(
            "expected a {what} file, found the folder {}",
            path.display()
        ))
        .hint("name a file in it")),
        _ => Ok(file),
    }
}

/// Whether a path names a pipe or a device: what is there may come at any time, or never.
pub fn is_stream(path: &Path) -> bool {
    std::fs::metadata(path).is_ok_and(|data| !data.is_file() && !data.is_dir())
}

/// Refuses a path that names no file; `named_in` is the file that names it.
pub fn must_exist(path: &Path, what: &str, named_in: &str) -> Result<(), Error> {
    match std::fs::metadata(path) {
        Ok(data) if data.is_file() => Ok(()),
        Ok(_) => {
            Err(Error::input(format!("the {what} {} is not a file", path.display())).at(named_in))
        }
        Err(e) => Err(unreadable(path, what, &e).at(named_in)),
    }
}

fn unreadable(path: &Path, what: &str, error: &io::Error) -> Error {
    let path = path.display();
    match error.kind() {
        io::ErrorKind::NotFound => {
            Error::input(format!("no {what} file at {path}")).hint("check the path")
        }
        _ => Error::input(format!("cannot read the {what} file {path}: {error}")),
    }
}
