//! Headers of columns that differ, whatever the model's variables are called.
//!
//! The model's own names keep theirs; what the tool derives gives way (`docs/study.md`).

use std::borrow::Cow;
use std::collections::HashSet;

use lynkeus_model::{Plant, Variable};

use crate::{Error, Study, Table};
use lynkeus_study::{self, EstimateSettings, Name, seconds_in};

/// The header of time, and what it is where a column of data is called so.
const TIME: &str = "t";
const OTHER_TIME: &str = "time";

/// What a first column without a name is called: in CSV, as pandas reads that, and as pandas writes it to Parquet.
pub(crate) const UNNAMED: [&str; 3] = ["", "Unnamed: 0", "__index_level_0__"];

/// Gives out headers, each once.
#[derive(Clone, Debug)]
pub struct Headers {
    taken: HashSet<String>,
    /// what has a name, in words
    named: &'static str,
    /// what became of the headers that were taken, in words
    pub notes: Vec<String>,
}

impl Headers {
    /// Headers beside those of a plant's states, inputs and outputs, in the table or not: so
    /// that a column is called the same in every table.
    pub fn beside(plant: &Plant) -> Self {
        let own = plant.states.iter().chain(&plant.inputs);
        Self::beside_names(own.chain(&plant.outputs).map(|v| v.name.clone()))
    }

    /// Headers beside these.
    pub fn beside_names(names: impl IntoIterator<Item = String>) -> Self {
        Self {
            taken: names.into_iter().collect(),
            named: "column",
            notes: vec![],
        }
    }

    /// The same for variables of a functional mock-up unit.
    pub fn of_variables(mut self) -> Self {
        self.named = "variable";
        self
    }

    /// A name that has been given out elsewhere.
    pub fn take(&mut self, name: &str) {
        self.taken.insert(name.to_owned());
    }

    /// The header of time.
    pub fn time(&mut self) -> String {
        match self.taken.contains(TIME) {
            true => self.free(OTHER_TIME, "time"),
            false => self.free(TIME, "time"),
        }
    }

    /// `wanted`, or, where that is taken, the first of `wanted_2`, `wanted_3`, … that is not;
    /// `what` the column holds is for people.
    pub fn free(&mut self, wanted: &str, what: &str) -> String {
        let numbered = (2..).map(|k| format!("{wanted}_{k}"));
        let mut headers = std::iter::once(wanted.to_owned()).chain(numbered);
        let header = headers.find(|header| !self.taken.contains(header));
        let header = header.unwrap_or_else(|| wanted.to_owned());
        if header != wanted {
            self.notes.push(format!(
                "the {} of {what} is called {header}: another one is called {wanted}",
                self.named
            ));
        }
        self.taken.insert(header.clone());
        header
    }
}

/// The header of a log's time column.
pub(crate) fn log_time(plant: &Plant, settings: &EstimateSettings) -> String {
    let is_taken = || signals(plant).any(|v| header(settings, &v.name) == TIME);
    match &settings.log.time {
        Some(time) => time.text.clone(),
        None if is_taken() => OTHER_TIME.to_owned(),
        None => TIME.to_owned(),
    }
}

/// What a log can hold.
fn signals(plant: &Plant) -> impl Iterator<Item = &Variable> + Clone {
    plant.outputs.iter().chain(&plant.inputs)
}

/// The header of the time column of this log.
///
/// # Errors
/// One of the signals that are read is in that column as well; there is no such column.
pub(crate) fn time_of<'s>(
    table: &Table,
    plant: &Plant,
    settings: &EstimateSettings,
    read: impl IntoIterator<Item = &'s str>,
) -> Result<String, Error> {
    let time = log_time(plant, settings);
    let mut read = read.into_iter();
    if let Some(name) = read.find(|name| header(settings, name) == time) {
        return Err(Error::input(format!(
            "the column \"{time}\" cannot be both time and \"{name}\""
        ))
        .at(table.place())
        .hint("say which columns they are: `time` and `columns` of [estimate]"));
    }
    let is_there = table.names().any(|name| name == time);
    let is_said = settings.log.time.is_some() || table.has(&time);
    if let Some(unnamed) = unnamed(table).filter(|_| !is_said) {
        return Ok(unnamed.to_owned());
    }
    if !is_there && settings.log.time.is_none() && time == OTHER_TIME {
        return Err(Error::input(format!(
            "no time column \"{time}\" (the model has a variable called t); the columns found are: {}",
            crate::near::list(table.names())
        ))
        .at(table.place())
        .hint("if it has another name, set `time` in [log] of the study"));
    }
    Ok(time)
}

