//! The file in which a service keeps its state: a snapshot, and the rows since, each batch before it is answered.
//!
//! It is only ever appended to, or written anew beside itself and renamed. A record that a kill or a full disk cut short
//! is left out when the file is read: it was not answered. Rows go on while it is written anew, asset by asset, by a
//! thread: each asset says up to which row it is, and the rows since the first one stand between them.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufWriter, IntoInnerError, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::{self, JoinHandle};

use lynkeus::Error;
use lynkeus::run::Digest;
use lynkeus::table::Instant;

use crate::bytes::{Parser, beside};
use crate::history::now;

const MAGIC: &[u8; 8] = b"LYNKSRV3";
/// Length, kind and checksum before each record.
const HEAD: usize = 24;
/// Rows since the snapshot take at least so many bytes before it is written anew.
const LONG: u64 = 8 << 20;
/// Or so many times those of the snapshot.
const TIMES: u64 = 4;

/// What a record holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Kind {
    /// all assets are there: what else there is to know
    End,
    /// rows
    Rows,
    /// an asset
    Asset,
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
    /// under way
    renewal: Option<Renewal>,
    /// nobody else has it while this is open
    _lock: File,
}

/// The file as it is written anew, beside the one that is there.
#[derive(Debug)]
struct Renewal {
    /// to the thread that writes it; none once all is there
    to: Option<Sender<Piece>>,
    worker: JoinHandle<io::Result<(File, u64)>>,
    /// rows since all was there
    rest: Vec<u8>,
}

/// What goes into it.
#[derive(Debug)]
enum Piece {
    Record(Vec<u8>),
    /// of another file, which has to be on the disk before
    Other(File),
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
            renewal: None,
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
                self.pass_on(framed);
                Ok(())
            }
            Err(error) => {
                // where this fails the next record is written over it
                let _ = self.file.set_len(self.length);
                Err(error)
            }
        }
    }

    /// Leaves the file as it is under another name, which has the time; the name.
    ///
    /// # Errors
    /// The disk is full, or failed.
    pub fn set_aside(&self) -> io::Result<PathBuf> {
        let time = Instant::at(now(), true).to_string();
        let time = time.split('.').next().unwrap_or_default();
        let time = time.trim_end_matches('Z').replace(':', "-");
        let aside = beside(&self.path, &format!(".{time}"));
        // it is written anew beside itself: another name is enough where a file may have two
        if std::fs::hard_link(&self.path, &aside).is_err() {
            std::fs::copy(&self.path, &aside)?;
        }
        Ok(aside)
    }

    /// Whether it is time to write it anew.
    pub fn is_due(&self) -> bool {
        self.length >= self.due && self.renewal.is_none()
    }

    /// Begins to write it anew.
    pub fn renew(&mut self) {
        let (to, pieces) = channel();
        let new = beside(&self.path, ".new");
        self.renewal = Some(Renewal {
            to: Some(to),
            worker: thread::spawn(move || written(&new, &pieces)),
            rest: vec![],
        });
    }

    /// Adds an asset.
    pub fn add(&mut self, asset: &[u8]) {
        self.pass_on(framed(Kind::Asset, asset));
    }

    /// All assets are there; the other file has to be on the disk as it is now.
    pub fn complete(&mut self, end: &[u8], other: Option<File>) {
        if let Some(Renewal { to: Some(to), .. }) = &self.renewal
            && let Some(other) = other
        {
            // a thread that ended says why
            let _ = to.send(Piece::Other(other));
        }
        self.pass_on(framed(Kind::End, end));
        if let Some(renewal) = &mut self.renewal {
            renewal.to = None;
        }
    }

    fn pass_on(&mut self, framed: Vec<u8>) {
        match &mut self.renewal {
            Some(Renewal { to: Some(to), .. }) => {
                // a thread that ended says why
                let _ = to.send(Piece::Record(framed));
            }
            Some(Renewal { rest, .. }) => rest.extend_from_slice(&framed),
            None => {}
        }
    }

    /// Puts the new file in the place of the old one, if it is written by now; whether it did.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was, and grows for a while.
    pub fn settle(&mut self) -> io::Result<bool> {
        match &self.renewal {
            Some(renewal) if renewal.worker.is_finished() => self.wait(),
            _ => Ok(false),
        }
    }

    /// It is time to write it anew, whatever there is in it.
    pub fn make_due(&mut self) {
        self.due = 0;
    }

    /// The same, once it is written.
    ///
    /// # Errors
    /// As [`settle`](Self::settle).
    pub fn wait(&mut self) -> io::Result<bool> {
        let Some(Renewal { worker, rest, .. }) = self.renewal.take() else {
            return Ok(false);
        };
        let new = beside(&self.path, ".new");
        let failed = |_| Err(io::Error::other("the thread that writes it failed"));
        let done = worker.join().unwrap_or_else(failed);
        let done = done.and_then(|(mut file, length)| {
            file.write_all(&rest)?;
            file.sync_data()?;
            std::fs::rename(&new, &self.path)?;
            Ok((file, length + rest.len() as u64))
        });
        match done {
            Ok((file, length)) => {
                name_lasts(&self.path);
                (self.file, self.length) = (file, length);
                self.due = length + LONG.max(TIMES * length);
                Ok(true)
            }
            Err(error) => {
                self.due = self.length + LONG;
                // it may never have been made
                let _ = std::fs::remove_file(&new);
                Err(error)
            }
        }
    }

    /// Leaves it as a kill does.
    #[cfg(test)]
    pub fn kill(mut self) {
        if let Some(Renewal { to, worker, .. }) = self.renewal.take() {
            drop(to);
            let _ = worker.join();
        }
    }

    pub fn unusable(path: &Path, error: &io::Error) -> Error {
        Error::input(format!("cannot keep the state: {error}")).at(path.display())
    }

    pub fn damaged(path: &Path) -> Error {
        Error::input("the state is damaged, or of another version")
            .at(path.display())
            .hint("go back to a copy of it, or move it away and start again")
    }
}

