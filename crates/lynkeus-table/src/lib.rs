//! Tables of numbers: measured logs as they are, estimates as they are written; CSV and Parquet.
//!
//! A [`Series`] is a column, in memory where it is short and on disk where it is long; a [`Table`] has
//! columns and what its cells said, and [`Ordered`] puts rows in the order of their times.
//! This crate knows files, cells and times, and nothing of plants or studies.
//!
//! A cell without a value (empty, NaN, infinite, a word) is *missing*: it is NaN in the column,
//! counted, and the first few are kept with their line. What a cell says is never guessed: a
//! comma that may be a decimal comma or group thousands is decided by the rest of the column and
//! of the file, or the column is refused with the cell that leaves it open.

#![cfg_attr(test, allow(clippy::unwrap_used))]

mod cell;
mod column;
mod computed;
pub mod files;
mod gathering;
pub mod incoming;
mod instant;
mod lines;
mod marks;
mod number;
mod order;
#[cfg(feature = "parquet")]
mod parquet;
mod pattern;
mod read;
mod request;
mod row;
pub mod series;
mod write;

use crate::series::Store;
use column::Column;
use lines::Lines;
use lynkeus_answer::near::{list, nearest};
use lynkeus_answer::{Error, visible};

#[cfg(feature = "parquet")]
pub use self::parquet::write_parquet;
pub use column::Fault;
pub use gathering::{Cell, Gathered, Gathering};
pub use incoming::Incoming;
pub use instant::Instant;
pub use number::{exact, significant};
pub use order::APART;
pub use order::{Conflict, Lost, Ordered};
pub use pattern::Pattern;
pub use request::{Decimal, Format, Request};
pub use series::Series;
pub use write::write_csv;

/// Whether a file is a Parquet file by its name.
pub fn is_parquet(path: &std::path::Path) -> bool {
    path.extension()
        .is_some_and(|extension| extension.eq_ignore_ascii_case("parquet"))
}

/// A table of named columns of equal length, all numbers. What is long of it is in a temporary
/// file, so that it takes little memory however many rows it has.
///
/// Asking for a column is an error where its cells cannot be told, so that columns nobody asks
/// for may hold anything.
#[derive(Clone, Debug, Default)]
pub struct Table {
    file: String,
    columns: Vec<Column>,
    /// what is true of quantities, by their names: no column that anybody reads
    truth: Vec<(String, Series)>,
    lines: Lines,
    store: Store,
}

impl Table {
    /// The same with what is true of quantities, row by row.
    pub fn with_truth(mut self, truth: Vec<(String, Vec<f64>)>) -> Self {
        let truth = truth.into_iter();
        self.truth = truth.map(|(name, values)| (name, values.into())).collect();
        self
    }

    /// What is true of a quantity, where that is known apart from the columns.
    pub fn truth(&self, name: &str) -> Option<&Series> {
        let mut named = self.truth.iter().filter(|(known, _)| known == name);
        named.next().map(|(_, values)| values)
    }

    /// Whether anything is known to be true: the table is of a simulation.
    pub fn has_truth(&self) -> bool {
        !self.truth.is_empty()
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.lines.rows()
    }

