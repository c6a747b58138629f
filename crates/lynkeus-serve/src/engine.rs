//! Rows of many assets to their estimators: kept first, then taken, then answered.

use std::collections::HashMap;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::thread;

use lynkeus::Error;
use lynkeus::stream::Stream;

use crate::asset::{Asset, Line};
use crate::bytes::{Parser, Writer};
use crate::history::{History, now};
use crate::row::Stamp;
use crate::state::{Kind, State};

/// Rows that are taken together, at most.
pub const BATCH: usize = 256;
/// Of so many rows it is known what was told of them, so that one that comes once more is answered as before. A client
/// that lost its connection sends again what it has no answer to: what was on its way to it (a pipe holds 64 KiB), and
/// a batch.
const KEPT: u64 = 4096;
/// Fewer rows are over before other threads have begun.
const WORTHWHILE: usize = 32;

/// A row of an asset.
#[derive(Clone, Debug)]
pub struct Arrival {
    /// its place, as of [`Engine::place`]
    pub asset: usize,
    /// when it was sampled
    pub stamp: Stamp,
    /// by channel, NaN where there is none
    pub values: Vec<f64>,
}

/// The estimators of all assets.
#[derive(Debug)]
pub struct Engine {
    assets: Vec<Asset>,
    names: Vec<String>,
    places: HashMap<String, usize>,
    /// rows so far
    sequence: u64,
    threads: usize,
    state: Option<State>,
    history: Option<History>,
    /// what the user should know of how it began
    notes: Vec<String>,
}

/// What became of a row: lines, or why it was not taken.
pub type Answer = Result<Vec<Line>, String>;

impl Engine {
    /// Of assets by their names, each with its study; one without a name where there is only one.
    #[must_use]
    pub fn new(assets: Vec<(String, Arc<Stream>)>) -> Self {
        let places = assets.iter().enumerate();
        Self {
            places: places.map(|(i, (name, _))| (name.clone(), i)).collect(),
            names: assets.iter().map(|(name, _)| name.clone()).collect(),
            assets: assets
                .into_iter()
                .map(|(_, stream)| Asset::new(stream))
                .collect(),
            sequence: 0,
            threads: thread::available_parallelism().map_or(1, NonZero::get),
            state: None,
            history: None,
            notes: vec![],
        }
    }

    /// Writes what is told to these files, one for each day: `%Y`, `%m` and `%d` of a path are its date. So many days
    /// are kept, if any number is said. Where there is a [state](Self::keep), this comes before it.
    pub fn write_history(&mut self, pattern: &Path, keep: Option<u64>) {
        let has_assets = self.place("").is_none();
        let stream = self.assets.first().map(Asset::stream);
        self.history = stream.map(|stream| History::new(pattern, keep, stream, has_assets));
    }

    /// Goes on where this file says that it was, and keeps what it is given there from here on. A file that is not
    /// there is made.
    ///
    /// # Errors
    /// Another program has it, it cannot be read or written, it is none, or one of another study.
    pub fn keep(&mut self, path: &Path) -> Result<(), Error> {
        let (state, bytes) = State::open(path)?;
        if let Some(history) = &mut self.history {
            history.begin().map_err(|error| unwritten(&error))?;
        }
        for (kind, record) in State::records(path, &bytes)? {
            let known = match kind {
                Kind::Snapshot => self.load(record, path)?,
                Kind::Rows => self.again(record),
            };
            if known.is_none() {
                return Err(State::damaged(path));
            }
        }
        if self.sequence > 0 {
            let text = format!("went on after row {} of {}", self.sequence, path.display());
            self.notes.push(text);
        }
        self.state = Some(state);
        if let Some(history) = &mut self.history {
            history.is_up_to_date();
        }
        self.renew().map_err(|error| State::unusable(path, &error))
    }

    /// What the user should know of how it began.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The estimators of all assets, into a record of the state.
    fn snapshot(&self) -> Vec<u8> {
        let mut to = Writer::default();
        to.word(self.sequence);
        to.word(self.assets.len() as u64);
        for (name, asset) in self.names.iter().zip(&self.assets) {
            to.bytes(name.as_bytes());
            to.word(asset.fingerprint());
            let mut own = Writer::default();
            asset.save(&mut own);
            to.bytes(&own.0);
        }
        if let Some(history) = &self.history {
            history.save(&mut to);
        }
        to.0
    }

    /// What a snapshot says of the assets that there are; none where it is damaged.
    fn load(&mut self, record: &[u8], path: &Path) -> Result<Option<()>, Error> {
        let mut from = Parser(record);
        let head = |from: &mut Parser<'_>| Some((from.word()?, from.count(24)?));
        let Some((sequence, count)) = head(&mut from) else {
            return Ok(None);
        };
        self.sequence = sequence;
        for _ in 0..count {
            let Some((name, fingerprint, own)) = saved(&mut from) else {
                return Ok(None);
            };
            let Some(asset) = self.place(&name).and_then(|i| self.assets.get_mut(i)) else {
                let text =
                    format!("the state of \"{name}\" is left out: no asset is called so any more");
                self.notes.push(text);
                continue;
            };
            if asset.fingerprint() != fingerprint {
                let of = if name.is_empty() {
                    String::new()
                } else {
                    format!(" of \"{name}\"")
                };
                let message = format!(
                    "this is the state{of} of another study: its plant, its observer, its numbers or the names of its columns differ"
                );
                return Err(Error::input(message).at(path.display()).hint(
                    "go back to the study that made it, or move the file away and begin anew",
                ));
            }
            if asset.load(&mut Parser(own)).is_none() {
                return Ok(None);
            }
        }
        match &mut self.history {
            // there was no history so far
            Some(_) if from.0.is_empty() => {}
            Some(history) => match history.load(&mut from) {
                None => return Ok(None),
                Some(done) => done.map_err(|error| unwritten(&error))?,
            },
            None => {}
        }
        Ok(Some(()))
    }

