//! What was told, in a CSV file for each day (of UTC) on which it was told; as Parquet, where that is asked for, once the
//! day is over.
//!
//! The state knows how far the file of the day was when the state was written: what follows is written once more from
//! the rows since, so that after a kill each line is there once. A day becomes Parquet after a state that begins later is
//! on the disk, and its CSV file is left until then.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, BufRead, BufReader, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::thread::{self, JoinHandle};
use std::time::{SystemTime, UNIX_EPOCH};

use lynkeus::stream::Stream;
use lynkeus::table::{Instant, exact};

use crate::asset::Line;
use crate::bytes::{Parser, Writer, beside};
use crate::parquet::{self, ASSET, CREDIBLE, REVISION};

const SECOND: i128 = 1_000_000_000;
const DAY: i128 = 86_400 * SECOND;
/// Days beyond those that are kept of which files are looked for.
const LONG_AGO: i128 = 400;

/// The files of a history.
#[derive(Debug)]
pub(crate) struct History {
    /// the path of a file, with `%Y`, `%m` and `%d`
    pattern: String,
    /// so many days are kept
    keep: Option<u64>,
    header: String,
    has_assets: bool,
    /// since 1970
    day: i128,
    file: Option<File>,
    length: u64,
    /// what is not in the file so far
    pending: String,
    /// the rows of the state are gone over again: their lines are written over themselves
    is_repeating: bool,
    /// another study goes over them: what the one before made of them goes
    is_changed: bool,
    /// the lines up to this row are there
    since: u64,
    /// days are to become Parquet
    is_parquet: bool,
    /// makes them so, and says what it could not
    worker: Option<JoinHandle<Vec<String>>>,
}

/// The present, in nanoseconds since 1970.
pub(crate) fn now() -> i128 {
    let since = SystemTime::now().duration_since(UNIX_EPOCH);
    since.map_or(0, |since| i128::try_from(since.as_nanos()).unwrap_or(0))
}

impl History {
    pub fn new(pattern: &Path, keep: Option<u64>, stream: &Stream, has_assets: bool) -> Self {
        let mut header = stream.told_time.clone();
        if has_assets {
            header = header + "," + ASSET;
        }
        for told in &stream.estimates {
            for name in std::iter::once(&told.header).chain(&told.deviation) {
                header.push(',');
                cell(name, &mut header);
            }
        }
        for monitor in &stream.monitors {
            header.push(',');
            cell(&monitor.header, &mut header);
        }
        header = header + "," + CREDIBLE + "," + REVISION + "\n";
        Self {
            pattern: pattern.display().to_string(),
            keep,
            header,
            has_assets,
            day: i128::MIN,
            file: None,
            length: 0,
            pending: String::new(),
            is_repeating: false,
            is_changed: false,
            since: 0,
            is_parquet: pattern
                .extension()
                .is_some_and(|ending| ending == "parquet"),
            worker: None,
        }
    }

    /// The file of a day.
    fn path(&self, day: i128) -> PathBuf {
        let date = Instant::at(day * DAY, true).to_string();
        let (year, month, day) = (&date[..4], &date[5..7], &date[8..10]);
        let path = self.pattern.replace("%Y", year).replace("%m", month);
        PathBuf::from(path.replace("%d", day))
    }

    /// The file of a day that is not over.
    fn draft(&self, day: i128) -> PathBuf {
        match self.is_parquet {
            true => beside(&self.path(day), ".csv"),
            false => self.path(day),
        }
    }

    /// The day whose lines are written.
    pub fn day(&self) -> i128 {
        self.day
    }

    /// Days before this one are over for good: they become Parquet, in a thread.
    pub fn is_over(&mut self, day: i128) {
        if !self.is_parquet || self.worker.is_some() {
            return;
        }
        let days = (day - LONG_AGO..day).map(|day| (self.draft(day), self.path(day)));
        let drafts: Vec<_> = days.filter(|(draft, _)| draft.exists()).collect();
        if drafts.is_empty() {
            return;
        }
        self.worker = Some(thread::spawn(move || {
            let closed = drafts.into_iter().map(|(draft, path)| {
                let done = close(&draft, &path);
                done.err().map(|error| {
                    format!(
                        "{} is not Parquet yet: {error}; it stays as it is, and is tried again after the next day",
                        draft.display()
                    )
                })
            });
            closed.flatten().collect()
        }));
    }

    /// What could not be made Parquet, once it is known.
    pub fn failures(&mut self) -> Vec<String> {
        match self.worker.take_if(|worker| worker.is_finished()) {
            None => vec![],
            Some(worker) => worker.join().unwrap_or_else(|_| {
                vec!["a day of the history could not be made Parquet".to_owned()]
            }),
        }
    }

