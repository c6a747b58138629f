//! Rows that are late, repeated, or have no time.

use super::Table;
use super::column::Column;
use super::lines::Lines;
use crate::Error;

/// A row may be so many times the usual step late where the study does not say.
const LATE: f64 = 10.0;

/// A table in the order of time, and what was done for it.
#[derive(Clone, Debug)]
pub struct Ordered {
    /// the table, its times strictly increasing
    pub table: Table,
    /// in words
    pub notes: Vec<String>,
}

impl Table {
    /// The table in the order of its times, where it is not so already: a row that comes late is
    /// put in its place, rows of one time become one (the last value of each column that is
    /// there), rows without time are left out.
    ///
    /// # Errors
    /// There is no such column, or a row comes later than `late` (without it, than ten usual
    /// steps): its clock jumped.
    pub fn in_order(&self, time: &str, late: Option<f64>) -> Result<Option<Ordered>, Error> {
        if !self.names().any(|n| n == time) {
            return Err(self.without_time(time));
        }
        let times = self.readings(time)?;
        if times.iter().all(|t| t.is_finite()) && times.windows(2).all(|w| w[0] < w[1]) {
            return Ok(None);
        }
        let late = late.unwrap_or_else(|| LATE * usual_step(times));
        let mut latest = f64::NEG_INFINITY;
        let mut count = 0;
        for (row, &t) in times.iter().enumerate().filter(|(_, t)| t.is_finite()) {
            if latest - t > late {
                return Err(self.jumped(time, row, t, latest));
            }
            count += usize::from(t < latest);
            latest = latest.max(t);
        }
        let mut rows: Vec<usize> = (0..times.len())
            .filter(|&row| times[row].is_finite())
            .collect();
        let timeless = times.len() - rows.len();
        rows.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let groups: Vec<&[usize]> = rows.chunk_by(|&a, &b| times[a] == times[b]).collect();
        let repeated = rows.len() - groups.len();
        let columns = self.columns.iter().map(|column| merged(column, &groups));
        let notes = [
            (count, "came late and were put in their place"),
            (
                repeated,
                "repeat a time: the last value of each column counts",
            ),
            (timeless, "have no time and are left out"),
        ];
        Ok(Some(Ordered {
            table: Table {
                file: self.file.clone(),
                columns: columns.collect(),
                lines: Lines::counted(groups.len()),
            },
            notes: notes
                .into_iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, what)| format!("rows of the log: {count} {what}"))
                .collect(),
        }))
    }

    fn jumped(&self, time: &str, row: usize, t: f64, latest: f64) -> Error {
        Error::input(format!(
            "the clock jumps back: \"{time}\" = {t} after {latest}, more than a late row may be"
        ))
        .at(format!("{}:{}", self.file, self.lines.of(row)))
        .hint("split the log there, or allow later rows: `late` of [estimate], in units of time")
    }
}

/// The median of the steps that go forward.
fn usual_step(times: &[f64]) -> f64 {
    let steps = times.windows(2).map(|w| w[1] - w[0]);
    let mut steps: Vec<f64> = steps.filter(|step| *step > 0.0).collect();
    steps.sort_unstable_by(f64::total_cmp);
    steps.get(steps.len() / 2).copied().unwrap_or(0.0)
}

/// A column over groups of rows: the last value that is there.
fn merged(column: &Column, groups: &[&[usize]]) -> Column {
    let value = |group: &&[usize]| {
        let values = group.iter().rev().map(|&row| column.values[row]);
        values
            .into_iter()
            .find(|x| x.is_finite())
            .unwrap_or(f64::NAN)
    };
    let mut merged = column.clone();
    merged.values = groups.iter().map(value).collect();
    merged.missing = merged.values.iter().filter(|x| !x.is_finite()).count();
    if merged.missing == 0 {
        merged.faults.clear();
    }
    merged
}

#[cfg(test)]
mod tests {
    use super::*;

    fn read(text: &str, late: Option<f64>) -> Result<Option<Ordered>, Error> {
        Table::parse(text, "log.csv").unwrap().in_order("t", late)
    }

    #[test]
    fn late_rows_find_their_place_and_doubles_become_one() {
        let text = "t,y,u\n0,1,5\n2,3,5\n1,2,6\n2,,7\n,9,9\n3,4,8\n";
        let Ordered { table, notes } = read(text, None).unwrap().unwrap();
        assert_eq!(table.time("t").unwrap(), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(table.readings("y").unwrap(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(table.readings("u").unwrap(), [5.0, 6.0, 7.0, 8.0]);
        assert_eq!(notes.len(), 3, "{notes:?}");
        assert!(read("t,y\n0,1\n1,2\n", None).unwrap().is_none());
    }

    #[test]
    fn a_clock_that_jumps_is_named() {
        let mut text = "t,y\n".to_owned();
        for t in (0..50).chain(0..50) {
            text += &format!("{t},1\n");
        }
        let error = read(&text, None).unwrap_err().to_string();
        assert!(
            error.contains("log.csv:52") && error.contains("jumps back"),
            "{error}"
        );
        assert_eq!(read(&text, Some(60.0)).unwrap().unwrap().table.rows(), 50);
    }
}
