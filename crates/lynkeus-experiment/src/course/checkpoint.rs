//! A replay that goes on where it was killed.
//!
//! The file is only ever appended to: a head that tells observer and log, then records, each with
//! the rows since the one before, a snapshot of the estimator and a checksum. A record that a kill
//! cut short is left out when the file is read.

use std::fs::{File, OpenOptions, TryLockError};
use std::io::{self, BufReader, Read, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use lynkeus_run::filter::SensorHealth;
use lynkeus_run::{Digest, Error as RunError, Estimator};

use crate::course::trace::Trace;
use crate::course::{Course, Samples};
use crate::{Error, Series};

const MAGIC: &[u8; 8] = b"LYNKCHK2";
/// Magic, fingerprint of the observer, digest of the log.
const HEAD: usize = 24;
/// Between two records.
const EVERY: Duration = Duration::from_millis(200);

/// The health of the sensors half-way through the rows.
#[derive(Clone, Debug, Default)]
pub(crate) struct Halfway {
    pub sensors: Vec<SensorHealth>,
    /// the estimator then, where there is a checkpoint; empty before
    pub snapshot: Vec<u8>,
}

impl Halfway {
    pub fn at(estimator: &Estimator, has_checkpoint: bool) -> Self {
        let snapshot = has_checkpoint.then(|| estimator.snapshot());
        Self {
            sensors: estimator.health().sensors.clone(),
            snapshot: snapshot.unwrap_or_default(),
        }
    }

    /// From the snapshot alone.
    pub fn restored(snapshot: Vec<u8>, estimator: &Estimator) -> Result<Self, RunError> {
        if snapshot.is_empty() {
            return Ok(Self::default());
        }
        let mut then = estimator.clone();
        then.restore(&snapshot)?;
        Ok(Self {
            sensors: then.health().sensors.clone(),
            snapshot,
        })
    }
}

/// Where a replay is kept while it runs.
#[derive(Debug)]
pub struct Checkpoint {
    path: PathBuf,
    file: Option<File>,
    /// rows in the file
    rows: usize,
    resumed: usize,
    told: Instant,
    /// that of a run beside the first
    beside: Option<Box<Checkpoint>>,
}

impl Checkpoint {
    /// In this file, which is made where it does not exist.
    pub fn new(path: impl Into<PathBuf>) -> Self {
        Self {
            path: path.into(),
            file: None,
            rows: 0,
            resumed: 0,
            told: Instant::now(),
            beside: None,
        }
    }

    /// That of a run which judges this one, in a file of its own.
    pub(crate) fn beside(&mut self) -> &mut Self {
        let mut path = self.path.clone().into_os_string();
        path.push(".judged");
        self.beside.get_or_insert_with(|| Box::new(Self::new(path)))
    }

    /// After how many rows the replay went on; 0 where it began anew.
    pub fn resumed(&self) -> usize {
        self.resumed
    }

    /// The replay is over, and its result written: the file is removed.
    ///
    /// # Errors
    /// The file cannot be removed.
    pub fn remove(self) -> Result<(), Error> {
        if let Some(beside) = self.beside {
            beside.remove()?;
        }
        match self.file {
            None => Ok(()),
            Some(_) => std::fs::remove_file(&self.path).map_err(|e| {
                Error::input(format!("cannot remove the checkpoint: {e}")).at(self.path.display())
            }),
        }
    }

    /// Whether it is time for another record.
    pub(crate) fn is_due(&self) -> bool {
        self.told.elapsed() >= EVERY
    }

    /// Opens the file, and goes to where its last whole record ends; the number of rows done.
    ///
    /// # Errors
    /// The file cannot be read or written, is no checkpoint, or one of another study or log.
    pub(crate) fn resume(
        &mut self,
        estimator: &mut Estimator,
        samples: &Samples,
        course: &mut Course,
        half: &mut Halfway,
    ) -> Result<usize, Error> {
        let mut file = open(&self.path)?;
        let head = Head::of(estimator, samples);
        let failed = |e: &io::Error| unusable(&self.path, e);
        let mut found = vec![];
        let read = Read::by_ref(&mut file)
            .take(HEAD as u64)
            .read_to_end(&mut found);
        read.map_err(|e| failed(&e))?;
        let own = head.bytes();
        let mut end = HEAD as u64;
        if found.len() < HEAD {
            // a kill in the middle of the head
            if !own.starts_with(&found) {
                return Err(self.foreign());
            }
            file.set_len(0).map_err(|e| failed(&e))?;
            file.rewind().map_err(|e| failed(&e))?;
            file.write_all(&own).map_err(|e| failed(&e))?;
        } else {
            self.check(&found, &own)?;
            let length = file.metadata().map_err(|e| failed(&e))?.len();
            let mut records = Records {
                input: BufReader::new(&file),
                left: length - HEAD as u64,
            };
            while let Some((record, size)) = records.next().map_err(|e| failed(&e))? {
                self.rows = record
                    .take(self.rows, estimator, course, half)
                    .ok_or_else(|| self.foreign())?;
                end += size;
            }
        }
        // what a kill cut short
        file.set_len(end).map_err(|e| failed(&e))?;
        file.seek(SeekFrom::End(0)).map_err(|e| failed(&e))?;
        self.file = Some(file);
        self.resumed = self.rows;
        self.told = Instant::now();
        Ok(self.rows)
    }

    fn check(&self, found: &[u8], own: &[u8]) -> Result<(), Error> {
        if !found.starts_with(MAGIC) {
            return Err(self.foreign());
        }
        let of = match (found[8..16] == own[8..16], found[16..] == own[16..]) {
            (true, true) => return Ok(()),
            (true, false) => "of another log",
            (false, true) => "of another study, or of another version of it",
            (false, false) => "of another study and log",
        };
        Err(Error::input(format!("the checkpoint is {of}"))
            .at(self.path.display())
            .hint("name another file, or remove this one to start again"))
    }

    fn foreign(&self) -> Error {
        Error::input("the file is no checkpoint of this command: it stays as it is")
            .at(self.path.display())
            .hint("name another file after --checkpoint")
    }

    /// Appends the rows since the last record, and where the estimator is.
    ///
    /// # Errors
    /// The file cannot be written, or rows were lost.
    pub(crate) fn keep(
        &mut self,
        estimator: &Estimator,
        course: &Course,
        half: &Halfway,
    ) -> Result<(), Error> {
        let rows = columns(course).next().map_or(0, Series::len);
        let mut payload = vec![];
        for part in [&half.snapshot, &estimator.snapshot()] {
            payload.extend_from_slice(&(part.len() as u64).to_le_bytes());
            payload.extend_from_slice(part);
        }
        for trace in course.traces.iter().chain(&course.settled) {
            let numbers = trace.numbers();
            payload.extend_from_slice(&(8 * numbers.len() as u64).to_le_bytes());
            payload.extend(numbers.iter().flat_map(|x| x.to_le_bytes()));
        }
        payload.extend_from_slice(&(rows as u64).to_le_bytes());
        for column in columns(course) {
            for x in column.iter_from(self.rows) {
                payload.extend_from_slice(&x.to_le_bytes());
            }
        }
        // what a resumed run would take for its own rows
        course.check()?;
        let mut record = (payload.len() as u64).to_le_bytes().to_vec();
        record.extend_from_slice(&payload);
        record.extend_from_slice(&sum(&payload).to_le_bytes());
        if let Some(file) = &mut self.file {
            let written = file.write_all(&record).and_then(|()| file.sync_data());
            written.map_err(|e| unusable(&self.path, &e))?;
        }
        self.rows = rows;
        self.told = Instant::now();
        Ok(())
    }
}

/// What every record has rows of.
fn columns(course: &Course) -> impl Iterator<Item = &Series> {
    let deviations = course.deviations.iter().flatten();
    course
        .estimates
        .iter()
        .chain(&course.monitors)
        .chain(deviations)
        .chain(&course.innovations)
        .chain(&course.effective)
}

fn columns_mut(course: &mut Course) -> impl Iterator<Item = &mut Series> {
    let deviations = course.deviations.iter_mut().flatten();
    course
        .estimates
        .iter_mut()
        .chain(&mut course.monitors)
        .chain(deviations)
        .chain(&mut course.innovations)
        .chain(&mut course.effective)
}

/// Whose replay it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct Head {
    observer: u64,
    log: u64,
}

