//! The figures of the positions of a slider, filters' too.

use std::borrow::Cow;
use std::ops::ControlFlow;

use lynkeus_observers::Design;

use super::bench::Bench;
use super::record::Record;
use super::{Axis, Sweep, filtered, judged};
use crate::course::columns::Log;
use crate::prepare::Prepared;
use crate::{Error, Series, Study, Table, prepare::headers};

/// Rows of a log that are judged: each is replayed twice for every position.
pub(crate) const ROWS: usize = 5_000;

/// What positions are judged on.
#[derive(Clone, Copy)]
pub(crate) enum Ground<'t> {
    /// the first rows of a log
    Log(&'t Table),
    /// the study's simulation; filters have a sample every `step`
    Simulation { step: f64 },
}

/// What `tune` says of the values of an axis, each with its study. Filters have the same figures, of
/// replays of samples; on a log only the error on held-out samples, which a filter is not shown.
///
/// # Errors
/// A study that cannot be simulated; a log that is too short.
pub(crate) fn at(
    prepared: &Prepared<'_>,
    design: &Design,
    axis: Axis,
    grid: &[(Vec<f64>, Study)],
    ground: Ground<'_>,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Sweep, Error> {
    let is_filter = design.observer.filter.is_some();
    let first = match ground {
        Ground::Log(table) => Some(first(prepared, table)?),
        Ground::Simulation { .. } => None,
    };
    let bench = match (ground, &first) {
        (Ground::Simulation { step }, _) if is_filter => Bench::Samples(Box::new(
            filtered::Simulated::new(prepared, &design.observer, step)?,
        )),
        (_, Some(table)) if is_filter => {
            Bench::SamplesOfLog(Box::new(Record::new(prepared, table)?))
        }
        (_, table) => Bench::new(prepared, table.as_deref())?,
    };
    judged(prepared, &bench, vec![axis], grid, watch)
}

/// The first rows of a log, as far as the study reads them.
fn first<'t>(prepared: &Prepared<'_>, table: &'t Table) -> Result<Cow<'t, Table>, Error> {
    let log = Log::read(prepared, table)?;
    if log.samples.time.len() <= ROWS {
        return Ok(Cow::Borrowed(table));
    }
    let settings = &prepared.study().estimate;
    let augmented = prepared.augmented();
    let outputs = augmented.outputs.iter().map(|o| o.variable.name.as_str());
    let names = outputs.chain(augmented.inputs.iter().map(|u| u.name.as_str()));
    let headers = names.map(|name| headers::header(settings, name).to_owned());
    let part = |values: &Series| values.part(0, ROWS);
    let signals = headers.zip(log.samples.columns().map(part));
    let time = (log.time.clone(), part(&log.samples.time));
    Table::from_columns(std::iter::once(time).chain(signals).collect()).map(Cow::Owned)
}
