//! CSV text to tables.

use std::io::{BufRead, BufReader};
use std::path::Path;

use super::Table;
use super::column::{Column, OutOfMemory};
use super::lines::Lines;
use super::marks::FileMarks;
use super::row::{Broken, Rows};
use crate::Error;

/// Rows after which the length of the file tells how many there will be.
const SAMPLE: usize = 4096;

/// Most columns of a log.
const MOST_COLUMNS: usize = 100_000;

impl Table {
    /// Reads a CSV file with a header row, or a Parquet file if it is called `*.parquet`.
    ///
    /// The delimiter is a comma, a semicolon or a tab, whichever the header has most of; headers
    /// and cells are trimmed. Decimal commas, marks between thousands, and dates are understood
    /// where they leave no doubt. The file is read as a stream: only the numbers are kept.
    ///
    /// # Errors
    /// The file is missing, no file, not UTF-8 text, empty, has no rows, does not fit into memory,
    /// or a row has more or fewer cells than the header.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        let file = crate::files::open(path, "log")?;
        #[cfg(feature = "parquet")]
        if super::is_parquet(path) {
            return super::parquet::load(file, &path.display().to_string());
        }
        let length = file.metadata().map_or(0, |data| data.len());
        let input = BufReader::with_capacity(1 << 16, file);
        read(input, &path.display().to_string(), Some(length))
    }

    /// Reads CSV text; `file` names it in messages.
    ///
    /// # Errors
    /// As [`Table::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        read(text.as_bytes(), file, None)
    }
}

/// A table while it is read.
struct Reading<R> {
    rows: Rows<R>,
    table: Table,
    delimiter: u8,
    /// bytes of the file
    length: Option<u64>,
    /// bytes of the rows so far
    seen: u64,
    scratch: String,
}

fn read(input: impl BufRead, file: &str, length: Option<u64>) -> Result<Table, Error> {
    let mut reading = Reading {
        rows: Rows::new(input),
        table: Table {
            file: file.to_owned(),
            columns: Vec::new(),
            lines: Lines::default(),
        },
        delimiter: b',',
        length,
        seen: 0,
        scratch: String::new(),
    };
    reading.header()?;
    while reading.next()? {
        reading.row()?;
    }
    reading.finish()
}

impl<R: BufRead> Reading<R> {
    fn next(&mut self) -> Result<bool, Error> {
        self.rows.next().map_err(|broken| self.broken(&broken))
    }

    fn header(&mut self) -> Result<(), Error> {
        let any = self.next()?;
        self.delimiter = delimiter(self.rows.raw());
        let count = self.rows.split(self.delimiter);
        if count > MOST_COLUMNS {
            return Err(self.error(format!(
                "expected at most {MOST_COLUMNS} columns, found {count}"
            )));
        }
        for index in 0..count {
            let name = self.rows.cell(index, &mut self.scratch);
            let name = name.map_err(|_| not_utf8(&self.table.file, self.rows.number()))?;
            self.table.columns.push(Column::new(name));
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
        for (index, column) in self.table.columns.iter_mut().enumerate() {
            let text = self.rows.cell(index, &mut self.scratch);
            let text = text.map_err(|_| not_utf8(&self.table.file, line))?;
            column
                .push(text, line)
                .map_err(|_| too_large(&self.table.file, &self.table.lines, count))?;
        }
        self.seen += self.rows.raw().len() as u64 + 1;
        match self.table.rows() == SAMPLE {
            true => self.reserve(),
            false => Ok(()),
        }
    }

    /// Makes room for the rows that the file seems to have.
    fn reserve(&mut self) -> Result<(), Error> {
        let length = self.length.unwrap_or(0);
        // a little more than needed costs nothing: it is given back at the end
        let rows = 1.02 * length as f64 / (self.seen as f64 / SAMPLE as f64);
        let columns = self.table.columns.len();
        for column in &mut self.table.columns {
            column
                .reserve(rows as usize)
                .map_err(|OutOfMemory| too_large(&self.table.file, &self.table.lines, columns))?;
        }
        Ok(())
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
        Ok(table)
    }

    fn error(&self, message: String) -> Error {
        Error::input(message).at(format!("{}:{}", self.table.file, self.rows.number()))
    }

    fn broken(&self, broken: &Broken) -> Error {
        match broken {
            Broken::Io(e) => {
                Error::input(format!("cannot read the log file: {e}")).at(&self.table.file)
            }
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

fn too_large(file: &str, lines: &Lines, columns: usize) -> Error {
    Error::input(format!(
        "the log does not fit into memory: {columns} columns, {} rows read",
        lines.rows()
    ))
    .at(file)
    .hint("keep the columns that the study reads, or fewer rows at a time")
}
