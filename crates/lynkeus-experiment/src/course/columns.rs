//! The columns of a log that a study reads.

use std::borrow::Cow;
use std::collections::HashSet;
use std::io::BufRead;
use std::path::Path;

use lynkeus_structure::AugmentedPlant;

use crate::course::computed::{given, names, with_expressions};
use crate::course::taken::{Interleaved, Unordered};
use crate::course::{Samples, screen};
use crate::prepare::Prepared;
use crate::prepare::headers::{UNNAMED, further_headers, header, in_unit, log_time, time_of};
use crate::{Error, Series, Study, Table, visible};
use lynkeus_study::{EstimateSettings, Late, Name};
use lynkeus_table::{APART, Lost, Ordered, Request, is_parquet};

/// The log of a study in a file (CSV, Parquet), read within the study's budget; of a Parquet file only what the
/// study may ask for.
///
/// # Errors
/// As [`Table::load_within`]; for a Parquet file those of [`prepare::plant`](crate::prepare::plant), too.
pub fn log(study: &Study, path: impl AsRef<Path>) -> Result<Table, Error> {
    let mut request = request(study)?;
    if is_parquet(path.as_ref()) {
        request.columns = Some(asked_for(study)?);
    }
    Table::load_within(path, &request)
}

/// The same with all that the file has, for several studies.
///
/// # Errors
/// As [`log`].
pub fn whole_log(study: &Study, path: impl AsRef<Path>) -> Result<Table, Error> {
    Table::load_within(path, &request(study)?)
}

/// The same of a text that comes: `file` names it in messages.
///
/// # Errors
/// As [`Table::read_as`].
pub fn log_of(study: &Study, input: impl BufRead, file: &str) -> Result<Table, Error> {
    Table::read_as(input, file, &request(study)?)
}

/// How the study's log is read.
fn request(study: &Study) -> Result<Request, Error> {
    let format = study.estimate.log.format.clone();
    let times = match format.times {
        Some(_) => {
            let own = log_time(&crate::prepare::plant(study)?, &study.estimate);
            let taken = taken_at(study).map(|column| column.text.clone());
            std::iter::once(own).chain(taken).collect()
        }
        None => vec![],
    };
    Ok(Request {
        budget: study.budget.clone(),
        columns: None,
        format,
        times,
    })
}

/// The columns with the times at which samples were taken.
fn taken_at(study: &Study) -> impl Iterator<Item = &Name> {
    let late = study.sensors.late.iter();
    late.filter_map(|(_, late)| match late {
        Late::TakenAt(column) => Some(column),
        Late::By(_) => None,
    })
}

/// Headers of time and of all that the plant has names for: readings, inputs, and what may be compared with them.
fn asked_for(study: &Study) -> Result<HashSet<String>, Error> {
    let plant = crate::prepare::plant(study)?;
    let settings = &study.estimate;
    let variables = plant
        .states
        .iter()
        .chain(&plant.inputs)
        .chain(&plant.outputs);
    let headers = variables.map(|v| header(settings, &v.name).to_owned());
    let headers = headers.chain(further_headers(settings));
    let headers = headers.chain([log_time(&plant, settings)]);
    let headers = headers.chain(UNNAMED.map(str::to_owned));
    let given = given(settings).chain(taken_at(study));
    let headers = headers
        .chain(given.flat_map(|given| [names(&given.text), vec![given.text.clone()]].concat()));
    let spelled = |name: String| [visible::line(&name).into_owned(), name];
    Ok(headers.flat_map(spelled).collect())
}

/// A log in the order of time, and what the observers of a study read of it.
#[derive(Clone, Debug)]
pub struct Log<'t> {
    /// what was read
    pub table: Cow<'t, Table>,
    /// the header of time
    pub time: String,
    /// its rows as an observer reads them, and rows between them where samples were taken whose readings are late
    pub samples: Samples,
    /// which of these are the log's, where there are others
    pub(crate) interleaved: Option<Interleaved>,
    /// what it lacks and what was done for its order
    pub notes: Vec<String>,
    /// what of it contradicts itself, or counts nowhere
    pub warnings: Vec<String>,
}