    /// Takes lines of the `sequence`-th row, which came at `came`; what could not be written waits.
    pub fn add(&mut self, lines: &[Line], asset: &str, (came, sequence): (i128, u64)) {
        if sequence <= self.since {
            return;
        }
        for line in lines.iter().filter(|line| !line.is_repeated) {
            let day = came.div_euclid(DAY);
            if day > self.day {
                // the end of a day is in its file before the next begins
                let _ = self.flush();
                if self.pending.is_empty() {
                    self.turn(day);
                }
            }
            self.write(line, asset);
        }
    }

    fn turn(&mut self, day: i128) {
        self.day = day;
        if let Some(file) = self.file.take() {
            // where this fails it is on the disk a little later
            let _ = file.sync_data();
        }
        if let Some(keep) = self.keep {
            let oldest = day - i128::from(keep);
            for old in oldest - LONG_AGO..oldest {
                let path = self.path(old);
                // most of them are not there
                let _ = std::fs::remove_file(self.draft(old));
                let _ = std::fs::remove_file(&path);
                let mut others = others(&path);
                while others
                    .next()
                    .is_some_and(|other| std::fs::remove_file(other).is_ok())
                {}
            }
        }
    }

    fn write(&mut self, line: &Line, asset: &str) {
        let to = &mut self.pending;
        // a string takes what is written
        let _ = write!(to, "{}", line.stamp);
        if self.has_assets {
            to.push(',');
            cell(asset, to);
        }
        for (place, x) in line.estimate.iter().enumerate() {
            to.push(',');
            to.push_str(&exact(*x));
            if let Some(sd) = line.deviations.get(place) {
                to.push(',');
                to.push_str(&exact(*sd));
            }
        }
        let _ = writeln!(to, ",{},{}", line.is_credible, line.revision);
    }

    /// Writes what waits.
    ///
    /// # Errors
    /// The disk is full, or failed: the file is as it was.
    pub fn flush(&mut self) -> io::Result<()> {
        if self.pending.is_empty() {
            return Ok(());
        }
        if self.file.is_none() {
            self.open()?;
        }
        let Some(file) = &mut self.file else {
            return Ok(());
        };
        let head = if self.length == 0 {
            self.header.as_str()
        } else {
            ""
        };
        let done = file.seek(SeekFrom::Start(self.length));
        let done = done.and_then(|_| file.write_all(head.as_bytes()));
        match done.and_then(|()| file.write_all(self.pending.as_bytes())) {
            Ok(()) => {
                self.length += (head.len() + self.pending.len()) as u64;
                self.pending.clear();
                Ok(())
            }
            Err(error) => {
                // where this fails it is written over
                if !self.is_repeating {
                    let _ = file.set_len(self.length);
                }
                Err(error)
            }
        }
    }

    /// A file of the day with other columns, as another study wrote them, is left beside the new one.
    fn leave_others(&self) -> io::Result<()> {
        let (draft, path) = (self.draft(self.day), self.path(self.day));
        let mut first = String::new();
        match File::open(&draft) {
            Ok(file) => BufReader::new(file).read_line(&mut first)?,
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error),
        };
        if first.is_empty() || first == self.header {
            return Ok(());
        }
        let Some(other) = others(&path).find(|other| !other.exists()) else {
            return Ok(());
        };
        match self.is_parquet {
            false => std::fs::rename(draft, other),
            true => {
                parquet::convert(&draft, &other)?;
                std::fs::remove_file(draft)
            }
        }
    }

    fn open(&mut self) -> io::Result<()> {
        if !self.is_repeating {
            self.leave_others()?;
        }
        let mut options = OpenOptions::new();
        let is_anew = self.is_repeating && self.is_changed;
        options.write(true).create(true).truncate(is_anew);
        let file = options.open(self.draft(self.day))?;
        self.length = match self.is_repeating {
            true => 0,
            false => file.metadata()?.len(),
        };
        self.file = Some(file);
        Ok(())
    }

    /// Writes what waits; the file of the day, which may not be on the disk yet.
    ///
    /// # Errors
    /// The disk is full, or failed.
    pub fn written(&mut self) -> io::Result<Option<File>> {
        self.flush()?;
        self.file.as_ref().map(File::try_clone).transpose()
    }

    /// Where it is.
    pub fn save(&self, to: &mut Writer) {
        to.word(self.day as u64);
        to.word(self.length);
    }

    /// Begins with the file of the present day, whatever is in it.
    ///
    /// # Errors
    /// It cannot be written.
    pub fn begin(&mut self) -> io::Result<()> {
        self.turn(now().div_euclid(DAY));
        self.open()
    }

    /// Goes back to where it was: the rows since will be told once more, by another study where it has changed. What
    /// follows after them is left, as it is of rows that this state does not know: somebody put back an older one.
    pub fn load(
        &mut self,
        from: &mut Parser<'_>,
        sequence: u64,
        is_changed: bool,
    ) -> Option<io::Result<()>> {
        self.since = sequence;
        let (day, length) = (i128::from(from.word()? as i64), from.word()?);
        (self.is_repeating, self.is_changed) = (true, is_changed);
        self.day = day;
        Some(self.go_back(length))
    }

    fn go_back(&mut self, length: u64) -> io::Result<()> {
        let mut options = OpenOptions::new();
        let file = match options.write(true).open(self.draft(self.day)) {
            Ok(file) => file,
            // somebody took it away
            Err(error) if error.kind() == io::ErrorKind::NotFound => return Ok(()),
            Err(error) => return Err(error),
        };
        let length = file.metadata()?.len().min(length);
        if self.is_changed {
            file.set_len(length)?;
        }
        self.leave_others()?;
        let file = options.create(true).truncate(false);
        let file = file.open(self.draft(self.day))?;
        self.length = file.metadata()?.len().min(length);
        self.file = Some(file);
        Ok(())
    }

    /// All rows of the state were told.
    ///
    /// # Errors
    /// The file cannot be looked at.
    pub fn is_up_to_date(&mut self) -> io::Result<()> {
        self.is_repeating = false;
        if let Some(file) = &self.file {
            self.length = self.length.max(file.metadata()?.len());
        }
        Ok(())
    }

    /// Leaves its files as a kill does after the thread is done.
    #[cfg(test)]
    pub fn kill(&mut self) {
        if let Some(worker) = self.worker.take() {
            let _ = worker.join();
        }
    }
}

