//! Rows that are late, repeated, or have no time.

use super::Table;
use super::column::{Column, Fault};
use super::lines::Lines;
use crate::Series;
use crate::series::{Sorted, steps};
use lynkeus_answer::Error;

/// A row may be so many times the usual step late where the study does not say.
const LATE: f64 = 10.0;

/// A table in the order of time, and what was done for it.
#[derive(Clone, Debug)]
pub struct Ordered {
    /// the table, its times strictly increasing
    pub table: Table,
    /// in words
    pub notes: Vec<String>,
    /// what of each column counts nowhere, in their order
    pub lost: Vec<Lost>,
}

/// Values of a column that count nowhere.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Lost {
    /// header of the column
    pub column: String,
    /// times at which rows have different values; the last one of them counts
    pub conflicts: usize,
    /// the first of these
    pub first: Option<Conflict>,
    /// values in rows without a time
    pub timeless: usize,
}

/// Two values of one time.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Conflict {
    /// the time
    pub time: f64,
    /// the value that does not count
    pub lost: f64,
    /// where it stands
    pub line: u64,
    /// the value that counts
    pub kept: f64,
    /// where that stands
    pub kept_line: u64,
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
        if self.called(time).next().is_none() {
            return Err(self.without_time(time));
        }
        let times = self.times(time)?;
        let mut before = f64::NEG_INFINITY;
        if times
            .iter()
            .all(|t| t.is_finite() && std::mem::replace(&mut before, t) < t)
        {
            return Ok(None);
        }
        let late = late.unwrap_or_else(|| LATE * usual_step(times));
        let mut latest = f64::NEG_INFINITY;
        let mut count = 0;
        for (row, t) in times.iter().enumerate().filter(|(_, t)| t.is_finite()) {
            if latest - t > late {
                return Err(self.jumped(time, row, t, latest));
            }
            count += usize::from(t < latest);
            latest = latest.max(t);
        }
        let groups = Groups::of(times)?;
        let timeless = times.len() - groups.rows.len();
        let repeated = groups.rows.len() - groups.count;
        let mut lost = vec![];
        let merged = |column: &Column| {
            // nobody reads it, and it may have no rows
            if column.refusal.is_some() {
                return Ok(column.clone());
            }
            let (values, contradicted) = groups.merged(&column.values)?;
            let faults = groups.faults_left(&column.faults, &values, &self.lines);
            lost.push(Lost {
                column: column.name.clone(),
                conflicts: contradicted.count,
                first: contradicted.first.map(|pair| self.conflict(times, pair)),
                timeless: without_time(times, &column.values),
            });
            Ok(column.with(values, faults))
        };
        let columns: Result<Vec<Column>, Error> = self.columns.iter().map(merged).collect();
        let notes = [
            (count, "that came late and were put in their place"),
            (
                repeated,
                "that repeat a time, of which the last value of each column counts",
            ),
            (timeless, "that have no time and are left out"),
        ];
        Ok(Some(Ordered {
            table: Table {
                file: self.file.clone(),
                columns: columns?,
                truth: vec![],
                lines: Lines::counted(groups.count),
                store: self.store.clone(),
            },
            notes: notes
                .into_iter()
                .filter(|(count, _)| *count > 0)
                .map(|(count, what)| format!("rows of the log {what}: {count}"))
                .collect(),
            lost,
        }))
    }

    fn conflict(&self, times: &Series, [lost, kept]: [(usize, f64); 2]) -> Conflict {
        Conflict {
            time: times.get(kept.0).unwrap_or(f64::NAN),
            lost: lost.1,
            line: self.lines.of(lost.0),
            kept: kept.1,
            kept_line: self.lines.of(kept.0),
        }
    }

    fn jumped(&self, time: &str, row: usize, t: f64, latest: f64) -> Error {
        Error::input(format!(
            "the clock jumps back: \"{time}\" = {t} after {latest}, more than a late row may be"
        ))
        .at(self.place_of(self.lines.of(row)))
        .hint(format!("{APART}, or split it there, or allow later rows: `late` of [estimate], in units of time"))
    }
}

/// What to do about a log of several assets.
pub const APART: &str =
    "give each of several assets a log of its own (in Python: `estimate_each` with `by`)";

/// The median of the steps from each time to the next later one: what order the rows are in has no say.
fn usual_step(times: &Series) -> f64 {
    let there = times.iter().filter(|t| t.is_finite());
    let in_order = Sorted::new(times.store(), there);
    let forward = steps(in_order.iter()).filter(|step| *step > 0.0);
    Sorted::new(times.store(), forward).median().unwrap_or(0.0)
}

/// Values in rows that have no time.
fn without_time(times: &Series, values: &Series) -> usize {
    let rows = times.iter().zip(values);
    rows.filter(|(t, x)| !t.is_finite() && x.is_finite())
        .count()
}

/// Times at which a column says different things.
#[derive(Default)]
struct Contradicted {
    count: usize,
    /// the first of them: a row and its value that do not count, and those that do
    first: Option<[(usize, f64); 2]>,
}

/// The rows that have a time, in the order of their times; those of one time are a group.
struct Groups {
    rows: Vec<usize>,
    /// whether a row is the last one of its time
    ends: Vec<bool>,
    count: usize,
}

impl Groups {
    fn of(times: &Series) -> Result<Self, Error> {
        let times = times.held()?;
        let mut rows: Vec<usize> = (0..times.len())
            .filter(|&row| times[row].is_finite())
            .collect();
        rows.sort_by(|&a, &b| times[a].total_cmp(&times[b]));
        let after = rows.iter().skip(1).map(|&row| Some(times[row]));
        let pairs = rows.iter().zip(after.chain([None]));
        let ends: Vec<bool> = pairs
            .map(|(&row, after)| after != Some(times[row]))
            .collect();
        let count = ends.iter().filter(|end| **end).count();
        Ok(Self { rows, ends, count })
    }