    /// Rows that were kept and are taken once more.
    fn again(&mut self, record: &[u8]) -> Option<()> {
        let mut from = Parser(record);
        let came = i128::from(from.word()? as i64);
        let mut rows = vec![];
        for _ in 0..from.count(32)? {
            rows.push(Arrival {
                asset: usize::try_from(from.word()?).ok()?,
                stamp: Stamp::load(&mut from)?,
                values: from.numbers()?,
            });
        }
        self.apply(&rows, came);
        Some(())
    }

    /// Writes the state anew, so that little has to be gone over again.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was.
    fn renew(&mut self) -> std::io::Result<()> {
        if let Some(history) = &mut self.history {
            history.sync()?;
        }
        let snapshot = self.snapshot();
        match &mut self.state {
            Some(state) => state.renew(&snapshot),
            None => Ok(()),
        }
    }

    /// The end of all: the next start has nothing to go over again.
    pub fn close(&mut self) {
        // the rows are on the disk in any case
        let _ = self.renew();
    }

    /// The place of an asset; none where nobody is called so.
    #[must_use]
    pub fn place(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Takes rows in their order, at most `BATCH`, and keeps them before they are answered.
    pub fn take(&mut self, rows: &[Arrival]) -> Vec<Answer> {
        if rows.is_empty() {
            return vec![];
        }
        let came = now();
        match self.write_down(rows, came) {
            Ok(()) => {}
            Err(why) if rows.len() == 1 => return vec![Err(why)],
            // there may be room for some of them
            Err(_) => {
                let (some, others) = rows.split_at(rows.len() / 2);
                return [self.take(some), self.take(others)].concat();
            }
        }
        let answers = self.apply(rows, came);
        if self.state.as_ref().is_some_and(State::is_due)
            && self.renew().is_err()
            && let Some(state) = &mut self.state
        {
            // it goes on with the longer file, and tries again later
            state.put_off();
        }
        answers
    }

    /// Before they are taken, rows are in the state.
    fn write_down(&mut self, rows: &[Arrival], came: i128) -> Result<(), String> {
        if let Some(history) = &mut self.history {
            let done = history.flush();
            done.map_err(|error| format!("not taken: the history cannot be written: {error}"))?;
        }
        match &mut self.state {
            None => Ok(()),
            Some(state) => state
                .append(&record(rows, came))
                .map_err(|error| format!("not taken: the state cannot be kept: {error}")),
        }
    }

    fn apply(&mut self, rows: &[Arrival], came: i128) -> Vec<Answer> {
        let answers = self.push(rows);
        self.sequence += rows.len() as u64;
        if let Some(history) = &mut self.history {
            for (row, lines) in rows.iter().zip(&answers) {
                let name = self.names.get(row.asset).map_or("", String::as_str);
                history.add(lines.as_deref().unwrap_or_default(), name, came);
            }
            // what does not find room waits, and the next rows with it
            let _ = history.flush();
        }
        answers
    }

    fn push(&mut self, rows: &[Arrival]) -> Vec<Answer> {
        let first = self.sequence + 1;
        let push = |asset: &mut Asset, place: usize, row: &Arrival| {
            asset.take(row.stamp, &row.values, (first + place as u64, KEPT))
        };
        let numbered = rows.iter().enumerate();
        if rows.len() < WORTHWHILE || self.threads < 2 || self.assets.len() < 2 {
            let answers = numbered.map(|(place, row)| match self.assets.get_mut(row.asset) {
                Some(asset) => push(asset, place, row),
                None => Err("no such asset".to_owned()),
            });
            return answers.collect();
        }
        let size = self.assets.len().div_ceil(self.threads);
        let parts = self.assets.chunks_mut(size).enumerate();
        let done = thread::scope(|scope| {
            let workers = parts.map(|(part, assets)| {
                scope.spawn(move || {
                    let own = rows.iter().enumerate();
                    let own = own.filter(|(_, row)| row.asset / size == part);
                    let done = own.filter_map(|(place, row)| {
                        let asset = assets.get_mut(row.asset % size)?;
                        Some((place, push(asset, place, row)))
                    });
                    done.collect::<Vec<(usize, Answer)>>()
                })
            });
            let workers: Vec<_> = workers.collect();
            let done = workers.into_iter().map(|worker| worker.join());
            done.flat_map(Result::unwrap_or_default).collect::<Vec<_>>()
        });
        let lost = || Err("the estimator failed; the row was not taken".to_owned());
        let mut answers: Vec<Answer> = rows.iter().map(|_| lost()).collect();
        for (place, answer) in done {
            answers[place] = answer;
        }
        answers
    }
}

/// Rows as a record of the state.
fn record(rows: &[Arrival], came: i128) -> Vec<u8> {
    let mut to = Writer::default();
    // until the year 2262
    to.word(came as u64);
    to.word(rows.len() as u64);
    for row in rows {
        to.word(row.asset as u64);
        row.stamp.save(&mut to);
        to.numbers(&row.values);
    }
    to.0
}

/// The name of an asset, its fingerprint and its state.
fn saved<'b>(from: &mut Parser<'b>) -> Option<(String, u64, &'b [u8])> {
    Some((from.text()?, from.word()?, from.bytes()?))
}

fn unwritten(error: &std::io::Error) -> Error {
    Error::input(format!("cannot write the history: {error}"))
}
