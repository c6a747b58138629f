//! Tables of what a program holds.

use super::Table;
use super::column::Column;
use super::instant::{self, Instant};
use super::lines::Lines;
use super::marks::Refusal;
use crate::Series;
use crate::series::{Lent, Store};
use lynkeus_answer::Error;

/// Numbers of a column that stay in memory while they come; longer columns go to a temporary file.
const IN_MEMORY: usize = 1 << 22;

/// Numbers that are looked at together.
const BATCH: usize = 1024;

/// A table while a program gives its columns. Rows count from 1 in messages.
///
/// ```
/// use lynkeus_table::{Gathering, Instant};
///
/// let log = Gathering::new("log");
/// let mut time = log.column("t");
/// let second = 1_000_000_000;
/// time.instants((0..3).map(|i| Some(Instant::at(i * second, true))));
/// let mut level = log.column("level");
/// level.numbers([4.0, f64::NAN, 4.2].into_iter());
/// let note = log.refused("note", "expected numbers, found texts", "leave it out");
/// let table = log.table(vec![time, level, note])?;
/// assert_eq!(table.origin("t"), Some("1970-01-01T00:00:00Z"));
/// assert_eq!(table.missing("level"), 1);
/// assert!(table.readings("note").is_err());
/// # Ok::<(), lynkeus_answer::Error>(())
/// ```
#[derive(Clone, Debug)]
pub struct Gathering {
    name: String,
    store: Store,
}

/// A column while its rows come.
#[derive(Debug)]
pub struct Gathered {
    column: Column,
    /// what is not yet in the column
    values: Vec<f64>,
    /// nothing is known of its rows
    is_refused: bool,
}

impl Gathering {
    /// The beginning of a table; messages call it by this name.
    #[must_use]
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            store: Store::default(),
        }
    }

    /// A column that has no rows yet.
    #[must_use]
    pub fn column(&self, header: &str) -> Gathered {
        Gathered {
            column: Column::new(header, &self.store),
            values: vec![],
            is_refused: false,
        }
    }

    /// A column whose numbers stay where they are, unless one of them is infinite.
    #[must_use]
    pub fn lent(&self, header: &str, values: Lent) -> Gathered {
        let numbers = (*values).as_ref();
        if !are_finite(numbers) && numbers.iter().any(|x| x.is_infinite()) {
            return self.owned(header, numbers.to_vec());
        }
        let mut gathered = self.column(header);
        gathered.miss(0, numbers);
        gathered.column.values = Series::lent(values);
        gathered
    }

    /// A column of these numbers; what is not finite is missing.
    #[must_use]
    pub fn owned(&self, header: &str, mut values: Vec<f64>) -> Gathered {
        let mut gathered = self.column(header);
        gathered.miss(0, &values);
        if gathered.column.missing > 0 {
            values.iter_mut().for_each(blank);
        }
        gathered.values = values;
        gathered
    }

    /// A column of seconds since an instant, which is written as in a log; what is not finite is
    /// missing.
    ///
    /// # Errors
    /// `origin` is no instant.
    pub fn since(&self, header: &str, values: Vec<f64>, origin: &str) -> Result<Gathered, Error> {
        let instant = instant::read(origin).ok_or_else(|| {
            Error::input(format!("expected an instant, found \"{origin}\"")).at(&self.name)
        })?;
        let mut gathered = self.owned(header, values);
        // its only cell so far
        gathered.column.instant(instant, 1, origin);
        Ok(gathered)
    }

    /// A column that is refused where it is asked for, whatever its rows are.
    #[must_use]
    pub fn refused(&self, header: &str, message: &str, hint: &'static str) -> Gathered {
        let mut gathered = self.column(header);
        gathered.column.refusal = Some(Refusal {
            line: 0,
            message: message.to_owned(),
            hint,
        });
        gathered.is_refused = true;
        gathered
    }

    /// The table of these columns.
    ///
    /// # Errors
    /// The columns differ in length, there is none, or they have no rows.
    pub fn table(&self, columns: Vec<Gathered>) -> Result<Table, Error> {
        let known = columns.iter().filter(|c| !c.is_refused);
        let shortest = known.clone().map(Gathered::len).min();
        let nothing = match shortest {
            Some(0) => Some("rows"),
            None if columns.is_empty() => Some("columns"),
            _ => None,
        };
        let table = self.ragged(columns)?;
        table.store.check()?;
        match nothing {
            None => Ok(table),
            Some(what) => {
                Err(Error::input(format!("expected {what}, found none")).at(table.file()))
            }
        }
    }

    /// The same, perhaps without rows.
    pub(super) fn ragged(&self, columns: Vec<Gathered>) -> Result<Table, Error> {
        let mut known = columns.iter().filter(|c| !c.is_refused);
        let first = known.next();
        let rows = first.map_or(0, Gathered::len);
        if let (Some(first), Some(other)) = (first, known.find(|c| c.len() != rows)) {
            let error = Error::input(format!(
                "the columns of a table must be equally long: expected {rows} rows as in \"{}\", found {} in \"{}\"",
                first.column.name,
                other.len(),
                other.column.name
            ));
            return Err(match self.name.as_str() {
                "" => error,
                name => error.at(name),
            });
        }
        Ok(Table {
            file: self.name.clone(),
            columns: columns.into_iter().map(Gathered::finished).collect(),
            truth: vec![],
            lines: Lines::counted(rows),
            store: self.store.clone(),
        })
    }
}