    /// A column over the groups: of each the last value that is there, and where others are different.
    fn merged(&self, values: &Series) -> Result<(Series, Contradicted), Error> {
        let of_row = values.held()?;
        let mut merged = Series::within(values.store());
        let mut contradicted = Contradicted::default();
        // a row with its value, and another one of the same time before it
        let mut last: Option<(usize, f64)> = None;
        let mut other: Option<(usize, f64)> = None;
        for (&row, &is_end) in self.rows.iter().zip(&self.ends) {
            if of_row[row].is_finite() {
                // what counts nowhere differs from what counts
                other = last.filter(|(_, before)| *before != of_row[row]).or(other);
                last = Some((row, of_row[row]));
            }
            if is_end {
                merged.push(last.map_or(f64::NAN, |(_, value)| value));
                if let (Some(other), Some(last)) = (other, last) {
                    contradicted.count += 1;
                    contradicted.first.get_or_insert([other, last]);
                }
                (last, other) = (None, None);
            }
        }
        Ok((merged, contradicted))
    }

    /// The faults that no other row of the same time mends.
    fn faults_left(&self, faults: &[Fault], merged: &Series, lines: &Lines) -> Vec<Fault> {
        let (mut group, mut left) = (vec![], vec![]);
        if faults.is_empty() {
            return left;
        }
        let mut values = merged.iter();
        for (&row, &is_end) in self.rows.iter().zip(&self.ends) {
            let line = lines.of(row);
            group.extend(faults.iter().filter(|fault| fault.line == line));
            if is_end {
                let is_mended = values.next().is_none_or(f64::is_finite);
                left.extend(group.drain(..).filter(|_| !is_mended).cloned());
            }
        }
        left
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Gathering;

    fn read(text: &str, late: Option<f64>) -> Result<Option<Ordered>, Error> {
        Table::parse(text, "log.csv").unwrap().in_order("t", late)
    }

    #[test]
    fn late_rows_find_their_place_and_doubles_become_one() {
        let text = "t,y,u\n0,1,5\n2,3,5\n1,2,6\n2,,7\n,9,9\n3,4,8\n";
        let Ordered { table, notes, lost } = read(text, None).unwrap().unwrap();
        assert_eq!(table.time("t").unwrap().to_vec(), [0.0, 1.0, 2.0, 3.0]);
        assert_eq!(table.readings("y").unwrap().to_vec(), [1.0, 2.0, 3.0, 4.0]);
        assert_eq!(table.readings("u").unwrap().to_vec(), [5.0, 6.0, 7.0, 8.0]);
        assert_eq!(notes.len(), 3, "{notes:?}");
        let [_, y, u] = &lost[..] else { unreachable!() };
        assert_eq!((y.conflicts, y.timeless), (0, 1));
        let first = u.first.unwrap();
        assert_eq!((u.conflicts, u.timeless), (1, 1));
        assert_eq!((first.time, first.lost, first.kept), (2.0, 5.0, 7.0));
        assert_eq!((first.line, first.kept_line), (3, 5));
        assert!(read("t,y\n0,1\n1,2\n", None).unwrap().is_none());
    }

    /// A logger with a row for each sensor.
    #[test]
    fn a_cell_that_another_row_fills_is_no_fault() {
        let text = "t,y,u\n0,1,\n0,,5\n1,2,\n1,,6\n2,3,\n2,,7\n3,4,\n4,5,8\n,,\n";
        let Ordered { table, .. } = read(text, None).unwrap().unwrap();
        let faults = |name: &str| -> Vec<u64> {
            let faults = table.faults(name).iter();
            faults.map(|fault| fault.line).collect()
        };
        assert_eq!((table.missing("y"), faults("y")), (0, vec![]));
        assert_eq!((table.missing("u"), faults("u")), (1, vec![8]));
    }

    /// The first cells without a number are all mended, and the only one that is not is not known.
    #[test]
    fn a_column_without_numbers_is_refused_whatever_is_left_out() {
        let text = "t,y\n,\n,\n,\n,\n,\n0,\n1,\n";
        let Ordered { table, .. } = read(text, None).unwrap().unwrap();
        assert!(table.faults("y").is_empty());
        let error = table.readings("y").unwrap_err().to_string();
        assert!(error.contains("column \"y\" has no number"), "{error}");
    }

    /// Of a column of texts that a program holds no row is known.
    #[test]
    fn a_refused_column_stays_refused() {
        let log = Gathering::new("log");
        for times in [[0.0, 1.0, 1.0], [0.0, 2.0, 1.0], [0.0, f64::NAN, 1.0]] {
            let table = log.table(vec![
                log.owned("t", times.to_vec()),
                log.owned("y", vec![1.0, 2.0, 3.0]),
                log.refused("note", "expected numbers, found texts", "leave it out"),
            ]);
            let ordered = table.unwrap().in_order("t", None).unwrap().unwrap().table;
            assert!(ordered.readings("y").is_ok(), "{times:?}");
            let error = ordered.readings("note").unwrap_err().to_string();
            assert!(error.contains("found texts"), "{error}");
        }
        let table = Table::parse("t,y,note\n0,1,1a\n2,3,2b\n1,2,3c\n", "log.csv").unwrap();
        let ordered = table.in_order("t", None).unwrap().unwrap().table;
        let (one, other) = (table.readings("note"), ordered.readings("note"));
        assert_eq!(one.unwrap_err().to_string(), other.unwrap_err().to_string());
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
