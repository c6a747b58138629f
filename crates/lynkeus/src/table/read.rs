//! CSV text to tables.

use std::path::Path;

use csv::{ReaderBuilder, StringRecord, Trim};

use super::{Column, Flaw, Table};
use crate::Error;

impl Table {
    /// Reads a CSV file with a header row.
    ///
    /// The delimiter is a comma, a semicolon or a tab, whichever the header has most of; headers
    /// and cells are trimmed; beside a semicolon or a tab, a decimal comma is understood.
    ///
    /// # Errors
    /// The file is missing, not UTF-8, empty, has no rows, or a row has more or fewer cells than
    /// the header.
    pub fn load(path: impl AsRef<Path>) -> Result<Self, Error> {
        let path = path.as_ref();
        Self::parse(
            &crate::files::read_text(path, "log")?,
            &path.display().to_string(),
        )
    }

    /// Reads CSV text; `file` names it in messages.
    ///
    /// # Errors
    /// As [`Table::load`].
    pub fn parse(text: &str, file: &str) -> Result<Self, Error> {
        let delimiter = delimiter(text);
        let mut reader = ReaderBuilder::new()
            .delimiter(delimiter)
            .flexible(true)
            .trim(Trim::All)
            .from_reader(text.as_bytes());
        let header = reader.headers().map_err(|e| broken(file, &e))?.clone();
        if header.iter().all(str::is_empty) {
            return Err(Error::input(
                "expected a header row with column names, found an empty file",
            )
            .at(file));
        }
        let mut table = empty(file, &header);
        let mut record = StringRecord::new();
        while reader
            .read_record(&mut record)
            .map_err(|e| broken(file, &e))?
        {
            table.push(&record, line_of(&record, text), delimiter)?;
        }
        if table.lines.is_empty() {
            return Err(
                Error::input("expected rows of numbers below the header, found none").at(file),
            );
        }
        Ok(table)
    }

    fn push(&mut self, record: &StringRecord, line: u64, delimiter: u8) -> Result<(), Error> {
        if record.len() != self.columns.len() {
            return Err(Error::input(format!(
                "expected {} cells as in the header, found {}",
                self.columns.len(),
                record.len()
            ))
            .at(format!("{}:{line}", self.file)));
        }
        self.lines.push(line);
        for (column, cell) in self.columns.iter_mut().zip(record) {
            let value = number(cell, delimiter);
            if value.is_none() && column.flaw.is_none() {
                column.flaw = Some(Flaw {
                    line,
                    text: cell.to_owned(),
                });
            }
            column.values.push(value.unwrap_or(f64::NAN));
        }
        Ok(())
    }
}

fn empty(file: &str, header: &StringRecord) -> Table {
    Table {
        file: file.to_owned(),
        columns: header
            .iter()
            .map(|name| Column {
                name: name.to_owned(),
                values: Vec::new(),
                flaw: None,
            })
            .collect(),
        lines: Vec::new(),
    }
}

/// The line a record stands on: the reader's own count stops at the blank lines above it.
fn line_of(record: &StringRecord, text: &str) -> u64 {
    let Some(position) = record.position() else {
        return 0;
    };
    let start = usize::try_from(position.byte()).unwrap_or(usize::MAX);
    let blank = text
        .get(start..)
        .unwrap_or_default()
        .bytes()
        .take_while(|byte| matches!(byte, b'\n' | b'\r'))
        .filter(|byte| *byte == b'\n')
        .count();
    position.line() + blank as u64
}

/// The most frequent of the usual delimiters in the header row.
fn delimiter(text: &str) -> u8 {
    let header = text.lines().next().unwrap_or("");
    let count = |d: u8| header.bytes().filter(|b| *b == d).count();
    [b'\t', b';', b',']
        .into_iter()
        .max_by_key(|d| count(*d))
        .unwrap_or(b',')
}

fn number(cell: &str, delimiter: u8) -> Option<f64> {
    let value = match delimiter {
        b',' => cell.parse(),
        _ => cell.replacen(',', ".", 1).parse(),
    };
    value.ok().filter(|x: &f64| x.is_finite())
}

fn broken(file: &str, error: &csv::Error) -> Error {
    Error::input(format!("not a CSV file: {error}")).at(file)
}