impl Table {
    /// A table from columns computed in Rust; a value that is not finite is missing.
    ///
    /// # Errors
    /// The columns differ in length.
    pub fn from_columns(columns: Vec<(String, Vec<f64>)>) -> Result<Self, Error> {
        let table = Gathering::new("");
        let columns = columns.into_iter();
        let columns = columns.map(|(name, values)| table.owned(&name, values));
        let columns = columns.collect();
        table.ragged(columns)
    }
}

impl Gathered {
    /// The number of rows so far.
    #[must_use]
    pub fn len(&self) -> usize {
        self.column.values.len() + self.values.len()
    }

    /// Whether it has no row yet.
    #[must_use]
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// Takes rows of numbers; one that is not finite is missing.
    pub fn numbers(&mut self, numbers: impl Iterator<Item = f64>) {
        let from = self.values.len();
        self.values.extend(numbers);
        let mut values = std::mem::take(&mut self.values);
        if let Some(new) = values.get_mut(from..) {
            let before = self.column.missing;
            self.miss(self.column.values.len() + from, new);
            if self.column.missing > before {
                new.iter_mut().for_each(blank);
            }
        }
        self.values = values;
        self.put_away();
    }

    /// Takes rows of points in time, none where one is missing, all with a zone or all without.
    pub fn instants(&mut self, instants: impl Iterator<Item = Option<Instant>>) {
        for instant in instants {
            let value = match instant {
                Some(instant) => self.seconds(instant),
                None => self.nothing(),
            };
            self.values.push(value);
        }
        self.put_away();
    }

    /// Takes a row.
    pub fn cell(&mut self, cell: Cell) {
        let line = self.len() as u64 + 1;
        let value = match cell {
            Cell::Number(x) if x.is_finite() => self.column.number(x, line, &x.to_string()),
            Cell::Number(_) | Cell::Missing => self.nothing(),
            Cell::Instant(instant) => self.seconds(instant),
        };
        self.values.push(value);
        self.put_away();
    }

    fn seconds(&mut self, instant: Instant) -> f64 {
        match self.column.since_origin(instant) {
            Some(seconds) => seconds,
            None => {
                let line = self.len() as u64 + 1;
                self.column.instant(instant, line, &instant.to_string())
            }
        }
    }

    fn nothing(&mut self) -> f64 {
        let line = self.len() as u64 + 1;
        self.column.miss(line, "");
        f64::NAN
    }

    /// Counts what is missing among numbers, of which the first is in this row.
    fn miss(&mut self, row: usize, numbers: &[f64]) {
        for (batch, numbers) in numbers.chunks(BATCH).enumerate() {
            if are_finite(numbers) {
                continue;
            }
            let row = row + batch * BATCH;
            let missing = numbers.iter().enumerate().filter(|(_, x)| !x.is_finite());
            for (i, x) in missing {
                let line = (row + i) as u64 + 1;
                self.column.miss_number(line, *x);
            }
        }
    }

    /// A long column goes on in a temporary file.
    fn put_away(&mut self) {
        if self.values.len() >= IN_MEMORY || !self.column.values.is_empty() {
            let values = self.values.drain(..);
            values.for_each(|x| self.column.values.push(x));
        }
    }

    fn finished(self) -> Column {
        let mut column = self.column;
        if column.values.is_empty() {
            column.values = Series::lent(std::sync::Arc::new(self.values));
        }
        column
    }
}

/// What a program says in one row of a column that holds anything.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cell {
    /// a number; missing where it is not finite
    Number(f64),
    /// a point in time
    Instant(Instant),
    /// nothing
    Missing,
}

fn are_finite(numbers: &[f64]) -> bool {
    let batch = |numbers: &[f64]| numbers.iter().fold(true, |all, x| all & x.is_finite());
    numbers.chunks(BATCH).all(batch)
}

/// What is not finite is missing.
fn blank(x: &mut f64) {
    if !x.is_finite() {
        *x = f64::NAN;
    }
}

#[cfg(test)]
mod tests;
