//! The columns of a log that a study reads.

use lynkeus_model::Plant;
use lynkeus_observers::{Design, Observer};

use crate::course::Samples;
use crate::study::EstimateSettings;
use crate::{Error, Series, Table};

/// The header under which the log has a signal of the plant.
pub(crate) fn header<'a>(settings: &'a EstimateSettings, name: &'a str) -> &'a str {
    let given = settings
        .columns
        .iter()
        .find(|(plant, _)| plant.text == name);
    given.map_or(name, |(_, header)| header)
}

pub(crate) fn refuse_stray_columns(
    plant: &Plant,
    settings: &EstimateSettings,
) -> Result<(), Error> {
    let names = || {
        plant
            .outputs
            .iter()
            .chain(&plant.inputs)
            .map(|v| v.name.as_str())
    };
    match settings
        .columns
        .iter()
        .find(|(name, _)| !names().any(|n| n == name.text))
    {
        None => Ok(()),
        Some((name, _)) => Err(name.blame(
            Error::input(format!(
                "columns: the plant '{}' has no output or input named \"{name}\"",
                plant.name
            ))
            .hint(crate::near::suggest(&name.text, names())),
        )),
    }
}

/// What the observer reads under a plant's name: an input's last value stands where its cell is
/// missing, unless the study is strict.
pub(crate) fn signal(
    table: &Table,
    settings: &EstimateSettings,
    observer: &Observer,
    name: &str,
) -> Result<Series, Error> {
    let header = header(settings, name);
    let is_input = observer.inputs.iter().any(|input| input.name == name);
    match is_input && !settings.strict {
        true => table.held(header),
        false => table.column(header).cloned(),
    }
}

/// The columns of a log that an observer reads.
pub(crate) fn samples(
    table: &Table,
    time_header: &str,
    settings: &EstimateSettings,
    observer: &Observer,
) -> Result<Samples, Error> {
    let reading = |name: &str| match settings.strict {
        true => table.column(header(settings, name)).cloned(),
        false => table.readings(header(settings, name)).cloned(),
    };
    let readings = observer.measured.iter().map(|s| reading(&s.name));
    let inputs = observer.inputs.iter();
    let inputs = inputs.map(|s| signal(table, settings, observer, &s.name));
    Ok(Samples {
        time: table.time(time_header)?.clone(),
        readings: readings.collect::<Result<_, _>>()?,
        inputs: inputs.collect::<Result<_, _>>()?,
    })
}

/// What the log lacks in words, and where its times count from.
pub(crate) fn gaps(
    table: &Table,
    settings: &EstimateSettings,
    time: &str,
    design: &Design,
) -> Vec<String> {
    let origin = table.origin(time);
    let mut notes: Vec<String> = origin
        .map(|origin| format!("times are seconds since {origin}"))
        .into_iter()
        .collect();
    let observer = &design.observer;
    for signal in observer.inputs.iter().chain(&observer.measured) {
        let header = header(settings, &signal.name);
        let places: Vec<String> = table
            .faults(header)
            .iter()
            .map(|fault| format!("{fault} in line {}", fault.line))
            .collect();
        if !places.is_empty() {
            notes.push(format!(
                "column \"{header}\": {} of {} cells are missing, first {}",
                table.missing(header),
                table.rows(),
                places.join(", ")
            ));
        }
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
    let mut named = table.names().filter(|name| *name == header);
    let is_own = named.next().is_some() && named.next().is_none() && header != time;
    let values = table.get(header).filter(|_| is_own)?;
    values.iter().any(|x| x.is_finite()).then_some(values)
}
