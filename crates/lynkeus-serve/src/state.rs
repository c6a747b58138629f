//! The file in which a service keeps its state: a snapshot, then the rows since, each batch before it is answered.
//!
//! It is only ever appended to, or written anew beside itself and renamed. A record that a kill or a full disk cut short
//! is left out when the file is read: it was not answered.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};

use lynkeus::Error;
use lynkeus::run::Digest;

use crate::bytes::Parser;

const MAGIC: &[u8; 8] = b"LYNKSRV1";
/// Length, kind and checksum before each record.
const HEAD: usize = 24;
/// Rows since the snapshot take at least so many bytes before it is written anew.
const LONG: u64 = 8 << 20;
/// Or so many times those of the snapshot.
const TIMES: u64 = 4;

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// all assets
    Snapshot,
    /// rows since
    Rows,
}

/// A record: what it holds, and its bytes.
pub(crate) type Record<'b> = (Kind, &'b [u8]);

/// The file, open and locked.
#[derive(Debug)]
pub(crate) struct State {
    path: PathBuf,
    file: File,
    /// of its whole records
    length: u64,
    /// at which it is written anew
    due: u64,
    /// nobody else has it while this is open
    _lock: File,
}

impl State {
    /// Opens and reads it; it is made where it is not there.
    ///
    /// # Errors
    /// Another program has it; it cannot be read or written.
    pub fn open(path: &Path) -> Result<(Self, Vec<u8>), Error> {
        let failed = |error: io::Error| Self::unusable(path, &error);
        let lock = beside(path, ".lock");
        let mut options = OpenOptions::new();
        options.read(true).write(true).create(true).truncate(false);
        let lock = options.open(lock).map_err(failed)?;
        match lock.try_lock() {
            Ok(()) => {}
            Err(TryLockError::WouldBlock) => {
                return Err(Error::input("another program keeps its state here")
                    .at(path.display())
                    .hint(
                        "end the other `lynkeus serve`, or name another file as `state` of [serve]",
                    ));
            }
            Err(TryLockError::Error(error)) => return Err(failed(error)),
        }
        let mut file = options.open(path).map_err(failed)?;
        let mut bytes = vec![];
        file.read_to_end(&mut bytes).map_err(failed)?;
        let state = Self {
            path: path.to_owned(),
            file,
            length: bytes.len() as u64,
            due: LONG,
            _lock: lock,
        };
        Ok((state, bytes))
    }

    /// Its whole records.
    ///
    /// # Errors
    /// It is no state.
    pub fn records<'b>(path: &Path, bytes: &'b [u8]) -> Result<Vec<Record<'b>>, Error> {
        let mut records = vec![];
        let Some(mut rest) = bytes.strip_prefix(MAGIC) else {
            // a kill before there was anything in it
            return match MAGIC.starts_with(bytes) {
                true => Ok(records),
                false => Err(Error::input(
                    "this is no state of `lynkeus serve`, or one of another version",
                )
                .at(path.display())
                .hint("move it away, or name another file as `state` of [serve]")),
            };
        };
        while let Some((record, after)) = record(rest) {
            records.push(record);
            rest = after;
        }
        Ok(records)
    }

    /// Appends rows, and waits until they are on the disk.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was.
    pub fn append(&mut self, rows: &[u8]) -> io::Result<()> {
        let framed = framed(Kind::Rows, rows);
        let done = self.file.seek(SeekFrom::Start(self.length));
        let done = done.and_then(|_| self.file.write_all(&framed));
        match done.and_then(|()| self.file.sync_data()) {
            Ok(()) => {
                self.length += framed.len() as u64;
                Ok(())
            }
            Err(error) => {
                // where this fails the next record is written over it
                let _ = self.file.set_len(self.length);
                Err(error)
            }
        }
    }

    /// Whether it is time to write it anew.
    pub fn is_due(&self) -> bool {
        self.length >= self.due
    }

    /// It could not be written anew: later.
    pub fn put_off(&mut self) {
        self.due = self.length + LONG;
    }

    /// Writes it anew beside itself, with this snapshot alone, and puts that in its place.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was.
    pub fn renew(&mut self, snapshot: &[u8]) -> io::Result<()> {
        let new = beside(&self.path, ".new");
        let done = written(&new, snapshot).and_then(|made| {
            std::fs::rename(&new, &self.path)?;
            Ok(made)
        });
        match done {
            Ok((file, length)) => {
                (self.file, self.length) = (file, length);
                self.due = length + LONG.max(TIMES * length);
                Ok(())
            }
            Err(error) => {
                // it may never have been made
                let _ = std::fs::remove_file(&new);
                Err(error)
            }
        }
    }

    pub fn unusable(path: &Path, error: &io::Error) -> Error {
        Error::input(format!("cannot keep the state: {error}")).at(path.display())
    }

    pub fn damaged(path: &Path) -> Error {
        Error::input("the state is damaged, or of another version")
            .at(path.display())
            .hint("go back to a copy of it, or move it away and begin anew")
    }
}