/// More files of the day that a file is of.
fn others(path: &Path) -> impl Iterator<Item = PathBuf> {
    let ending = path.extension().unwrap_or_default().to_string_lossy();
    let ending = ending.into_owned();
    (2..).map(move |count: u32| path.with_extension(format!("{count}.{ending}")))
}

/// A day as Parquet, in the place of its CSV file.
fn close(draft: &Path, path: &Path) -> io::Result<()> {
    if draft.metadata()?.len() == 0 {
        return std::fs::remove_file(draft);
    }
    let mut to = path.to_owned();
    if path.exists() {
        if parquet::is_of(path, draft)? {
            // a kill came between the two files
            return std::fs::remove_file(draft);
        }
        // the clock went back to a day that was over, or the study changed: nothing is written over
        to = others(path).find(|other| !other.exists()).unwrap_or(to);
    }
    parquet::convert(draft, &to)?;
    std::fs::remove_file(draft)
}

/// A text as a cell.
fn cell(text: &str, to: &mut String) {
    match text.contains([',', '"', '\n', '\r']) {
        true => {
            to.push('"');
            to.push_str(&text.replace('"', "\"\""));
            to.push('"');
        }
        false => to.push_str(text),
    }
}

#[cfg(test)]
mod tests {
    use std::sync::Arc;

    use lynkeus::Study;

    use super::*;
    use crate::row::Stamp;

    /// A tank, and the history of its estimates.
    fn history(folder: &Path, name: &str, keep: Option<u64>) -> History {
        let plant = "model Tank\n  Real x(start = 1);\n  output Real y = x;\nequation\n  der(x) = -x;\nend Tank;\n";
        std::fs::write(folder.join("tank.mo"), plant).unwrap();
        let study = "plant = \"tank.mo\"\nprocess_noise = { x = 0.1 }\n[sensors]\nnoise = { y = 0.1 }\n[observer]\nfamily = \"ekf\"\ninitial_variance = { default = 1 }\n";
        std::fs::write(folder.join("study.toml"), study).unwrap();
        let study = Study::load(folder.join("study.toml")).unwrap();
        let stream = Arc::new(Stream::new(&study).unwrap());
        History::new(&folder.join(name), keep, &stream, true)
    }

    fn line(stamp: Stamp, x: f64) -> Line {
        Line {
            stamp,
            estimate: vec![x],
            deviations: vec![x / 3.0],
            is_credible: x > 0.0,
            revision: 2,
            notes: vec![],
            is_repeated: false,
            innovations: vec![],
        }
    }

    fn files(folder: &Path) -> Vec<String> {
        let entries = std::fs::read_dir(folder).unwrap();
        let names = entries.map(|e| e.unwrap().file_name().into_string().unwrap());
        let mut names: Vec<String> = names.filter(|name| name.starts_with('h')).collect();
        names.sort();
        names
    }

    fn wait(history: &mut History) {
        if let Some(worker) = history.worker.take() {
            worker.join().unwrap();
        }
    }