impl Head {
    fn of(estimator: &Estimator, samples: &Samples) -> Self {
        let mut log = Digest::default();
        for column in std::iter::once(&samples.time).chain(samples.columns()) {
            log.word(column.len() as u64);
            column.iter().for_each(|x| log.word(x.to_bits()));
        }
        Self {
            observer: estimator.fingerprint(),
            log: log.value(),
        }
    }

    fn bytes(self) -> Vec<u8> {
        let words = [self.observer, self.log];
        let words = words.iter().flat_map(|w| w.to_le_bytes());
        MAGIC.iter().copied().chain(words).collect()
    }
}

fn sum(payload: &[u8]) -> u64 {
    let mut digest = Digest::default();
    digest.bytes(payload);
    digest.value()
}

/// Whole records, one after the other.
struct Records<R> {
    input: R,
    /// bytes that the file still has
    left: u64,
}

struct Record {
    payload: Vec<u8>,
}

impl<R: Read> Records<R> {
    /// The next record and its size in the file; none where there is none, or not all of it.
    fn next(&mut self) -> io::Result<Option<(Record, u64)>> {
        if self.left < 16 {
            return Ok(None);
        }
        let length = self.word()?;
        if length > self.left - 16 {
            return Ok(None);
        }
        let mut payload = vec![];
        (&mut self.input).take(length).read_to_end(&mut payload)?;
        let is_whole = self.word()? == sum(&payload) && payload.len() as u64 == length;
        self.left -= length + 16;
        Ok(is_whole.then_some((Record { payload }, length + 16)))
    }