/// A new file with a snapshot, on the disk, and its length.
fn written(path: &Path, snapshot: &[u8]) -> io::Result<(File, u64)> {
    let framed = framed(Kind::Snapshot, snapshot);
    let mut options = OpenOptions::new();
    let mut file = options
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(path)?;
    file.write_all(MAGIC)?;
    file.write_all(&framed)?;
    file.sync_all()?;
    // the name is to last, too; not every system has folders that can be opened
    if let Some(folder) = path.parent().map(|f| {
        if f.as_os_str().is_empty() {
            Path::new(".")
        } else {
            f
        }
    }) && let Ok(folder) = File::open(folder)
    {
        let _ = folder.sync_all();
    }
    Ok((file, (MAGIC.len() + framed.len()) as u64))
}

fn beside(path: &Path, ending: &str) -> PathBuf {
    let mut name = path.to_owned().into_os_string();
    name.push(ending);
    PathBuf::from(name)
}

fn framed(kind: Kind, record: &[u8]) -> Vec<u8> {
    let mut framed = Vec::with_capacity(HEAD + record.len());
    for word in [record.len() as u64, kind as u64, checksum(kind, record)] {
        framed.extend_from_slice(&word.to_le_bytes());
    }
    framed.extend_from_slice(record);
    framed
}

/// The first record, and what is after it; none where it is not whole.
fn record(bytes: &[u8]) -> Option<(Record<'_>, &[u8])> {
    let mut head = Parser(bytes);
    let length = usize::try_from(head.word()?).ok()?;
    let kind = match head.word()? {
        0 => Kind::Snapshot,
        1 => Kind::Rows,
        _ => return None,
    };
    let sum = head.word()?;
    let (record, rest) = head.0.split_at_checked(length)?;
    (checksum(kind, record) == sum).then_some(((kind, record), rest))
}

fn checksum(kind: Kind, record: &[u8]) -> u64 {
    let mut digest = Digest::default();
    digest.word(kind as u64);
    digest.bytes(record);
    digest.value()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// What is cut short anywhere loses the last record alone, and one flipped bit is seen.
    #[test]
    fn a_record_that_is_not_whole_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.state");
        let (mut state, bytes) = State::open(&path).unwrap();
        assert!(bytes.is_empty());
        state.renew(b"all").unwrap();
        state.append(b"first").unwrap();
        state.append(b"second row").unwrap();
        drop(state);
        let whole = std::fs::read(&path).unwrap();
        let kinds = |bytes: &[u8]| -> Vec<Vec<u8>> {
            let records = State::records(&path, bytes).unwrap();
            records.into_iter().map(|(_, r)| r.to_vec()).collect()
        };
        assert_eq!(kinds(&whole), [&b"all"[..], b"first", b"second row"]);
        let last = whole.len() - HEAD - b"second row".len();
        for length in last..whole.len() {
            assert_eq!(kinds(&whole[..length]).len(), 2);
        }
        for bit in 8 * last..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(kinds(&flipped).len(), 2, "bit {bit}");
        }
    }

    #[test]
    fn nobody_else_has_it() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.state");
        let first = State::open(&path).unwrap();
        let error = State::open(&path).unwrap_err().to_string();
        assert!(
            error.contains("another program keeps its state here"),
            "{error}"
        );
        drop(first);
        State::open(&path).unwrap();
    }
}
