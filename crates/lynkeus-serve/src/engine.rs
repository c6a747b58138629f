//! Rows of many assets to their estimators: kept first, then taken, then answered.

#[cfg(test)]
mod day;

use std::collections::HashMap;
use std::num::NonZero;
use std::path::Path;
use std::sync::Arc;
use std::thread;
use std::time::{Duration, Instant};

use lynkeus::Error;
use lynkeus::stream::Stream;

use crate::asset::{Asset, Line, Saved};
use crate::bytes::{Parser, Writer};
use crate::history::{History, now};
use crate::json::{ASSET, Message};
use crate::row::Stamp;
use crate::state::{Kind, State};

/// Rows that are taken together, at most.
pub const BATCH: usize = 256;
/// Of so many rows it is known what was told of them, so that one that comes once more is answered as before. A client
/// that lost its connection sends again what it has no answer to: what was on its way to it (a pipe holds 64 KiB), and
/// a batch.
const KEPT: u64 = 4096;
/// How long rows wait at once while the state is written anew.
const SLICE: Duration = Duration::from_micros(500);
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
    /// by place in the state, where an asset is now; none where nobody is called so any more
    moved: Vec<Option<usize>>,
    /// assets whose study has changed since the state
    changed: Vec<usize>,
    /// rows so far
    sequence: u64,
    threads: usize,
    state: Option<State>,
    /// while the state is written anew, so many assets are in it
    saved: Option<usize>,
    /// the day of the history in the last state, whether it is on the disk or not
    day: i128,
    history: Option<History>,
    /// what the user should know of how it began
    notes: Vec<String>,
    /// what the user should know since
    news: Vec<String>,
}

/// What became of a row: lines, or why there are none.
pub type Answer = Result<Vec<Line>, Refusal>;

/// Why a row has no lines.
#[derive(Clone, Debug, PartialEq)]
pub enum Refusal {
    /// it will never be used
    Unusable(String),
    /// it could not be kept: once there is room it may be sent again
    NotKept(String),
}

