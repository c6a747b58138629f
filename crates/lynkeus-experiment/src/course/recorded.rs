//! The rows of a run, however many.

use lynkeus_run::{Column, Simulation};

use crate::Series;
use lynkeus_table::series::Store;

/// What a [`Trajectory`](lynkeus_run::Trajectory) holds in memory, in columns that may be longer.
#[derive(Clone, Debug)]
pub struct Recorded {
    /// times of the rows
    pub time: Series,
    columns: Vec<Recording>,
    /// what keeps them all
    pub store: Store,
}

#[derive(Clone, Debug)]
struct Recording {
    column: Column,
    values: Series,
}

impl Recorded {
    /// Of a run that has not begun.
    pub fn new(simulation: &Simulation) -> Self {
        let store = Store::default();
        let table = simulation.table();
        let columns = table.columns().map(|column| Recording {
            column,
            values: Series::within(&store),
        });
        Self {
            time: Series::within(&store),
            columns: columns.collect(),
            store,
        }
    }

    /// Adds a row, its values in the order of the run.
    pub fn push(&mut self, time: f64, row: &[f64]) {
        self.time.push(time);
        for (recording, value) in self.columns.iter_mut().zip(row) {
            recording.values.push(*value);
        }
    }

    /// The values of one column; none where the run has no such column.
    pub fn column(&self, column: Column) -> Option<&Series> {
        let mut found = self.columns.iter().filter(|c| c.column == column);
        found.next().map(|recording| &recording.values)
    }

    /// Keeps the first rows only.
    pub fn truncate(&mut self, rows: usize) {
        let own = self.columns.iter_mut().map(|c| &mut c.values);
        for values in std::iter::once(&mut self.time).chain(own) {
            if rows < values.len() {
                *values = values.shortened(rows);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use lynkeus_expr::Graph;
    use lynkeus_run::{Role, System};

    use super::*;

    /// x' = −x from 1, under an input that nobody reads.
    fn decay(rows: usize) -> Simulation {
        let g = Graph::new();
        let [time, x, u] = ["time", "x", "u"].map(|name| g.symbol(name));
        let state = [("x".to_owned(), x.node(), 1.0)];
        let signal = [("u".to_owned(), u.node())];
        let plant = System::new(&g, time.node(), &state, &signal, &[(-x).node()], &[]).unwrap();
        let course = [("u".to_owned(), time.sin().node())];
        let inputs = System::new(&g, time.node(), &[], &[], &[], &course).unwrap();
        Simulation::new(plant, inputs, 1.0, 1.0 / (rows - 1) as f64)
    }

    #[test]
    fn rows_that_go_to_the_disk_are_those_of_the_run() {
        let simulation = decay(100_001);
        let mut recorded = Recorded::new(&simulation);
        let take = &mut |time: f64, row: &[f64]| recorded.push(time, row);
        let watch = &mut |_| std::ops::ControlFlow::Continue(());
        simulation.run_into(take, watch).unwrap();
        let run = simulation.run().unwrap();
        let same = |recorded: &Recorded, rows: usize| {
            assert_eq!(recorded.time.to_vec(), run.times()[..rows]);
            for column in [Role::State.at(0), Role::Input.at(0)] {
                let values = recorded.column(column).unwrap().to_vec();
                assert_eq!(values, run.column(column).unwrap()[..rows]);
            }
        };
        same(&recorded, 100_001);
        assert!(recorded.column(Role::Estimate.at(0)).is_none());
        recorded.truncate(200_000);
        same(&recorded, 100_001);
        recorded.truncate(70_000);
        same(&recorded, 70_000);
    }
}
