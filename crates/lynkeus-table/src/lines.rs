//! Which line of the file each row stands on.

/// Lines of rows, kept only where they do not count up by one.
#[derive(Clone, Debug, Default)]
pub(super) struct Lines {
    rows: usize,
    /// where a run of consecutive lines starts: row and line
    runs: Vec<Run>,
}

#[derive(Clone, Copy, Debug)]
struct Run {
    row: usize,
    line: u64,
}

impl Lines {
    /// Of a table that is no file: row 0 is line 1.
    pub(super) fn counted(rows: usize) -> Self {
        let runs = vec![Run { row: 0, line: 1 }];
        Self { rows, runs }
    }

    pub(super) fn rows(&self) -> usize {
        self.rows
    }

    /// The next row stands on `line`.
    pub(super) fn push(&mut self, line: u64) {
        let row = self.rows;
        let expected = self
            .runs
            .last()
            .map(|run| run.line + (row - run.row) as u64);
        if expected != Some(line) {
            self.runs.push(Run { row, line });
        }
        self.rows += 1;
    }

    /// The line of a row.
    pub(super) fn of(&self, row: usize) -> u64 {
        let place = self.runs.partition_point(|run| run.row <= row);
        let run = place.checked_sub(1).and_then(|i| self.runs.get(i));
        run.map_or(0, |run| run.line + (row - run.row) as u64)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn only_gaps_take_room() {
        let mut lines = Lines::default();
        [2, 3, 5, 6, 7, 12]
            .into_iter()
            .for_each(|line| lines.push(line));
        let found: Vec<u64> = (0..6).map(|row| lines.of(row)).collect();
        assert_eq!(found, [2, 3, 5, 6, 7, 12]);
        assert_eq!((lines.rows(), lines.runs.len()), (6, 3));
    }
}