    /// The headers, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.columns.iter().map(|c| c.name.as_str())
    }

    /// The file, for messages; empty for tables made in Rust.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// The table in messages about all of it.
    pub fn place(&self) -> String {
        match self.file.is_empty() {
            true => "the table".to_owned(),
            false => self.file.clone(),
        }
    }

    /// A line of it in messages, 0 for none; a table made in Rust has rows, from 1.
    fn place_of(&self, line: u64) -> String {
        match (line, self.file.is_empty()) {
            (0, _) => self.place(),
            (line, true) => format!("row {line} of the table"),
            (line, false) => format!("{}:{line}", self.file),
        }
    }

    /// A row of it in messages, from 0.
    pub fn place_of_row(&self, row: usize) -> String {
        self.place_of(self.lines.of(row))
    }

    /// The columns of a name: under it, else as tables that are [written](visible) spell it.
    fn called(&self, name: &str) -> impl Iterator<Item = &Column> {
        let is_there = self.columns.iter().any(|c| c.name == name);
        let header = match is_there {
            true => name.to_owned(),
            // headers are trimmed where they are read
            false => visible::line(name).trim().to_owned(),
        };
        self.columns.iter().filter(move |c| c.name == header)
    }

    /// Whether a column is called so.
    pub fn has(&self, name: &str) -> bool {
        self.called(name).next().is_some()
    }

    /// Whether one column is called so, and no other.
    pub fn has_one(&self, name: &str) -> bool {
        self.called(name).count() == 1
    }

    /// A column if there is one of that name whose cells can be told; missing ones are NaN.
    pub fn get(&self, name: &str) -> Option<&Series> {
        let column = self.called(name).next()?;
        column.refusal.is_none().then_some(&column.values)
    }

    /// Why the cells of a column cannot be told, where that is so.
    pub fn refusal(&self, name: &str) -> Option<&str> {
        let column = self.called(name).next()?;
        column.refusal.as_ref().map(|r| r.message.as_str())
    }

    /// How many cells of a column are missing; 0 where there is no such column.
    pub fn missing(&self, name: &str) -> usize {
        let column = self.called(name).next();
        column.map_or(0, |c| c.missing)
    }

    /// The first few missing cells of a column, in order.
    pub fn faults(&self, name: &str) -> &[Fault] {
        let column = self.called(name).next();
        column.map_or(&[], |c| &c.faults)
    }

    /// What the log writes for zero where a column holds dates and times: it counts seconds since
    /// the first of them.
    pub fn origin(&self, name: &str) -> Option<&str> {
        let column = self.called(name).next()?;
        column.origin.as_ref().map(|origin| origin.text.as_str())
    }

    /// The same as a point in time.
    pub fn start(&self, name: &str) -> Option<Instant> {
        let column = self.called(name).next()?;
        column.origin.as_ref().map(|origin| origin.instant)
    }

    /// A column of times, counted as those of the column `like` are: dates from its first date, in seconds; missing
    /// ones are NaN.
    ///
    /// # Errors
    /// As [`Table::times`], or one column holds dates and the other does not, or dates with a zone and dates without.
    pub fn times_like(&self, name: &str, like: &str) -> Result<Series, Error> {
        let times = self.cells(name)?;
        let (own, other) = (self.start(name), self.start(like));
        let is_empty = self.missing(name) == times.len();
        match (own, other) {
            _ if is_empty => Ok(times.clone()),
            (None, None) => Ok(times.clone()),
            (Some(own), Some(other)) if own.is_zoned() == other.is_zoned() => {
                let counted = times.iter().map(|t| own.later(t).seconds_since(other));
                Ok(Series::gathered(&self.store, counted))
            }
            _ => {
                let kind = |header: &str| match self.origin(header) {
                    Some(date) => format!("dates such as {date}"),
                    None => "numbers".to_owned(),
                };
                let (found, expected) = (kind(name), kind(like));
                let message = format!(
                    "column \"{name}\": expected {expected} as in \"{like}\", found {found}"
                );
                Err(Error::input(message)
                    .at(self.place())
                    .hint("write the times of both columns in the same way"))
            }
        }
    }

    /// Whether a column holds lengths of time, which are counted in seconds.
    pub fn has_durations(&self, name: &str) -> bool {
        self.called(name).any(|c| c.is_durations)
    }

    /// A column of times, numbers or dates, in which cells may be missing: those are NaN.
    ///
    /// # Errors
    /// There is no such column (the message lists those found), there are two, a cell begins like
    /// a number and is none, a decimal mark cannot be told (the message gives the line), or every
    /// cell is missing.
    pub fn times(&self, name: &str) -> Result<&Series, Error> {
        let values = self.cells(name)?;
        let column = self.find(name)?;
        match column.missing == values.len() {
            true => Err(self.without_number(column)),
            false => Ok(values),
        }
    }

    /// The same, of which every cell may be missing.
    ///
    /// # Errors
    /// As [`Table::times`], but for the last.
    pub fn cells(&self, name: &str) -> Result<&Series, Error> {
        let column = self.find(name)?;
        if let Some(refusal) = &column.refusal {
            return Err(
                Error::input(format!("column \"{name}\": {}", refusal.message))
                    .at(self.place_of(refusal.line))
                    .hint(refusal.hint),
            );
        }
        Ok(&column.values)
    }

    /// A column of numbers in which cells may be missing: those are NaN.
    ///
    /// # Errors
    /// As [`Table::times`], or it holds dates.
    pub fn readings(&self, name: &str) -> Result<&Series, Error> {
        let values = self.times(name)?;
        match self.origin(name) {
            None => Ok(values),
            Some(date) => Err(self.dates(name, date)),
        }
    }

    /// The refusal of dates in a column of numbers.
    fn dates(&self, name: &str, date: &str) -> Error {
        Error::input(format!(
            "column \"{name}\" must hold numbers, found dates such as {date}: only times may be dates"
        ))
        .at(self.place())
        .hint("name another column under [estimate] columns, or convert this one")
    }

    fn without_number(&self, column: &Column) -> Error {
        let message = format!("column \"{}\" has no number", column.name);
        let refusal = match column.faults.first() {
            Some(fault) => {
                Error::input(format!("{message}, found {fault}")).at(self.place_of(fault.line))
            }
            None => Error::input(message).at(self.place()),
        };
        refusal.hint("name another column under [estimate] columns, or mend this one")
    }

    /// A column in which the last value stands where a cell is missing, and the first one before it.
    ///
    /// # Errors
    /// As [`Table::readings`].
    pub fn held(&self, name: &str) -> Result<Series, Error> {
        let values = self.readings(name)?;
        if self.find(name)?.missing == 0 {
            return Ok(values.clone());
        }
        let mut last = values.iter().find(|x| x.is_finite());
        let held = values.iter().map(|x| {
            last = Some(x).filter(|x| x.is_finite()).or(last);
            last.unwrap_or(f64::NAN)
        });
        Ok(Series::gathered(&self.store, held))
    }

    /// A column of numbers without missing cells.
    ///
    /// # Errors
    /// As [`Table::readings`], or a cell is missing (the message gives the first one's line).
    pub fn column(&self, name: &str) -> Result<&Series, Error> {
        self.whole(name, self.readings(name))
    }

    /// These values of a column, if none is missing.
    fn whole<'v>(
        &self,
        name: &str,
        values: Result<&'v Series, Error>,
    ) -> Result<&'v Series, Error> {
        let column = self.find(name)?;
        if let (None, Some(fault)) = (&column.refusal, column.faults.first()) {
            return Err(Error::input(format!(
                "column \"{name}\" must hold a finite number in every row, found {fault}{}",
                match column.missing {
                    1 => String::new(),
                    more => format!(" and {} more such cells", more - 1),
                }
            ))
            .at(self.place_of(fault.line))
            .hint("remove the row or fill the cell"));
        }
        values
    }

    /// The time column: strictly increasing.
    ///
    /// # Errors
    /// As [`Table::times`], a cell is missing, or a row's time is not after the one before it.
    pub fn time(&self, name: &str) -> Result<&Series, Error> {
        if self.called(name).next().is_none() {
            return Err(self.without_time(name));
        }
        let time = self.whole(name, self.times(name))?;
        let mut pairs = time.iter().zip(time.iter().skip(1)).enumerate();
        let Some((i, (before, at))) = pairs.find(|(_, (a, b))| b <= a) else {
            return Ok(time);
        };
        let line = |row: usize| self.lines.of(row);
        Err(Error::input(format!(
            "time must increase from row to row, found \"{name}\" = {at} after {before} in line {}",
            line(i)
        ))
        .at(self.place_of(line(i + 1)))
        .hint("sort the rows by time and remove doubles"))
    }

    fn find(&self, name: &str) -> Result<&Column, Error> {
        let mut matching = self.called(name);
        let Some(column) = matching.next() else {
            return Err(self.absent(name));
        };
        match matching.next() {
            None => Ok(column),
            Some(_) => Err(Error::input(format!(
                "two columns are called \"{name}\", expected one"
            ))
            .at(self.place())),
        }
    }

    /// The time column is named by a key of its own.
    fn without_time(&self, name: &str) -> Error {
        let found = format!(
            "no time column \"{name}\"; the columns found are: {}",
            list(self.names())
        );
        let near = nearest(name, self.names()).unwrap_or("…");
        Error::input(found).at(self.place()).hint(format!(
            "if it has another name, set time = \"{near}\" in [log] of the study"
        ))
    }

    fn absent(&self, name: &str) -> Error {
        let found = format!(
            "no column \"{name}\"; the columns found are: {}",
            list(self.names())
        );
        let near = nearest(name, self.names());
        Error::input(found).at(self.place()).hint(match near {
            Some(near) => format!(
                "if \"{near}\" is meant, add [estimate] columns = {{ \"{name}\" = \"{near}\" }} to the study"
            ),
            None => format!(
                "add [estimate] columns = {{ \"{name}\" = \"…\" }} to the study if it has another name"
            ),
        })
    }
}

#[cfg(test)]
mod tests;