impl Log<'_> {
    /// Whether readings are late, so that its samples have rows between its own.
    #[must_use]
    pub fn is_late(&self) -> bool {
        self.interleaved.is_some()
    }

    /// Its samples, in its own rows alone.
    #[must_use]
    pub fn own_samples(&self) -> Samples {
        let own = |columns: &[Series]| columns.iter().map(|column| self.own(column)).collect();
        Samples {
            time: self.own(&self.samples.time),
            readings: own(&self.samples.readings),
            inputs: own(&self.samples.inputs),
        }
    }

    /// A column of the log over the rows of its samples, NaN in those between its own.
    pub(crate) fn spread(&self, column: &Series) -> Series {
        match &self.interleaved {
            None => column.clone(),
            Some(among) => among.spread(column),
        }
    }

    /// A known input over the rows of the samples.
    pub(crate) fn held(&self, input: &Series) -> Series {
        match &self.interleaved {
            None => input.clone(),
            Some(among) => among.held(input),
        }
    }

    /// The rows of the log of a column over those of the samples.
    pub(crate) fn own(&self, column: &Series) -> Series {
        match &self.interleaved {
            None => column.clone(),
            Some(among) => among.own(column),
        }
    }
}

impl<'t> Log<'t> {
    /// A table as a study takes it: rows put in order unless the study is strict.
    ///
    /// # Errors
    /// Columns that the study names or its observers read and the log does not have, or not as
    /// numbers; times that are no order.
    pub fn read(prepared: &Prepared<'_>, table: &'t Table) -> Result<Self, Error> {
        Self::with(prepared, table, Lack::Nothing)
    }

    /// One of several, in which a sensor may not have reported at all.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub fn one_of(prepared: &Prepared<'_>, table: &'t Table) -> Result<Self, Error> {
        Self::with(prepared, table, Lack::Readings)
    }

    /// One for the plant alone, which may have no column of a sensor: its samples are then empty.
    ///
    /// # Errors
    /// As [`Log::read`].
    pub(crate) fn of_inputs(prepared: &Prepared<'_>, table: &'t Table) -> Result<Self, Error> {
        Self::with(prepared, table, Lack::Columns)
    }

    fn with(prepared: &Prepared<'_>, table: &'t Table, may_lack: Lack) -> Result<Self, Error> {
        let (study, plant) = (prepared.study(), prepared.plant());
        let settings = &study.estimate;
        let augmented = prepared.augmented();
        let mut absent = vec![];
        let is_needed = |name: &Name| {
            let is_made = settings.generator.iter().any(|(made, _)| made == name);
            may_lack != Lack::Columns && !is_made && read(augmented).any(|read| read == name.text)
        };
        let table = with_expressions(table, (settings, taken_at(study)), is_needed, &mut absent)?;
        let time = time_of(&table, plant, settings, read(augmented))?;
        let table = in_unit(study, table, &time)?;
        // of rows of one time one is left, but each sample has a time of its own
        let raw = taken_at(study).next().map(|_| table.clone());
        let ordered = match settings.strict {
            true => None,
            false => table.in_order(&time, settings.late)?,
        };
        let (table, mut notes, lost) = match ordered {
            None => (table, vec![], vec![]),
            Some(Ordered { table, notes, lost }) => (Cow::Owned(table), notes, lost),
        };
        let late = &prepared.declared().late;
        let warnings = read(augmented).filter_map(|name| {
            let own = header(settings, name);
            let mut lost = lost.iter().filter(|lost| lost.column == own).cloned();
            lost.next().map(|lost| match late.of(name) {
                Some(Late::TakenAt(_)) => Lost {
                    first: None,
                    ..lost
                },
                _ => lost,
            })
        });
        let mut warnings = warnings.flat_map(|lost| told(&lost, &time)).collect();
        let mut samples = samples(&table, &time, settings, augmented, may_lack)?;
        let unordered = Unordered {
            raw: raw.as_deref(),
            time: &time,
        };
        let told_late = (&mut notes, &mut warnings);
        let interleaved = match table.has_truth() {
            false => unordered.interleave(prepared, &mut samples, told_late)?,
            // of a simulation every reading has come
            true => None,
        };
        if settings.log.time.is_none() && UNNAMED.contains(&time.as_str()) {
            let which = "the times of the log are in its column without a name";
            notes.push(format!(
                "{which}: set `time` in [log] if they are in another"
            ));
        }
        notes.append(&mut absent);
        notes.extend(screened(prepared, &mut samples));
        notes.extend(gaps(&table, settings, &time, augmented));
        Ok(Self {
            table,
            time,
            samples,
            interleaved,
            notes,
            warnings,
        })
    }
}