/// The header of a first column that has no name; pandas writes its index as the last one to Parquet.
fn unnamed(table: &Table) -> Option<&'static str> {
    let [csv @ .., parquet] = UNNAMED;
    let first = table.names().next();
    let mut known = csv.into_iter().filter(|name| first == Some(*name));
    known
        .next()
        .or_else(|| table.has_one(parquet).then_some(parquet))
}

/// The log with dates and durations of its times in the unit that `[log]` says; numbers stay.
///
/// # Errors
/// They are seconds, and `[plot]` alone says another unit.
pub(crate) fn in_unit<'t>(
    study: &Study,
    table: Cow<'t, Table>,
    time: &str,
) -> Result<Cow<'t, Table>, Error> {
    let dates = table
        .origin(time)
        .map(|date| format!("dates such as {date}"));
    let durations = || table.has_durations(time).then(|| "durations".to_owned());
    let Some(found) = dates.or_else(durations) else {
        return Ok(table);
    };
    let is_other = |unit: &&str| seconds_in(unit).is_some_and(|seconds| seconds != 1.0);
    let log = &study.estimate.log;
    match study.time_unit.as_deref().filter(is_other) {
        None => Ok(table),
        Some(_) if log.time_unit.is_some() => table.with_unit(time, log.seconds()).map(Cow::Owned),
        Some(unit) => Err(Error::input(format!(
            "the times of the log are {found}, which count in seconds, but `time_unit` of [plot] says that the plant's are in {unit}"
        ))
        .at(table.place())
        .hint(format!("add time_unit = \"{unit}\" under [log], and they are converted"))),
    }
}

/// The header under which the log has a signal of the plant.
pub fn header<'a>(settings: &'a EstimateSettings, name: &'a str) -> &'a str {
    let mut given = settings.log.columns.iter();
    let given = given.find(|(plant, _)| plant.text == name);
    given.map_or(name, |(_, header)| header.text.as_str())
}

/// Refuses headers under which the study looks for what the plant does not have.
pub(crate) fn refuse_stray_columns(
    plant: &Plant,
    settings: &EstimateSettings,
) -> Result<(), Error> {
    let names = || {
        let all = signals(plant).chain(&plant.states);
        all.map(|v| v.name.as_str())
    };
    match settings
        .log
        .columns
        .iter()
        .find(|(name, _)| !names().any(|n| n == name.text))
    {
        None => Ok(()),
        Some((name, header)) => {
            let hint = match ["t", "time"].contains(&name.text.as_str()) {
                true => {
                    format!("if it is the column of time, set time = \"{header}\" in [log]")
                }
                false => crate::near::suggest(&name.text, names()),
            };
            let what = format!(
                "columns: the plant '{}' has no output, input or state named \"{name}\"",
                plant.name
            );
            Err(name.blame(Error::input(what).hint(hint)))
        }
    }
}

/// The header of what a generator reads of a log.
pub(crate) fn command(name: &Name, generator: &lynkeus_study::Generator) -> Option<String> {
    match generator {
        lynkeus_study::Generator::Time(_) => None,
        lynkeus_study::Generator::Prefilter { command, .. } => {
            let own = || format!("{name}_command");
            Some(command.clone().unwrap_or_else(own))
        }
    }
}

/// Headers beside those of the plant's variables that an observer may read.
pub(crate) fn further_headers(settings: &EstimateSettings) -> impl Iterator<Item = String> {
    let derivatives = settings.input_derivatives.iter();
    let derivatives = derivatives.flat_map(|(_, headers)| headers.iter().cloned());
    let generators = settings.generator.iter();
    derivatives.chain(generators.filter_map(|(name, given)| command(name, given)))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn headers(names: &[&str]) -> Headers {
        Headers::beside_names(names.iter().map(ToString::to_string))
    }

    #[test]
    fn what_is_free_is_kept() {
        let mut free = headers(&["x", "y"]);
        assert_eq!(
            (free.time(), free.free("x_hat", "x")),
            ("t".into(), "x_hat".into())
        );
        assert!(free.notes.is_empty());
    }

    #[test]
    fn what_is_taken_gives_way_and_says_so() {
        let mut free = headers(&["t", "lower", "lower_hat", "lower_hat_2"]);
        assert_eq!(free.time(), "time");
        assert_eq!(
            free.free("lower_hat", "the estimate of lower"),
            "lower_hat_3"
        );
        assert_eq!(free.free("lower_hat", "a monitor"), "lower_hat_4");
        assert_eq!(free.notes.len(), 2);
        assert_eq!(
            free.notes[0],
            "the column of the estimate of lower is called lower_hat_3: another one is called lower_hat"
        );
    }
}
