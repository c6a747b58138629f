//! CSV text to tables.

use std::io::BufRead;
use std::path::Path;

use super::column::Column;
use super::marks::FileMarks;
use super::row::{Broken, Rows};
use super::{Request, Table};
use crate::Incoming;
use crate::incoming::unread;
use lynkeus_answer::Error;

/// Rows between two looks at whether there is room for them.
const SAMPLE: usize = 1 << 16;

/// Most columns of a log.
const MOST_COLUMNS: usize = 100_000;

impl Table {
    /// Reads a CSV file with a header row, or a Parquet file if it is called `*.parquet`.
    ///
    /// The delimiter is a comma, a semicolon or a tab, whichever the header has most of; headers
    /// and cells are trimmed. Decimal commas, marks between thousands, and dates are understood
    /// where they leave no doubt. The file is read as a stream: only the numbers are kept, those of
    /// a long log in a temporary file.
    ///
    /// # Errors
    /// The file is missing, no file, not UTF-8 text, empty, has no rows, there is no room for its
    /// numbers, or a row has more or fewer cells than the header.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        Self::load_within(path, &Request::default())
    }

    /// The same for somebody who asks for less, or who does not wait for ever.
    ///
    /// # Errors
    /// As [`Table::load`], or the budget is spent.
    pub fn load_within(path: impl AsRef<Path>, request: &Request) -> Result<Self, Error> {
        let path = path.as_ref();
        let name = path.display().to_string();
        #[cfg(feature = "parquet")]
        if super::is_parquet(path) {
            if request.format != super::Format::default() {
                return Err(Error::input(
                    "`decimal`, `delimiter`, `skip` and `time_format` of [log] say how a CSV file is written, found a Parquet file",
                )
                .at(&name)
                .hint("leave them out for this log"));
            }
            return match crate::files::is_stream(path) {
                true => Err(super::parquet::no_file(&name)),
                false => super::parquet::load(crate::files::open(path, "log")?, &name, request),
            };
        }
        Self::read_as(
            Incoming::open(path, "log", &request.budget)?,
            &name,
            request,
        )
    }

    /// Reads CSV text; `file` names it in messages.
    ///
    /// # Errors
    /// As [`Table::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        Self::read(text.as_bytes(), file)
    }

    /// Reads CSV text as it comes; `file` names it in messages.
    ///
    /// # Errors
    /// As [`Table::load`].
    pub fn read(input: impl BufRead, file: &str) -> Result<Self, Error> {
        Self::read_as(input, file, &Request::default())
    }

    /// The same of a text that is written as somebody says.
    ///
    /// # Errors
    /// As [`Table::load`].
    pub fn read_as(input: impl BufRead, file: &str, request: &Request) -> Result<Self, Error> {
        let mut reading = Reading {
            rows: Rows::new(input),
            table: Table {
                file: file.to_owned(),
                ..Self::default()
            },
            delimiter: b',',
        };
        let skipped = reading.rows.skip(request.format.skip);
        skipped.map_err(|broken| reading.broken(&broken))?;
        reading.header(request)?;
        while reading.next()? {
            reading.row()?;
        }
        reading.finish()
    }
}

/// A table while it is read.
struct Reading<R> {
    rows: Rows<R>,
    table: Table,
    delimiter: u8,
}

impl<R: BufRead> Reading<R> {
    fn next(&mut self) -> Result<bool, Error> {
        self.rows.next().map_err(|broken| self.broken(&broken))
    }

    fn header(&mut self, request: &Request) -> Result<(), Error> {
        let any = self.next()?;
        let format = &request.format;
        let given = format.delimiter;
        self.delimiter = given.unwrap_or_else(|| delimiter(self.rows.raw()));
        let count = self.rows.split(self.delimiter);
        if count > MOST_COLUMNS {
            return Err(self.error(format!(
                "expected at most {MOST_COLUMNS} columns, found {count}"
            )));
        }
        let names = self.rows.texts();
        for name in names.map_err(|_| not_utf8(&self.table.file, self.rows.number()))? {
            let mut column = Column::new(&name, &self.table.store);
            column.decimal = format.decimal;
            let is_time = request.times.iter().any(|time| *time == *name);
            column.pattern = format.times.clone().filter(|_| is_time);
            self.table.columns.push(column);
        }
        if !any || self.table.names().all(str::is_empty) {
            return Err(Error::input(
                "expected a header row with column names, found an empty file",
            )
            .at(&self.table.file));
        }
        Ok(())
    }

    fn row(&mut self) -> Result<(), Error> {
        let count = self.rows.split(self.delimiter);
        if count != self.table.columns.len() {
            return Err(self.error(format!(
                "expected {} cells as in the header, found {count}",
                self.table.columns.len()
            )));
        }
        let line = self.rows.number();
        self.table.lines.push(line);
        let texts = self.rows.texts();
        let texts = texts.map_err(|_| not_utf8(&self.table.file, line))?;
        for (column, text) in self.table.columns.iter_mut().zip(texts) {
            column.push(&text, line);
        }
        match self.table.rows().is_multiple_of(SAMPLE) {
            true => self.table.store.check(),
            false => Ok(()),
        }
    }

    fn finish(self) -> Result<Table, Error> {
        let mut table = self.table;
        if table.rows() == 0 {
            return Err(
                Error::input("expected rows of numbers below the header, found none")
                    .at(&table.file),
            );
        }
        let mut file = FileMarks {
            // a comma between cells is none within numbers
            point: self.delimiter == b',',
            comma: false,
        };
        table.columns.iter().for_each(|c| c.tell(&mut file));
        table.columns.iter_mut().for_each(|c| c.finish(file));
        table.store.check()?;
        Ok(table)
    }

    fn error(&self, message: String) -> Error {
        Error::input(message).at(format!("{}:{}", self.table.file, self.rows.number()))
    }

    fn broken(&self, broken: &Broken) -> Error {
        match broken {
            Broken::Io(e) => unread(e, "cannot read the log file", &self.table.file),
            Broken::Long => self
                .error("expected rows of text, found one of more than 4 MiB".to_owned())
                .hint("a quote that is never closed, or no CSV file"),
            Broken::Binary => self
                .error("the log file must be UTF-8 text, found a zero byte".to_owned())
                .hint("save it as CSV in UTF-8"),
        }
    }
}

/// The most frequent of the usual delimiters in the header row, those in quotes not counted.
fn delimiter(header: &[u8]) -> u8 {
    let outside = || header.split(|b| *b == b'"').step_by(2).flatten();
    let count = |d: u8| outside().filter(|b| **b == d).count();
    [b'\t', b';', b',']
        .into_iter()
        .max_by_key(|d| count(*d))
        .unwrap_or(b',')
}

fn not_utf8(file: &str, line: u64) -> Error {
    Error::input("the log file must be UTF-8 text, found other bytes")
        .at(format!("{file}:{line}"))
        .hint("save it as UTF-8")
}
