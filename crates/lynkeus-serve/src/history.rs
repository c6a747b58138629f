//! What was told, in a CSV file for each day (of UTC) on which it was told.
//!
//! The state knows how far the file of the day was when the state was written: what follows is written once more from
//! the rows since, so that after a kill each line is there once.

use std::fmt::Write as _;
use std::fs::{File, OpenOptions};
use std::io::{self, Seek, SeekFrom, Write};
use std::path::{Path, PathBuf};
use std::time::{SystemTime, UNIX_EPOCH};

use lynkeus::stream::Stream;
use lynkeus::table::{Instant, exact};

use crate::asset::Line;
use crate::bytes::{Parser, Writer};

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
    /// the rows of the state are gone over again: files of later days are written anew
    is_repeating: bool,
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
            header += ",asset";
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
        header += ",credible,revision\n";
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
        }
    }

    /// The file of a day.
    fn path(&self, day: i128) -> PathBuf {
        let date = Instant::at(day * DAY, true).to_string();
        let (year, month, day) = (&date[..4], &date[5..7], &date[8..10]);
        let path = self.pattern.replace("%Y", year).replace("%m", month);
        PathBuf::from(path.replace("%d", day))
    }

    /// Takes lines of a row that came at `came`; what could not be written waits.
    pub fn add(&mut self, lines: &[Line], asset: &str, came: i128) {
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
        self.file = None;
        if let Some(keep) = self.keep {
            let oldest = day - i128::from(keep);
            for old in oldest - LONG_AGO..oldest {
                // most of them are not there
                let _ = std::fs::remove_file(self.path(old));
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
                let _ = file.set_len(self.length);
                Err(error)
            }
        }
    }

    fn open(&mut self) -> io::Result<()> {
        let mut options = OpenOptions::new();
        options.write(true).create(true).truncate(self.is_repeating);
        let file = options.open(self.path(self.day))?;
        self.length = file.metadata()?.len();
        self.file = Some(file);
        Ok(())
    }

    /// All of it is on the disk.
    ///
    /// # Errors
    /// The disk is full, or failed.
    pub fn sync(&mut self) -> io::Result<()> {
        self.flush()?;
        match &self.file {
            Some(file) => file.sync_data(),
            None => Ok(()),
        }
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

    /// Goes back to where it was: the rows since will be told once more.
    pub fn load(&mut self, from: &mut Parser<'_>) -> Option<io::Result<()>> {
        let (day, length) = (i128::from(from.word()? as i64), from.word()?);
        self.is_repeating = true;
        self.day = day;
        let file = OpenOptions::new().write(true).open(self.path(day));
        Some(match file {
            Ok(file) => self.shorten(file, length),
            // somebody took it away
            Err(error) if error.kind() == io::ErrorKind::NotFound => Ok(()),
            Err(error) => Err(error),
        })
    }

    fn shorten(&mut self, file: File, length: u64) -> io::Result<()> {
        self.length = file.metadata()?.len().min(length);
        file.set_len(self.length)?;
        self.file = Some(file);
        Ok(())
    }

    /// All rows of the state were told.
    pub fn is_up_to_date(&mut self) {
        self.is_repeating = false;
    }
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