    #[test]
    fn a_day_that_is_over_becomes_parquet() {
        let folder = tempfile::tempdir().unwrap();
        let mut history = history(folder.path(), "h-%Y-%m-%d.parquet", Some(3));
        let day = 20_000 * DAY;
        let date = |k: i64| Stamp::Date(Instant::at(day + i128::from(k) * 1_000_000_007, true));
        let xs: Vec<f64> = (0..200).map(|k| (f64::from(k) - 3.0) / 7.0).collect();
        for (k, x) in (0..).zip(&xs) {
            history.add(
                &[line(date(k), *x)],
                "tank, 1",
                (day + i128::from(k), k as u64 + 1),
            );
        }
        history.flush().unwrap();
        assert_eq!(files(folder.path()), ["h-2024-10-04.parquet.csv"]);
        history.add(&[line(date(500), 1.0)], "tank, 1", (day + DAY, 201));
        history.flush().unwrap();
        // not before a state says that its lines will not be written again
        assert_eq!(
            files(folder.path()),
            ["h-2024-10-04.parquet.csv", "h-2024-10-05.parquet.csv"]
        );
        history.is_over(20_001);
        wait(&mut history);
        assert_eq!(
            files(folder.path()),
            ["h-2024-10-04.parquet", "h-2024-10-05.parquet.csv"]
        );
        use ::parquet::file::reader::{FileReader, SerializedFileReader};
        use ::parquet::record::Field;
        let file = File::open(folder.path().join("h-2024-10-04.parquet")).unwrap();
        let reader = SerializedFileReader::new(file).unwrap();
        let rows: Vec<Vec<(String, Field)>> = reader
            .get_row_iter(None)
            .unwrap()
            .map(|row| row.unwrap().into_columns())
            .collect();
        assert_eq!(rows.len(), xs.len());
        for (k, (row, x)) in (0..).zip(rows.iter().zip(&xs)) {
            let expected = [
                (
                    "t",
                    Field::Long((day + i128::from(k) * 1_000_000_007) as i64),
                ),
                ("asset", Field::Str("tank, 1".into())),
                ("x_hat", Field::Double(*x)),
                ("x_sd", Field::Double(x / 3.0)),
                ("credible", Field::Bool(*x > 0.0)),
                ("revision", Field::Long(2)),
            ];
            let expected = expected.map(|(name, field)| (name.to_owned(), field));
            assert_eq!(row[..], expected);
        }
        // the clock goes back to a day that is over: nothing is lost
        std::fs::write(
            folder.path().join("h-2024-10-04.parquet.csv"),
            "t,asset,x_hat,x_sd,credible,revision\n1,a,1,1,true,0\n",
        )
        .unwrap();
        history.is_over(20_001);
        wait(&mut history);
        assert!(files(folder.path()).contains(&"h-2024-10-04.2.parquet".to_owned()));
        // what is old goes
        history.add(&[line(date(501), 1.0)], "b", (day + 9 * DAY, 202));
        history.flush().unwrap();
        assert!(
            !files(folder.path()).contains(&"h-2024-10-04.parquet".to_owned()),
            "{:?}",
            files(folder.path())
        );
    }

    #[test]
    fn a_day_that_does_not_become_parquet_is_said() {
        let folder = tempfile::tempdir().unwrap();
        let mut history = history(folder.path(), "h-%Y-%m-%d.parquet", None);
        history.add(&[line(Stamp::Number(1.0), 1.0)], "a", (20_000 * DAY, 1));
        history.flush().unwrap();
        // somebody's folder has its name
        std::fs::create_dir(folder.path().join("h-2024-10-04.parquet")).unwrap();
        history.is_over(20_001);
        let mut said = vec![];
        while said.is_empty() && history.worker.is_some() {
            said = history.failures();
        }
        assert_eq!(said.len(), 1);
        assert!(said[0].contains("h-2024-10-04.parquet.csv is not Parquet yet"));
        assert!(history.failures().is_empty());
        assert!(folder.path().join("h-2024-10-04.parquet.csv").exists());
    }

    /// A kill may come between the new file and the end of the old one.
    #[test]
    fn a_day_is_not_written_twice() {
        let folder = tempfile::tempdir().unwrap();
        let mut history = history(folder.path(), "h-%Y-%m-%d.parquet", None);
        let draft = folder.path().join("h-2024-10-04.parquet.csv");
        history.add(&[line(Stamp::Number(1.0), 1.0)], "a", (20_000 * DAY, 1));
        history.flush().unwrap();
        let text = std::fs::read(&draft).unwrap();
        history.is_over(20_001);
        wait(&mut history);
        std::fs::write(&draft, &text).unwrap();
        history.is_over(20_001);
        wait(&mut history);
        assert_eq!(files(folder.path()), ["h-2024-10-04.parquet"]);
        // as many lines, and others
        let other = String::from_utf8(text).unwrap().replace(",2\n", ",3\n");
        std::fs::write(&draft, other).unwrap();
        history.is_over(20_001);
        wait(&mut history);
        assert_eq!(
            files(folder.path()),
            ["h-2024-10-04.2.parquet", "h-2024-10-04.parquet"]
        );
    }
}
