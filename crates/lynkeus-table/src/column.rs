//! A column while it is read, and as it stays.

use std::fmt;

use super::cell::{self, Cell, Mark};
use super::instant::Instant;
use super::marks::{FileMarks, Marks, Refusal, ShortComma};
use super::{Decimal, Pattern};
use crate::series::{Series, Store};

/// Missing cells that are kept with their line.
const KEPT: usize = 5;

/// What to do about times of several kinds.
const ALIKE: &str = "write every time in the same way";

/// A cell that holds no finite number.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Fault {
    /// line of the file, from 1
    pub line: u64,
    /// header of the column
    pub column: String,
    /// what stands there, trimmed
    pub found: String,
}

/// What was found, in words.
impl fmt::Display for Fault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self.found.as_str() {
            "" => f.write_str("an empty cell"),
            found => write!(f, "\"{found}\""),
        }
    }
}

/// The first date of a column.
#[derive(Clone, Debug)]
pub(super) struct Origin {
    pub text: String,
    pub(super) instant: Instant,
}

/// A column of a table.
#[derive(Clone, Debug, Default)]
pub(super) struct Column {
    pub name: String,
    /// NaN where missing
    pub values: Series,
    pub missing: usize,
    /// the first missing cells
    pub faults: Vec<Fault>,
    pub refusal: Option<Refusal>,
    pub origin: Option<Origin>,
    /// they are lengths of time, in seconds
    pub is_durations: bool,
    marks: Marks,
    /// rows that say `1,234`, which waits for another cell to tell what that is
    open: Rows,
    /// a plain number was seen
    has_number: bool,
    /// its decimal mark, where that is known
    pub(super) decimal: Option<Decimal>,
    /// what its times are written like, where that is known
    pub(super) pattern: Option<Pattern>,
}

impl Column {
    pub(super) fn new(name: &str, store: &Store) -> Self {
        Self {
            name: name.to_owned(),
            values: Series::within(store),
            ..Self::default()
        }
    }

    /// The same with other values, and the first of those that are missing.
    pub(super) fn with(&self, values: Series, faults: Vec<Fault>) -> Self {
        Self {
            missing: values.iter().filter(|x| !x.is_finite()).count(),
            values,
            faults,
            ..self.clone()
        }
    }

    /// Takes the next row's number; one that is not finite is missing.
    #[cfg(feature = "parquet")]
    pub(super) fn put(&mut self, value: f64) {
        let value = match value.is_finite() {
            true => value,
            false => {
                self.miss_number(self.values.len() as u64 + 1, value);
                f64::NAN
            }
        };
        self.values.push(value);
    }

    /// Takes the next row's length of time, in seconds.
    #[cfg(feature = "parquet")]
    pub(super) fn put_duration(&mut self, seconds: f64) {
        self.is_durations = true;
        self.values.push(seconds);
    }

    /// Takes a row that has no value.
    #[cfg(feature = "parquet")]
    pub(super) fn put_nothing(&mut self) {
        self.miss(self.values.len() as u64 + 1, "");
        self.values.push(f64::NAN);
    }

    /// It is not read, for nobody asks for it.
    #[cfg(feature = "parquet")]
    pub(super) fn leave(&mut self) {
        self.refuse(0, "it was not read".to_owned(), "read the whole log");
    }

    /// Takes the next row's point in time.
    #[cfg(feature = "parquet")]
    pub(super) fn put_instant(&mut self, instant: Instant) {
        let seconds = self.since_origin(instant).unwrap_or_else(|| {
            let line = self.values.len() as u64 + 1;
            self.instant(instant, line, &instant.to_string())
        });
        self.values.push(seconds);
    }

    /// Seconds from the first date to this one, where nothing speaks against it.
    pub(super) fn since_origin(&self, instant: Instant) -> Option<f64> {
        let origin = self.origin.as_ref()?.instant;
        let is_alike = origin.zoned == instant.zoned && !self.has_number;
        is_alike.then(|| instant.seconds_since(origin))
    }

    /// Takes the next row's cell.
    pub(super) fn push(&mut self, text: &str, line: u64) {
        let cell = match (&self.pattern, self.decimal) {
            (Some(pattern), _) => cell::of_pattern(text, pattern),
            (None, Some(decimal)) => cell::read_by(text, decimal),
            (None, None) => cell::read(text),
        };
        let value = match cell {
            Cell::Number(value) => {
                self.marks.see_plain(value);
                self.number(value, line, text)
            }
            Cell::Marked(value, mark) => {
                let value = self.marked(value, mark, line, text);
                self.number(value, line, text)
            }
            Cell::Instant(instant) => self.instant(instant, line, text),
            Cell::Missing => {
                self.miss(line, text);
                f64::NAN
            }
            Cell::Garbled => {
                self.garbled(line, text);
                f64::NAN
            }
        };
        self.values.push(value);
    }