impl std::fmt::Display for Refusal {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        match self {
            Self::Unusable(why) => f.write_str(why),
            Self::NotKept(why) => write!(f, "not taken: {why}"),
        }
    }
}

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
            moved: vec![],
            changed: vec![],
            sequence: 0,
            threads: thread::available_parallelism().map_or(1, NonZero::get),
            state: None,
            saved: None,
            day: i128::MIN,
            history: None,
            notes: vec![],
            news: vec![],
        }
    }

    /// Writes what is told to these files, one for each day: `%Y`, `%m` and `%d` of a path are its date. So many days
    /// are kept, if any number is said. Where there is a [state](Self::keep), this comes before it.
    pub fn write_history(&mut self, pattern: &Path, keep: Option<u64>) {
        let has_assets = self.has_names();
        let stream = self.assets.first().map(Asset::stream);
        self.history = stream.map(|stream| History::new(pattern, keep, stream, has_assets));
    }

    /// Goes on where this file says that it was, and keeps what it is given there from here on. A file that is not
    /// there is made. Where the study has other numbers than that of the file, what it has in common with it is taken
    /// over, and the file before is kept beside.
    ///
    /// # Errors
    /// Another program has it, it cannot be read or written, it is none, or one of another plant or observer.
    pub fn keep(&mut self, path: &Path) -> Result<(), Error> {
        let (state, bytes) = State::open(path)?;
        if let Some(history) = &mut self.history {
            history.begin().map_err(|error| unwritten(&error))?;
        }
        let records = State::records(path, &bytes)?;
        let damaged = || State::damaged(path);
        for (kind, record) in &records {
            let known = match kind {
                Kind::Asset => self.load(record, path)?,
                Kind::End => self.load_end(record)?,
                Kind::Rows => Some(()),
            };
            known.ok_or_else(damaged)?;
        }
        // each asset knows which of them are new to it
        for (_, rows) in records.iter().filter(|(kind, _)| *kind == Kind::Rows) {
            self.again(rows).ok_or_else(damaged)?;
        }
        if self.sequence > 0 {
            let text = format!("went on after row {} of {}", self.sequence, path.display());
            self.notes.push(text);
        }
        if !self.changed.is_empty() {
            self.notes.push(self.told_changes());
        }
        if !self.changed.is_empty() || self.moved.contains(&None) {
            let aside = state.set_aside();
            let aside = aside.map_err(|error| State::unusable(path, &error))?;
            self.notes
                .push(format!("the state before is {}", aside.display()));
        }
        self.state = Some(state);
        if let Some(history) = &mut self.history {
            history.is_up_to_date().map_err(|error| unwritten(&error))?;
        }
        self.renew_all()
            .map_err(|error| State::unusable(path, &error))
    }

    /// What the user should know of how it began.
    #[must_use]
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// The estimator of an asset as a record of the state.
    fn record(&self, place: usize) -> Option<Vec<u8>> {
        let (name, asset) = (self.names.get(place)?, self.assets.get(place)?);
        let mut to = Writer::default();
        to.bytes(name.as_bytes());
        to.word(asset.fingerprint());
        to.word(self.sequence);
        asset.save(&mut to);
        Some(to.0)
    }

    /// What a record says of an asset; none where it is damaged.
    fn load(&mut self, record: &[u8], path: &Path) -> Result<Option<()>, Error> {
        let mut from = Parser(record);
        let head = |from: &mut Parser<'_>| Some((from.text()?, from.word()?, from.word()?));
        let Some((name, fingerprint, sequence)) = head(&mut from) else {
            return Ok(None);
        };
        let place = self.place(&name);
        self.moved.push(place);
        let Some((place, asset)) = place.and_then(|i| Some((i, self.assets.get_mut(i)?))) else {
            let text =
                format!("the state of \"{name}\" is left out: no asset is called so any more");
            self.notes.push(text);
            return Ok(Some(()));
        };
        let Some(saved) = Saved::load(&mut from) else {
            return Ok(None);
        };
        if asset.fingerprint() == fingerprint {
            return Ok(asset.resume(saved, sequence));
        }
        self.changed.push(place);
        asset.take_over(saved, sequence).map_err(|error| {
            let of = match name.is_empty() {
                true => String::new(),
                false => format!(" of \"{name}\""),
            };
            let why = error.message();
            let text =
                format!("the study has changed, and the state{of} cannot be taken over: {why}");
            let hint =
                "go back to the study that made it, or move the file away to begin from the start";
            Error::input(text).at(path.display()).hint(hint)
        })?;
        Ok(Some(()))
    }

    /// What became of a state of another study.
    fn told_changes(&self) -> String {
        let of = match self.has_names() {
            true => format!(" of {} of {} assets", self.changed.len(), self.assets.len()),
            false => String::new(),
        };
        let first = self.changed.first().and_then(|place| self.stream(*place));
        let estimates = first.map_or(&[][..], |stream| &stream.estimates);
        let names: Vec<&str> = estimates.iter().map(|told| told.name.as_str()).collect();
        format!(
            "the study has changed: the estimates{of} ({}) and what is known of their errors are taken over, new rows alone say whether they are credible",
            names.join(", ")
        )
    }

    /// What a snapshot says of everything else.
    fn load_end(&mut self, record: &[u8]) -> Result<Option<()>, Error> {
        let mut from = Parser(record);
        let Some(sequence) = from.word() else {
            return Ok(None);
        };
        self.sequence = sequence;
        match &mut self.history {
            // there was no history so far
            Some(_) if from.0.is_empty() => {}
            Some(history) => match history.load(&mut from, sequence, !self.changed.is_empty()) {
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
        // before the first of them
        self.sequence = from.word()?;
        let came = i128::from(from.word()? as i64);
        let mut rows = vec![];
        for _ in 0..from.count(32)? {
            let place = usize::try_from(from.word()?).ok()?;
            let (stamp, values) = (Stamp::load(&mut from)?, from.numbers()?);
            // assets may have come and gone since
            let place = self.moved.get(place).copied().flatten();
            let asset = place.and_then(|place| self.assets.get(place));
            rows.push(Arrival {
                asset: place.unwrap_or(usize::MAX),
                stamp,
                values: asset.map_or(vec![], |asset| asset.at_places(&values)),
            });
        }
        self.apply(&rows, came);
        Some(())
    }

    /// Writes the state anew, so that little has to be gone over again.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was.
    fn renew_all(&mut self) -> std::io::Result<()> {
        if let Some(state) = &mut self.state
            && self.saved.is_none()
        {
            state.wait()?;
            state.renew();
            self.saved = Some(0);
        }
        self.save_some(Duration::MAX)?;
        if let Some(state) = &mut self.state
            && state.wait()?
        {
            self.is_over();
        }
        Ok(())
    }

    /// The last state is on the disk: the days of the history before it are over.
    fn is_over(&mut self) {
        if let Some(history) = &mut self.history {
            history.is_over(self.day);
        }
    }

    /// What the user should know since this was asked last.
    pub fn news(&mut self) -> Vec<String> {
        let failures = self.history.as_mut().map(History::failures);
        self.news.extend(failures.into_iter().flatten());
        std::mem::take(&mut self.news)
    }

    /// Writes a part of it where it is time to write it anew.
    fn renew(&mut self) {
        let day = self.history.as_ref().map_or(i128::MIN, History::day);
        let Some(state) = &mut self.state else {
            if day != self.day {
                self.day = day;
                self.is_over();
            }
            return;
        };
        // where it failed it goes on with the longer file, and tries again later
        let is_there = state.settle().unwrap_or_else(|error| {
            let text = format!("the state is not written anew: {error}; it grows until it is");
            self.news.push(text);
            false
        });
        if day != self.day {
            state.make_due();
        }
        if state.is_due() {
            state.renew();
            self.saved = Some(0);
        }
        if is_there {
            self.is_over();
        }
        // what cannot be written yet is tried with the next rows
        let _ = self.save_some(SLICE);
    }

    /// Goes on with the assets, for so long; the end where all are there.
    fn save_some(&mut self, most: Duration) -> std::io::Result<()> {
        let began = Instant::now();
        while let Some(place) = self.saved {
            if let Some(record) = self.record(place) {
                if let Some(state) = &mut self.state {
                    state.add(&record);
                }
                self.saved = Some(place + 1);
                if began.elapsed() > most {
                    return Ok(());
                }
                continue;
            }
            let mut end = Writer::default();
            end.word(self.sequence);
            let mut file = None;
            if let Some(history) = &mut self.history {
                file = history.written()?;
                history.save(&mut end);
                self.day = history.day();
            }
            if let Some(state) = &mut self.state {
                state.complete(&end.0, file);
            }
            self.saved = None;
        }
        Ok(())
    }

    /// The end of all: the next start has nothing to go over again.
    pub fn close(&mut self) {
        // the rows are on the disk in any case
        let _ = self.renew_all();
    }

    /// The place of an asset; none where nobody is called so.
    #[must_use]
    pub fn place(&self, name: &str) -> Option<usize> {
        self.places.get(name).copied()
    }

    /// Whether messages say whose rows they are.
    #[must_use]
    pub fn has_names(&self) -> bool {
        self.place("").is_none()
    }

    /// The names of the assets, in their order; one that is empty where there is only one.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The study of an asset.
    #[must_use]
    pub fn stream(&self, asset: usize) -> Option<&Stream> {
        self.assets.get(asset).map(Asset::stream)
    }

    /// Whether an asset had its first row.
    #[must_use]
    pub fn has_begun(&self, asset: usize) -> bool {
        let asset = self.assets.get(asset);
        asset.is_some_and(|asset| asset.newest().is_some())
    }

    /// Whether the next start goes on from here.
    #[must_use]
    pub fn is_kept(&self) -> bool {
        self.state.is_some()
    }

    /// The row of a message.
    ///
    /// # Errors
    /// It is nobody's.
    pub fn arrival(&self, message: &Message) -> Result<Arrival, String> {
        let asset = match (self.has_names(), &message.asset) {
            (false, _) => 0,
            (true, Some(name)) => match self.place(name) {
                Some(place) => place,
                None => return Err(format!("no asset is called \"{name}\"")),
            },
            (true, None) => {
                return Err(format!("expected the name of an asset under \"{ASSET}\""));
            }
        };
        Ok(Arrival {
            asset,
            stamp: message.stamp,
            values: message.values.clone(),
        })
    }

    /// What was told last of the rows that may still be corrected, by asset.
    #[must_use]
    pub fn recent(&self) -> Vec<(usize, Line)> {
        let all = self.assets.iter().enumerate();
        let lines = all.flat_map(|(place, asset)| {
            let own = asset.recent().into_iter();
            own.map(move |line| (place, line))
        });
        lines.collect()
    }

    /// Takes rows in their order, at most `BATCH`, and keeps them before they are answered.
    pub fn take(&mut self, rows: &[Arrival]) -> Vec<Answer> {
        self.take_at(rows, now())
    }

    /// The same of rows that came at a time, in nanoseconds since 1970.
    fn take_at(&mut self, rows: &[Arrival], came: i128) -> Vec<Answer> {
        if rows.is_empty() {
            return vec![];
        }
        match self.write_down(rows, came) {
            Ok(()) => {}
            Err(why) if rows.len() == 1 => return vec![Err(Refusal::NotKept(why))],
            // there may be room for some of them
            Err(_) => {
                let (some, others) = rows.split_at(rows.len() / 2);
                return [self.take_at(some, came), self.take_at(others, came)].concat();
            }
        }
        let answers = self.apply(rows, came);
        self.renew();
        answers
    }

    /// Before they are taken, rows are in the state.
    fn write_down(&mut self, rows: &[Arrival], came: i128) -> Result<(), String> {
        if let Some(history) = &mut self.history {
            let done = history.flush();
            done.map_err(|error| format!("the history cannot be written: {error}"))?;
        }
        match &mut self.state {
            None => Ok(()),
            Some(state) => state
                .append(&record(self.sequence, rows, came))
                .map_err(|error| format!("the state cannot be kept: {error}")),
        }
    }

    fn apply(&mut self, rows: &[Arrival], came: i128) -> Vec<Answer> {
        let answers = self.push(rows);
        if let Some(history) = &mut self.history {
            for (sequence, (row, lines)) in (self.sequence + 1..).zip(rows.iter().zip(&answers)) {
                let name = self.names.get(row.asset).map_or("", String::as_str);
                let lines = lines.as_deref().unwrap_or_default();
                history.add(lines, name, (came, sequence));
            }
            // what does not find room waits, and the next rows with it
            let _ = history.flush();
        }
        self.sequence += rows.len() as u64;
        answers
    }

    fn push(&mut self, rows: &[Arrival]) -> Vec<Answer> {
        let first = self.sequence + 1;
        let push = |asset: &mut Asset, place: usize, row: &Arrival| {
            let taken = asset.take(row.stamp, &row.values, (first + place as u64, KEPT));
            taken.map_err(Refusal::Unusable)
        };
        let failed = |why: &str| Err(Refusal::Unusable(why.to_owned()));
        let numbered = rows.iter().enumerate();
        if rows.len() < WORTHWHILE || self.threads < 2 || self.assets.len() < 2 {
            let answers = numbered.map(|(place, row)| match self.assets.get_mut(row.asset) {
                Some(asset) => push(asset, place, row),
                None => failed("no such asset"),
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
        let lost = |_| failed("the estimator failed; the row was not taken");
        let mut answers: Vec<Answer> = rows.iter().map(lost).collect();
        for (place, answer) in done {
            answers[place] = answer;
        }
        answers
    }
}

/// Rows after the first ones so many, as a record of the state.
fn record(sequence: u64, rows: &[Arrival], came: i128) -> Vec<u8> {
    let mut to = Writer::default();
    to.word(sequence);
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

fn unwritten(error: &std::io::Error) -> Error {
    Error::input(format!("cannot write the history: {error}"))
}
