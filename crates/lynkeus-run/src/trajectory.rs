//! Tables of values over time.

/// What a column of a run holds.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Role {
    /// a state of the plant
    State,
    /// an input, as the plant has it
    Input,
    /// an input as it is read, where readings of inputs have errors
    Read,
    /// an output of the plant, exact
    Output,
    /// an output as its sensor shows it
    Measured,
    /// what an observer reports
    Estimate,
}

impl Role {
    /// The column of this role that is at `index`, from 0, in the order of its system.
    pub const fn at(self, index: usize) -> Column {
        Column { role: self, index }
    }
}

/// Which column of a run: names are for people and may repeat, this is unique.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Column {
    /// what it holds
    pub role: Role,
    /// its place among the columns of that role, from 0
    pub index: usize,
}

/// Columns over time, known by role and place; runs add their rows, tables and pictures take
/// the columns.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Trajectory {
    times: Vec<f64>,
    series: Vec<Series>,
}

#[derive(Clone, Debug, PartialEq)]
struct Series {
    column: Column,
    name: String,
    values: Vec<f64>,
}

impl Trajectory {
    /// The same table with further columns of a role, in the order of `names`; to be called
    /// before the first row.
    #[must_use]
    pub fn with(mut self, role: Role, names: &[String]) -> Self {
        let first = self.names(role).count();
        let series = names.iter().zip(first..).map(|(name, index)| Series {
            column: role.at(index),
            name: name.clone(),
            values: vec![],
        });
        self.series.extend(series);
        self
    }

    /// Adds a row, its values in the order in which the columns were added.
    ///
    /// # Panics
    /// If `values` has not one entry per column.
    pub fn push(&mut self, time: f64, values: &[f64]) {
        assert_eq!(values.len(), self.series.len(), "one value per column");
        self.times.push(time);
        for (series, value) in self.series.iter_mut().zip(values) {
            series.values.push(*value);
        }
    }

    /// Names of the columns of a role, in order.
    pub fn names(&self, role: Role) -> impl Iterator<Item = &str> {
        let named = self.series.iter().filter(move |s| s.column.role == role);
        named.map(|s| s.name.as_str())
    }

    /// The columns, in the order of a row's values.
    pub fn columns(&self) -> impl Iterator<Item = Column> + '_ {
        self.series.iter().map(|s| s.column)
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
        let values = self.series.iter().map(|series| series.values[index]);
        Some((time, values.collect()))
    }

    /// Rows in order of time.
    pub fn rows(&self) -> impl Iterator<Item = (f64, Vec<f64>)> + '_ {
        (0..self.len()).filter_map(|index| self.row(index))
    }

    /// The place of a column among the values of a row.
    pub(crate) fn place(&self, column: Column) -> Option<usize> {
        self.columns().position(|own| own == column)
    }

    /// The values of one column; none where the run has no such column.
    pub fn column(&self, column: Column) -> Option<&[f64]> {
        let mut found = self.series.iter().filter(|s| s.column == column);
        found.next().map(|series| series.values.as_slice())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn columns_of_one_name_are_told_apart_by_role_and_place() {
        let names = ["a".to_owned(), "a".to_owned()];
        let mut table = Trajectory::default()
            .with(Role::State, &names)
            .with(Role::Estimate, &names[..1]);
        table.push(0.0, &[1.0, 2.0, 3.0]);
        table.push(0.5, &[4.0, 5.0, 6.0]);
        assert_eq!(table.column(Role::State.at(1)), Some(&[2.0, 5.0][..]));
        assert_eq!(table.column(Role::Estimate.at(0)), Some(&[3.0, 6.0][..]));
        assert_eq!(table.column(Role::Estimate.at(1)), None);
        assert_eq!(table.column(Role::Input.at(0)), None);
        assert_eq!(table.names(Role::State).collect::<Vec<_>>(), ["a", "a"]);
        assert_eq!(table.row(1), Some((0.5, vec![4.0, 5.0, 6.0])));
        assert_eq!(table.row(2), None);
    }

    #[test]
    fn a_table_of_times_alone_keeps_its_rows() {
        let mut table = Trajectory::default();
        table.push(1.0, &[]);
        assert_eq!(table.rows().count(), 1);
    }
}
