//! Tables of values over time.

/// Named columns over time; runs add their rows, tables and pictures take the columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    names: Vec<String>,
    times: Vec<f64>,
    columns: Vec<Vec<f64>>,
}

impl Trajectory {
    /// An empty table with these columns beside time.
    pub fn new(names: Vec<String>) -> Self {
        Self {
            columns: vec![vec![]; names.len()],
            names,
            times: vec![],
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If `values` has not one entry per column.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        assert_eq!(values.len(), self.names.len(), "one value per column");
        self.times.push(time);
        for (column, value) in self.columns.iter_mut().zip(values) {
            column.push(*value);
        }
    }

    /// Names of the columns, without time.
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// Number of rows.
    pub fn len(&self) -> usize {
        self.times.len()
    }

    /// True before the first row.
    pub fn is_empty(&self) -> bool {
        self.times.is_empty()
    }

    /// The times of the rows.
    pub fn times(&self) -> &[f64] {
        &self.times
    }

    /// Time and values of row `index`.
    pub fn row(&self, index: usize) -> Option<(f64, Vec<f64>)> {
        let time = *self.times.get(index)?;
        let values = self.columns.iter().map(|column| column[index]);
        Some((time, values.collect()))
    }

    /// Rows in order of time.
    pub fn rows(&self) -> impl Iterator<Item = (f64, Vec<f64>)> + '_ {
        (0..self.len()).filter_map(|index| self.row(index))
    }

    /// The values of one column.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.names.iter().position(|n| n == name)?;
        Some(self.columns[place].clone())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_are_found_by_name() {
        let mut table = Trajectory::new(vec!["a".into(), "b".into()]);
        table.push(0.0, &[1.0, 2.0]);
        table.push(0.5, &[3.0, 4.0]);
        assert_eq!(table.column("b"), Some(vec![2.0, 4.0]));
        assert_eq!(table.column("c"), None);
        assert_eq!(table.row(1), Some((0.5, vec![3.0, 4.0])));
        assert_eq!(table.row(2), None);
    }

    #[test]
    fn a_table_of_times_alone_keeps_its_rows() {
        let mut table = Trajectory::default();
        table.push(1.0, &[]);
        assert_eq!(table.rows().count(), 1);
    }
}
