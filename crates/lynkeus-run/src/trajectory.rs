//! Tables of values over time.

/// Named columns over time, row by row.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    names: Vec<String>,
    times: Vec<f64>,
    values: Vec<f64>,
}

impl Trajectory {
    /// An empty table with these columns beside time.
    pub fn new(names: Vec<String>) -> Self {
        Self {
            names,
            times: vec![],
            values: vec![],
        }
    }

    /// Adds a row.
    ///
    /// # Panics
    /// If `values` has not one entry per column.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        assert_eq!(values.len(), self.names.len(), "one value per column");
        self.times.push(time);
        self.values.extend_from_slice(values);
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
    pub fn row(&self, index: usize) -> Option<(f64, &[f64])> {
        let width = self.names.len();
        let values = self.values.get(index * width..(index + 1) * width)?;
        Some((*self.times.get(index)?, values))
    }

    /// Rows in order of time.
    pub fn rows(&self) -> impl Iterator<Item = (f64, &[f64])> + '_ {
        (0..self.len()).filter_map(|index| self.row(index))
    }

    /// The values of one column.
    pub fn column(&self, name: &str) -> Option<Vec<f64>> {
        let place = self.names.iter().position(|n| n == name)?;
        Some(self.rows().map(|(_, row)| row[place]).collect())
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
        assert_eq!(table.row(1), Some((0.5, &[3.0, 4.0][..])));
        assert_eq!(table.row(2), None);
    }

    #[test]
    fn a_table_of_times_alone_keeps_its_rows() {
        let mut table = Trajectory::default();
        table.push(1.0, &[]);
        assert_eq!(table.rows().count(), 1);
    }
}