    fn word(&mut self) -> io::Result<u64> {
        let mut bytes = [0; 8];
        self.input.read_exact(&mut bytes)?;
        Ok(u64::from_le_bytes(bytes))
    }
}

impl Record {
    /// Adds its rows to the course; how many there are then. None where it does not fit.
    fn take(
        &self,
        rows: usize,
        estimator: &mut Estimator,
        course: &mut Course,
        half: &mut Halfway,
    ) -> Option<usize> {
        let (halfway, rest) = part(&self.payload)?;
        let (snapshot, mut rest) = part(rest)?;
        for trace in course.traces.iter_mut().chain(&mut course.settled) {
            let (own, others) = part(rest)?;
            *trace = Trace::of(&numbers_of(own))?;
            rest = others;
        }
        let (until, mut numbers) = rest.split_first_chunk()?;
        let until = usize::try_from(u64::from_le_bytes(*until)).ok()?;
        for column in columns_mut(course) {
            let size = until.checked_sub(rows)?.checked_mul(8)?;
            let (own, others) = numbers.split_at_checked(size)?;
            numbers_of(own).iter().for_each(|x| column.push(*x));
            numbers = others;
        }
        estimator.restore(snapshot).ok()?;
        *half = Halfway::restored(halfway.to_vec(), estimator).ok()?;
        numbers.is_empty().then_some(until)
    }
}

fn numbers_of(bytes: &[u8]) -> Vec<f64> {
    let read = bytes.chunks_exact(8).filter_map(|x| x.try_into().ok());
    read.map(f64::from_le_bytes).collect()
}

/// Bytes with their length before them, and what follows.
fn part(bytes: &[u8]) -> Option<(&[u8], &[u8])> {
    let (length, rest) = bytes.split_first_chunk()?;
    rest.split_at_checked(usize::try_from(u64::from_le_bytes(*length)).ok()?)
}

/// The file, for this run alone.
fn open(path: &Path) -> Result<File, Error> {
    let mut options = OpenOptions::new();
    options.read(true).write(true).create(true).truncate(false);
    let file = options.open(path).map_err(|e| unusable(path, &e))?;
    match file.try_lock() {
        Err(TryLockError::WouldBlock) => {
            Err(Error::input("another run is using this checkpoint").at(path.display()))
        }
        // some network folders have no locks
        Ok(()) | Err(TryLockError::Error(_)) => Ok(file),
    }
}

fn unusable(path: &Path, error: &io::Error) -> Error {
    Error::input(format!("cannot use the checkpoint: {error}")).at(path.display())
}
