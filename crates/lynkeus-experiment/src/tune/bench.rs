//! What values are judged on: a simulation or a log, with observers or a filter.

use lynkeus_observers::Design;

use super::measures::{self, Measure};
use super::record::Record;
use super::trial::{Simulated, Trial};
use super::{Row, replay};
use crate::crew::Watch;
use crate::prepare::Prepared;
use crate::{Error, ErrorKind, Table};

/// What values are judged on.
#[derive(Clone, Copy)]
pub enum Ground<'t> {
    /// a log
    Log(&'t Table),
    /// the study's simulation; filters have a sample every `step`
    Simulation {
        /// from one sample to the next
        step: f64,
    },
}

/// The ground prepared: the same for every value.
pub(super) enum Bench<'a> {
    Simulation(Box<Simulated>),
    Log(Box<Record<'a>>),
}

impl<'a> Bench<'a> {
    /// For values of a filter, or of observers.
    ///
    /// # Errors
    /// A study that cannot be simulated; a log that is too short.
    pub fn new(
        prepared: &Prepared<'_>,
        filter: Option<&Design>,
        ground: Ground<'a>,
    ) -> Result<Self, Error> {
        Ok(match ground {
            Ground::Log(table) => {
                Self::Log(Box::new(Record::new(prepared, table, filter.is_some())?))
            }
            Ground::Simulation { step } => {
                let sampled = filter.map(|design| (&design.observer, step));
                Self::Simulation(Box::new(Simulated::new(prepared, sampled)?))
            }
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
        match self {
            Self::Simulation(ground) => {
                Trial::new(prepared, Design::clone(&design), ground)?.judge(row, watch)
            }
            Self::Log(record) => replay::logged(prepared, design, record, row, watch),
        }
    }

    pub fn notes(&self) -> &[String] {
        match self {
            Self::Simulation(ground) => &ground.reference.notes,
            Self::Log(record) => &record.notes,
        }
    }

    pub fn measures(&self) -> &'static [Measure] {
        match self {
            Self::Simulation(ground) => measures::simulated(ground.is_filters()),
            Self::Log(record) => measures::of_log(record.is_filters),
        }
    }
}