/// What of its sensors a log may lack.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Lack {
    Nothing,
    /// all readings in a column
    Readings,
    /// the column
    Columns,
}

/// What of a column that is read counts nowhere, in words.
fn told(lost: &Lost, time: &str) -> Vec<String> {
    let Lost { column, .. } = lost;
    let conflict = lost.first.map(|first| {
        let times = match lost.conflicts {
            1 => "a time".to_owned(),
            count => format!("{count} times"),
        };
        format!(
            "column \"{column}\" says different things at {times}, first {} in line {} and {} in line {} at \"{time}\" = {}; the last one counts: {APART}",
            first.lost, first.line, first.kept, first.kept_line, first.time
        )
    });
    let timeless = (lost.timeless > 0).then(|| {
        format!(
            "column \"{column}\": values in rows without a time, which count nowhere: {}",
            lost.timeless
        )
    });
    conflict.into_iter().chain(timeless).collect()
}

/// Names of the measured outputs, then of the known inputs.
fn read<'e>(augmented: &'e AugmentedPlant<'_>) -> impl Iterator<Item = &'e str> {
    let outputs = augmented.outputs.iter().map(|o| o.variable.name.as_str());
    outputs.chain(augmented.inputs.iter().map(|input| input.name.as_str()))
}

/// What a log knows to be true of an estimated quantity: what a simulation knew, else the column of that name,
/// unless an observer reads it, for readings are no truth.
pub(crate) fn truth<'t>(
    prepared: &Prepared<'_>,
    log: &'t Log<'_>,
    name: &str,
) -> Option<&'t Series> {
    let settings = &prepared.study().estimate;
    let own = header(settings, name);
    let is_read = read(prepared.augmented()).any(|name| header(settings, name) == own);
    let unread = || logged(&log.table, settings, &log.time, name).filter(|_| !is_read);
    log.table.truth(name).or_else(unread)
}

/// The columns of a log that an observer reads: an input's last value stands where its cell is
/// missing; a study that is strict has no cell missing.
fn samples(
    table: &Table,
    time_header: &str,
    settings: &EstimateSettings,
    augmented: &AugmentedPlant<'_>,
    may_lack: Lack,
) -> Result<Samples, Error> {
    let is_empty = |name: &str| {
        may_lack != Lack::Nothing && table.missing(header(settings, name)) == table.rows()
    };
    let is_absent = |name: &str| {
        let own = header(settings, name);
        may_lack == Lack::Columns && !table.names().any(|known| known == own)
    };
    let reading = |name: &str| match settings.strict {
        _ if is_absent(name) => Ok(Series::default()),
        true => table.column(header(settings, name)).cloned(),
        false if is_empty(name) => table.cells(header(settings, name)).cloned(),
        false => table.readings(header(settings, name)).cloned(),
    };
    let input = |name: &str| match is_made(table, settings, name) {
        true => Ok(Series::default()),
        false => held(table, settings, header(settings, name)),
    };
    let outputs = augmented.outputs.iter().map(|o| &o.variable.name);
    let mut read: Vec<(&str, &str)> = vec![];
    for name in outputs.chain(augmented.inputs.iter().map(|u| &u.name)) {
        let own = header(settings, name);
        if let Some((other, _)) = read.iter().find(|(_, known)| *known == own) {
            let message = format!("{other} and {name} both read the column \"{own}\"");
            return Err(Error::input(message)
                .at(table.place())
                .hint("give each a column of its own: `columns` of [estimate]"));
        }
        read.push((name, own));
    }
    let readings = augmented.outputs.iter().map(|o| reading(&o.variable.name));
    let inputs = augmented.inputs.iter().map(|u| input(&u.name));
    Ok(Samples {
        time: table.time(time_header)?.clone(),
        readings: readings.collect::<Result<_, _>>()?,
        inputs: inputs.collect::<Result<_, _>>()?,
    })
}

