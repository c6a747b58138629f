//! Columns that are computed from others.

use super::Table;
use super::column::{Column, Fault};
use crate::Series;
use lynkeus_answer::Error;

impl Table {
    /// The same with one more column, computed row by row from the columns `read`: it is missing where a cell that it
    /// reads is, and where what comes out is no finite number.
    ///
    /// # Errors
    /// A column that is read is not there, cannot be told, or holds dates; the disk is full.
    pub fn with_computed(
        &self,
        name: &str,
        read: &[&str],
        mut compute: impl FnMut(&[f64]) -> f64,
    ) -> Result<Self, Error> {
        let sources = read.iter().map(|header| self.numbers(header));
        let mut sources = sources.collect::<Result<Vec<_>, Error>>()?;
        let mut column = Column::new(name, &self.store);
        let mut cells = vec![f64::NAN; read.len()];
        let mut values = Series::within(&self.store);
        for row in 0..self.rows() {
            for (cell, source) in cells.iter_mut().zip(&mut sources) {
                *cell = source.next().unwrap_or(f64::NAN);
            }
            let value = match cells.iter().any(|cell| cell.is_nan()) {
                true => f64::NAN,
                false => compute(&cells),
            };
            if value.is_finite() {
                values.push(value);
                continue;
            }
            values.push(f64::NAN);
            let line = self.lines.of(row);
            match cells.iter().all(|cell| cell.is_finite()) {
                true => column.miss_number(line, value),
                false => column.miss(line, self.found(read, line)),
            }
        }
        column.values = values;
        self.store.check()?;
        let mut table = self.clone();
        table.columns.push(column);
        Ok(table)
    }

    /// The same with a column of dates or durations in a unit of so many seconds.
    ///
    /// # Errors
    /// The disk is full.
    pub fn with_unit(&self, name: &str, seconds: f64) -> Result<Self, Error> {
        let mut table = self.clone();
        let is_own = |column: &&mut Column| {
            column.name == name && (column.origin.is_some() || column.is_durations)
        };
        for column in table.columns.iter_mut().filter(is_own) {
            let values = column.values.iter().map(|x| x / seconds);
            column.values = Series::gathered(&self.store, values);
        }
        self.store.check()?;
        Ok(table)
    }

    /// The numbers of a column, of which every one may be missing.
    fn numbers(&self, header: &str) -> Result<crate::series::Iter<'_>, Error> {
        let values = self.cells(header)?;
        match self.origin(header) {
            None => Ok(values.iter()),
            Some(date) => Err(self.dates(header, date)),
        }
    }

    /// What stands in the first of the cells of a line that is known to be missing.
    fn found(&self, read: &[&str], line: u64) -> &str {
        let mut faults = read.iter().flat_map(|header| self.faults(header));
        let fault: Option<&Fault> = faults.find(|fault| fault.line == line);
        fault.map_or("", |fault| fault.found.as_str())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_row_is_missing_where_one_of_its_cells_is() {
        let text = "t,a,b\n0,1,2\n1,NA,2\n2,4,\n3,0,0\n4,5,1\n";
        let table = Table::parse(text, "log.csv").unwrap();
        let both = table.with_computed("a/b", &["a", "b"], |x| x[0] / x[1]);
        let both = both.unwrap();
        let told = |faults: &[Fault]| -> Vec<(u64, String)> {
            let faults = faults.iter();
            faults.map(|f| (f.line, f.found.clone())).collect()
        };
        assert_eq!(both.missing("a/b"), 3);
        assert_eq!(
            told(both.faults("a/b")),
            [(3, "NA".into()), (4, "".into()), (5, "NaN".into())]
        );
        let values = both.readings("a/b").unwrap().to_vec();
        assert_eq!((values[0], values[4]), (0.5, 5.0));
        assert_eq!(table.names().count(), 3);
        assert!(table.with_computed("z", &["c"], |x| x[0]).is_err());
    }

    #[test]
    fn a_long_column_is_computed_on_disk() {
        let rows = 100_000;
        let numbers: Vec<f64> = (0..rows).map(f64::from).collect();
        let table = Table::from_columns(vec![("a".into(), numbers)]).unwrap();
        let twice = table.with_computed("2*a", &["a"], |x| 2.0 * x[0]).unwrap();
        let values = twice.readings("2*a").unwrap();
        assert!(values.iter().eq((0..rows).map(|k| 2.0 * f64::from(k))));
    }
}