/// A new file with all pieces, on the disk, and its length.
fn written(path: &Path, pieces: &Receiver<Piece>) -> io::Result<(File, u64)> {
    let mut options = OpenOptions::new();
    let file = options
        .read(true)
        .write(true)
        .create(true)
        .truncate(true)
        .open(path)?;
    let mut to = BufWriter::new(file);
    to.write_all(MAGIC)?;
    let mut length = MAGIC.len();
    for piece in pieces {
        match piece {
            Piece::Record(framed) => {
                to.write_all(&framed)?;
                length += framed.len();
            }
            Piece::Other(file) => file.sync_data()?,
        }
    }
    let file = to.into_inner().map_err(IntoInnerError::into_error)?;
    file.sync_all()?;
    Ok((file, length as u64))
}

/// The name of a file is to last, too; not every system has folders that can be opened.
fn name_lasts(path: &Path) {
    let folder = path.parent().filter(|f| !f.as_os_str().is_empty());
    if let Ok(folder) = File::open(folder.unwrap_or(Path::new("."))) {
        let _ = folder.sync_all();
    }
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
        0 => Kind::End,
        1 => Kind::Rows,
        2 => Kind::Asset,
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
        state.renew();
        state.add(b"all");
        state.complete(b"end", None);
        state.wait().unwrap();
        state.append(b"first").unwrap();
        state.append(b"second row").unwrap();
        drop(state);
        let whole = std::fs::read(&path).unwrap();
        let kinds = |bytes: &[u8]| -> Vec<Vec<u8>> {
            let records = State::records(&path, bytes).unwrap();
            records.into_iter().map(|(_, r)| r.to_vec()).collect()
        };
        assert_eq!(
            kinds(&whole),
            [&b"all"[..], b"end", b"first", b"second row"]
        );
        let last = whole.len() - HEAD - b"second row".len();
        for length in last..whole.len() {
            assert_eq!(kinds(&whole[..length]).len(), 3);
        }
        for bit in 8 * last..8 * whole.len() {
            let mut flipped = whole.clone();
            flipped[bit / 8] ^= 1 << (bit % 8);
            assert_eq!(kinds(&flipped).len(), 3, "bit {bit}");
        }
    }

    /// Rows that come while it is written anew are in the old file and in the new one.
    #[test]
    fn rows_go_on_while_it_is_written_anew() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("a.state");
        let (mut state, _) = State::open(&path).unwrap();
        state.renew();
        state.complete(b"nothing", None);
        state.wait().unwrap();
        let records = || {
            let bytes = std::fs::read(&path).unwrap();
            let records = State::records(&path, &bytes).unwrap();
            let all = records.into_iter().map(|(_, r)| r.to_vec());
            String::from_utf8(all.collect::<Vec<_>>().join(&b' ')).unwrap()
        };
        state.append(b"1").unwrap();
        state.renew();
        state.add(b"one");
        state.append(b"2").unwrap();
        state.add(b"two");
        state.complete(b"end", Some(File::open(&path).unwrap()));
        state.append(b"3").unwrap();
        assert_eq!(records(), "nothing 1 2 3");
        state.wait().unwrap();
        assert_eq!(records(), "one 2 two end 3");
        state.append(b"4").unwrap();
        assert_eq!(records(), "one 2 two end 3 4");
        // there is no folder any more in which to write it anew
        let elsewhere = folder.path().join("moved");
        state.path = elsewhere.join("a.state");
        state.renew();
        state.complete(b"end", None);
        assert!(state.wait().is_err());
        state.append(b"5").unwrap();
        assert_eq!(records(), "one 2 two end 3 4 5");
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
