//! Tables of numbers: measured logs read from CSV, estimates written to CSV.

mod read;
mod write;

use crate::Error;
use crate::near::{list, nearest};

pub use write::{significant, write_csv};

/// A table of named columns of equal length, all numbers.
///
/// A cell that is empty or no number is remembered with its line; asking for its column is then
/// an error that names the cell, so that columns nobody asks for may hold anything.
#[derive(Clone, Debug, Default)]
pub struct Table {
    file: String,
    columns: Vec<Column>,
    lines: Vec<u64>,
}

#[derive(Clone, Debug)]
struct Column {
    name: String,
    values: Vec<f64>,
    flaw: Option<Flaw>,
}

/// The first cell of a column that is not a finite number.
#[derive(Clone, Debug)]
struct Flaw {
    line: u64,
    text: String,
}

impl Table {
    /// A table from columns computed in Rust.
    ///
    /// # Errors
    /// The columns differ in length.
    pub fn from_columns(columns: Vec<(String, Vec<f64>)>) -> Result<Self, Error> {
        let rows = columns.first().map_or(0, |(_, values)| values.len());
        if let Some((name, values)) = columns.iter().find(|(_, values)| values.len() != rows) {
            return Err(Error::input(format!(
                "the columns of a table must be equally long: expected {rows} rows, found {} in \"{name}\"",
                values.len()
            )));
        }
        Ok(Self {
            file: String::new(),
            columns: columns
                .into_iter()
                .map(|(name, values)| Column {
                    name,
                    values,
                    flaw: None,
                })
                .collect(),
            lines: (1..).take(rows).collect(),
        })
    }

    /// The number of rows.
    pub fn rows(&self) -> usize {
        self.lines.len()
    }

    /// The headers, in order.
    pub fn names(&self) -> impl Iterator<Item = &str> + Clone {
        self.columns.iter().map(|c| c.name.as_str())
    }

    /// The file, for messages; empty for tables made in Rust.
    pub fn file(&self) -> &str {
        &self.file
    }

    /// A column if there is one of that name; cells that are no numbers are NaN.
    pub fn get(&self, name: &str) -> Option<&[f64]> {
        self.columns
            .iter()
            .find(|c| c.name == name)
            .map(|c| c.values.as_slice())
    }

    /// A column all of whose cells are finite numbers.
    ///
    /// # Errors
    /// There is no such column (the message lists those found), there are two, or a cell is
    /// empty, NaN, infinite or no number (the message gives its line).
    pub fn column(&self, name: &str) -> Result<&[f64], Error> {
        let mut matching = self.columns.iter().filter(|c| c.name == name);
        let Some(column) = matching.next() else {
            return Err(self.missing(name));
        };
        if matching.next().is_some() {
            return Err(
                Error::input(format!("two columns are called \"{name}\", expected one"))
                    .at(&self.file),
            );
        }
        match &column.flaw {
            None => Ok(&column.values),
            Some(flaw) => Err(Error::input(format!(
                "column \"{name}\" must hold a finite number in every row, found {}",
                if flaw.text.is_empty() {
                    "an empty cell".to_owned()
                } else {
                    format!("\"{}\"", flaw.text)
                }
            ))
            .at(format!("{}:{}", self.file, flaw.line))
            .hint("remove the row or fill the cell")),
        }
    }

    /// The time column: strictly increasing.
    ///
    /// # Errors
    /// As [`Table::column`], or a row's time is not after the one before it.
    pub fn time(&self, name: &str) -> Result<&[f64], Error> {
        if self.get(name).is_none() {
            return Err(self.without_time(name));
        }
        let time = self.column(name)?;
        let back = time.windows(2).position(|pair| pair[1] <= pair[0]);
        let Some(i) = back else { return Ok(time) };
        let (at, before) = (&time[i + 1], &time[i]);
        let line = |row: usize| self.lines.get(row).copied().unwrap_or_default();
        Err(Error::input(format!(
            "time must increase from row to row, found \"{name}\" = {at} after {before} in line {}",
            line(i)
        ))
        .at(format!("{}:{}", self.file, line(i + 1)))
        .hint("sort the rows by time and remove doubles"))
    }

    /// The time column is named by a key of its own.
    fn without_time(&self, name: &str) -> Error {
        let found = format!(
            "no time column \"{name}\"; the columns found are: {}",
            list(self.names())
        );
        let near = nearest(name, self.names()).unwrap_or("…");
        Error::input(found).at(&self.file).hint(format!(
            "if it has another name, set time = \"{near}\" in [estimate] of the study"
        ))
    }

    fn missing(&self, name: &str) -> Error {
        let found = format!(
            "no column \"{name}\"; the columns found are: {}",
            list(self.names())
        );
        let near = nearest(name, self.names());
        Error::input(found).at(&self.file).hint(match near {
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