/// Leaves out of the readings what the study says are none, and tells how many.
fn screened(prepared: &Prepared<'_>, samples: &mut Samples) -> Vec<String> {
    let mut notes = vec![];
    let outputs = prepared
        .augmented()
        .outputs
        .iter()
        .map(|o| &o.variable.name);
    for (name, readings) in outputs.zip(&mut samples.readings) {
        for screen in prepared.declared().screens.of(name).into_iter().flatten() {
            let (left, count) = screen::screened(readings, *screen);
            if count > 0 {
                notes.push(format!(
                    "{name}: {count} of {} cells {} and count as no readings",
                    readings.len(),
                    screen::words(*screen)
                ));
            }
            *readings = left;
        }
    }
    notes
}

/// A column as an input reads it.
///
/// # Errors
/// The log has none, or not of numbers, or a strict study one with missing cells.
pub(crate) fn held(
    table: &Table,
    settings: &EstimateSettings,
    header: &str,
) -> Result<Series, Error> {
    match settings.strict {
        true => table.column(header).cloned(),
        false => table.held(header),
    }
}

/// Whether the log leaves an input to its generator: its samples are then empty.
fn is_made(table: &Table, settings: &EstimateSettings, name: &str) -> bool {
    let mut made = settings.generator.iter();
    let own = header(settings, name);
    made.any(|(input, _)| input.text == name) && !table.names().any(|known| known == own)
}

/// What the log lacks in words, and where its times count from.
fn gaps(
    table: &Table,
    settings: &EstimateSettings,
    time: &str,
    augmented: &AugmentedPlant<'_>,
) -> Vec<String> {
    let origin = table.origin(time);
    let mut notes: Vec<String> = origin
        .map(|origin| {
            let unit = settings.log.time_unit.as_ref();
            match unit.filter(|_| settings.log.seconds() != 1.0) {
                Some(unit) => format!("times are in {unit} since {origin}"),
                None => format!("times are seconds since {origin}"),
            }
        })
        .into_iter()
        .collect();
    let outputs = augmented.outputs.iter().map(|o| &o.variable);
    for signal in augmented.inputs.iter().chain(outputs) {
        let header = header(settings, &signal.name);
        let missing = table.missing(header);
        if missing == 0 {
            continue;
        }
        let places = table.faults(header).iter();
        let places = places.map(|fault| format!("{fault} in line {}", fault.line));
        let places: Vec<String> = places.collect();
        let first = match places.is_empty() {
            true => String::new(),
            false => format!(", first {}", places.join(", ")),
        };
        let rows = table.rows();
        notes.push(format!(
            "column \"{header}\": {missing} of {rows} cells are missing{first}"
        ));
    }
    notes
}

/// A column of the log, if it has one with numbers, and only one, that is not the one of time.
pub(crate) fn logged<'t>(
    table: &'t Table,
    settings: &EstimateSettings,
    time: &str,
    name: &str,
) -> Option<&'t Series> {
    let header = header(settings, name);
    let is_own = table.has_one(header) && header != time;
    let values = table
        .get(header)
        .filter(|_| is_own && table.origin(header).is_none())?;
    values.iter().any(|x| x.is_finite()).then_some(values)
}