    /// A cell that is nothing that its column holds.
    fn garbled(&mut self, line: u64, text: &str) {
        match &self.pattern {
            Some(pattern) => {
                let message = format!("expected a time like {}, found \"{text}\"", pattern.text());
                self.refuse(line, message, "mend the cell, or `time_format` of [log]");
            }
            None => self.refuse(
                line,
                format!("expected a number, found \"{text}\""),
                "write numbers without units and blanks, and times as numbers or as 2026-11-22T01:02:03Z",
            ),
        }
    }

    /// A number in its row; the value.
    pub(super) fn number(&mut self, value: f64, line: u64, text: &str) -> f64 {
        self.has_number = true;
        if let Some(origin) = &self.origin {
            let message = format!("expected a date like \"{}\", found \"{text}\"", origin.text);
            self.refuse(line, message, ALIKE);
        }
        value
    }

    /// The value that a marked cell has as far as the column tells.
    fn marked(&mut self, value: f64, mark: Mark, line: u64, text: &str) -> f64 {
        self.marks.see(mark, line, text);
        match (mark, self.marks.own()) {
            (Mark::ShortComma, Some(meaning)) => return meaning.of(value),
            (Mark::ShortComma, None) => self.open.insert(self.values.len()),
            (_, Some(meaning)) => self.settle(meaning),
            (_, None) => {}
        }
        value
    }

    /// Gives the cells that waited for it their meaning.
    fn settle(&mut self, meaning: ShortComma) {
        let open = std::mem::take(&mut self.open);
        if open.is_empty() {
            return;
        }
        let settled = self.values.iter().enumerate();
        let settled = settled.map(|(row, value)| match open.contains(row) {
            true => meaning.of(value),
            false => value,
        });
        self.values = Series::gathered(self.values.store(), settled);
    }

    /// A date in its row; the value.
    pub(super) fn instant(&mut self, instant: Instant, line: u64, text: &str) -> f64 {
        if self.has_number {
            let message = format!("expected a number, found the date \"{text}\"");
            self.refuse(line, message, ALIKE);
        }
        let origin = self.origin.get_or_insert_with(|| Origin {
            text: text.to_owned(),
            instant,
        });
        let seconds = instant.seconds_since(origin.instant);
        if origin.instant.zoned != instant.zoned {
            let message = format!(
                "expected a zone in all times or in none, found \"{text}\" after \"{}\"",
                origin.text
            );
            self.refuse(line, message, ALIKE);
        }
        seconds
    }

    /// A number that is not finite.
    pub(super) fn miss_number(&mut self, line: u64, value: f64) {
        match self.faults.len() < KEPT {
            true => self.miss(line, &value.to_string()),
            false => self.missing += 1,
        }
    }

    /// A cell that says nothing.
    pub(super) fn miss(&mut self, line: u64, text: &str) {
        self.missing += 1;
        if self.faults.len() < KEPT {
            self.faults.push(Fault {
                line,
                column: self.name.clone(),
                found: text.to_owned(),
            });
        }
    }

    /// Only the first refusal is kept.
    pub(super) fn refuse(&mut self, line: u64, message: String, hint: &'static str) {
        self.refusal.get_or_insert(Refusal {
            line,
            message,
            hint,
        });
    }

    /// Adds what this column says of point and comma.
    pub(super) fn tell(&self, file: &mut FileMarks) {
        self.marks.tell(file);
    }

    /// All rows are read, and the file has spoken.
    pub(super) fn finish(&mut self, file: FileMarks) {
        match self.marks.decide(file) {
            Ok(meaning) => self.settle(meaning),
            Err(refusal) => {
                self.refusal.get_or_insert(refusal);
            }
        }
    }
}

/// Rows of a column, a bit for each.
#[derive(Clone, Debug, Default)]
struct Rows(Vec<u64>);

impl Rows {
    fn insert(&mut self, row: usize) {
        let word = row / 64;
        if self.0.len() <= word {
            self.0.resize(word + 1, 0);
        }
        self.0[word] |= 1 << (row % 64);
    }

    fn contains(&self, row: usize) -> bool {
        let word = self.0.get(row / 64);
        word.is_some_and(|word| word >> (row % 64) & 1 == 1)
    }

    fn is_empty(&self) -> bool {
        self.0.is_empty()
    }
}
