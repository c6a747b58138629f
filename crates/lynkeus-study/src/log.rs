//! `[log]`: what a log's columns are.

use super::Name;
use super::keys::LOG;
use super::section::{Entry, Section};
use super::simulate::pairs;
use lynkeus_answer::Error;
use lynkeus_table::{Decimal, Format, Pattern};

/// What a log's columns are.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LogSettings {
    /// The time column: its header, or an expression of headers; `None` is `t`, or `time` where an output or an
    /// input of the plant is called `t` in the log.
    pub time: Option<Name>,
    /// Where the log names a signal differently: (the plant's name, the column's header or an expression of headers).
    pub columns: Vec<(Name, Name)>,
    /// The plant's unit of time, into which dates and durations are converted; `None`: they count in seconds.
    pub time_unit: Option<Name>,
    /// How a CSV file is written.
    pub format: Format,
}

/// Names of units of time, and how many seconds each has; a year is a Julian one.
const UNITS: [(&[&str], f64); 9] = [
    (&["ns"], 1e-9),
    (&["us", "µs"], 1e-6),
    (&["ms"], 1e-3),
    (&["s", "sec", "second", "seconds"], 1.0),
    (&["min", "mins", "minute", "minutes"], 60.0),
    (&["h", "hr", "hour", "hours"], 3600.0),
    (&["d", "day", "days"], 86_400.0),
    (&["week", "weeks"], 604_800.0),
    (&["year", "years"], 31_557_600.0),
];

/// The seconds of a unit of time, by its name; none where that is no such name.
#[must_use]
pub fn seconds_in(unit: &str) -> Option<f64> {
    let unit = unit.trim().to_lowercase();
    let mut known = UNITS.iter();
    let found = known.find(|(names, _)| names.contains(&unit.as_str()));
    found.map(|(_, seconds)| *seconds)
}

/// A unit of time.
fn unit(entry: Entry<'_>) -> Result<Name, Error> {
    let known: Vec<&str> = UNITS
        .iter()
        .filter_map(|(names, _)| names.first())
        .copied()
        .collect();
    let refusal = entry.wrong(&format!("a unit of time: {}", known.join(", ")));
    let name = entry.name()?;
    seconds_in(&name.text).map(|_| name).ok_or(refusal)
}

impl LogSettings {
    /// What the study says of the columns, in `[log]` or, as before it, in `[estimate]`.
    fn columns_of(section: &mut Section<'_>) -> Result<Self, Error> {
        Ok(Self {
            time: section.optional("time", Entry::name)?,
            columns: pairs(section.take("columns"), Entry::name)?,
            ..Self::default()
        })
    }

    /// Seconds of the unit in which dates and durations count.
    #[must_use]
    pub fn seconds(&self) -> f64 {
        let unit = self.time_unit.as_ref();
        unit.and_then(|unit| seconds_in(&unit.text)).unwrap_or(1.0)
    }

    /// The plant's unit of time, which `[plot]` may say, too.
    pub(super) fn unit_beside(&self, plot: Option<Name>) -> Result<Option<String>, Error> {
        let (Some(own), Some(plot)) = (&self.time_unit, &plot) else {
            return Ok(plot.or(self.time_unit.clone()).map(|unit| unit.text));
        };
        if own != plot && seconds_in(&own.text) != seconds_in(&plot.text) {
            let message = format!(
                "`time_unit` of [log] says that the plant's time is in {own}, and that of [plot] in {plot}"
            );
            let error = Error::input(message).hint("they are one unit: leave one of the two out");
            return Err(own.blame(error));
        }
        Ok(Some(plot.text.clone()))
    }

    /// Adds what `[estimate]` says of the columns.
    pub(super) fn join(&mut self, estimate: &mut Section<'_>) -> Result<(), Error> {
        let other = Self::columns_of(estimate)?;
        if let (Some(own), Some(other)) = (&self.time, &other.time) {
            return Err(twice("`time`", own, other));
        }
        let twin = |name: &Name| self.columns.iter().find(|(own, _)| own == name);
        for (name, _) in &other.columns {
            if let Some((own, _)) = twin(name) {
                return Err(twice(&format!("\"{name}\" of `columns`"), own, name));
            }
        }
        self.time = self.time.take().or(other.time);
        self.columns.extend(other.columns);
        Ok(())
    }
}

/// The refusal of what both sections say.
fn twice(what: &str, own: &Name, other: &Name) -> Error {
    let place = own.place.as_ref();
    let place = place.map_or(String::new(), |place| format!(" ({place})"));
    other.blame(
        Error::input(format!("{what} is given in [log]{place} and in [estimate]"))
            .hint("keep the one in [log]"),
    )
}

/// A character between cells.
fn delimiter(entry: Entry<'_>) -> Result<u8, Error> {
    let is_one = |b: u8| b == b'\t' || b.is_ascii_punctuation() && !b"\"+-._".contains(&b);
    let given = match entry.as_text().map(str::as_bytes) {
        Some([byte]) if is_one(*byte) => Some(*byte),
        _ => None,
    };
    given.ok_or_else(|| entry.wrong("one character between cells: \",\", \";\", \"\\t\", \"|\""))
}

/// What times are written like.
fn pattern(entry: Entry<'_>) -> Result<Pattern, Error> {
    let given = entry.as_text().and_then(Pattern::new);
    given.ok_or_else(|| {
        entry.wrong(&format!(
            "a time in directives such as \"%d.%m.%Y %H:%M:%S\" ({})",
            Pattern::FIELDS
        ))
    })
}

pub(super) fn read(entry: Entry<'_>) -> Result<LogSettings, Error> {
    let mut section = entry.section("[log]", &LOG)?;
    Ok(LogSettings {
        time_unit: section.optional("time_unit", unit)?,
        format: Format {
            delimiter: section.optional("delimiter", delimiter)?,
            decimal: section.optional("decimal", |e| {
                e.choice(&[(".", Decimal::Point), (",", Decimal::Comma)])
            })?,
            skip: section.optional("skip", |e| e.whole(0))?.unwrap_or(0),
            times: section.optional("time_format", pattern)?,
        },
        ..LogSettings::columns_of(&mut section)?
    })
}
