//! What values are judged on: a simulation or a log, with observers or a filter.

use super::measures::{self, Measure};
use super::record::Record;
use super::reference::Reference;
use super::{Row, filtered, replay, trial};
use crate::crew::Watch;
use crate::prepare::Prepared;
use crate::{Error, ErrorKind, Study, Table};

/// What a value is judged on.
pub(super) enum Bench<'a> {
    Simulation(Box<Reference>),
    Log(Box<Record<'a>>),
    /// a filter's
    Samples(Box<filtered::Simulated>),
    /// a filter's
    SamplesOfLog(Box<Record<'a>>),
}

impl<'a> Bench<'a> {
    pub fn new(prepared: &Prepared<'_>, log: Option<&'a Table>) -> Result<Self, Error> {
        Ok(match log {
            Some(table) => Self::Log(Box::new(Record::new(prepared, table)?)),
            None => Self::Simulation(Box::new(Reference::new(prepared)?)),
        })
    }

    pub fn row(
        &self,
        prepared: &Prepared<'_>,
        values: &[f64],
        watch: &mut Watch<'_>,
    ) -> Result<Row, Error> {
        let row = Row::empty(values, self.measures().len());
        let design = match prepared.design() {
            Ok(design) => design,
            Err(error) if error.kind() == ErrorKind::Refused => {
                return Ok(row.failed(error.message()));
            }
            Err(error) => return Err(error),
        };
        let is_filter = design.observer.filter.is_some();
        match self {
            Self::Simulation(_) | Self::Log(_) if is_filter => Err(filter_refused(
                prepared.study(),
                design.examination.family.name(),
            )),
            Self::Simulation(reference) => {
                trial::simulated(prepared, &design, reference, row, watch)
            }
            Self::Log(record) | Self::SamplesOfLog(record) => {
                replay::logged(prepared, design, record, row, watch)
            }
            Self::Samples(samples) => filtered::simulated(prepared, &design, samples, row, watch),
        }
    }

    pub fn notes(&self) -> &[String] {
        match self {
            Self::Simulation(reference) => &reference.notes,
            Self::Samples(samples) => &samples.reference.notes,
            Self::Log(record) | Self::SamplesOfLog(record) => &record.notes,
        }
    }

    pub fn measures(&self) -> &'static [Measure] {
        match self {
            Self::Simulation(_) | Self::Samples(_) => measures::SIMULATED,
            Self::Log(_) | Self::SamplesOfLog(_) => measures::LOGGED,
        }
    }
}

/// A filter's equations without its updates are the plant alone.
pub(super) fn filter_refused(study: &Study, family: &str) -> Error {
    Error::input(format!(
        "`tune` judges observers whose correction is in their equations: expected another family than the filter \"{family}\""
    ))
    .at(&study.file)
    .hint("name another `family` in [observer], if `lynkeus check` finds one that fits; `lynkeus compare` judges filters as they are")
}
