//! `[estimate]`: how a log is replayed.

use super::Name;
use super::keys::{ESTIMATE, INTEGRATOR};
use super::section::Entry;
use super::simulate::{self, Method};
use crate::Error;

/// How a log is replayed.
#[derive(Clone, Debug, PartialEq)]
pub struct EstimateSettings {
    /// What the observer sees between two rows of the log.
    pub between_samples: BetweenSamples,
    /// The integrator and its steps or tolerances.
    pub method: Method,
    /// The header of the time column.
    pub time: String,
    /// Where the log names a signal differently: (the plant's name, the column's header).
    pub columns: Vec<(Name, String)>,
    /// A log with missing cells in a column that is read is refused.
    pub strict: bool,
}

/// What the observer sees between two rows of a log.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum BetweenSamples {
    /// The latest row: what a live observer sees.
    #[default]
    Hold,
    /// The straight line to the next row: looks ahead one sample, so only off-line.
    Linear,
}

impl Default for EstimateSettings {
    fn default() -> Self {
        Self {
            between_samples: BetweenSamples::default(),
            method: Method::default(),
            time: "t".to_owned(),
            columns: Vec::new(),
            strict: false,
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<EstimateSettings, Error> {
    let mut section = entry.section("[estimate]", &[&ESTIMATE[..], &INTEGRATOR].concat())?;
    let defaults = EstimateSettings::default();
    Ok(EstimateSettings {
        between_samples: section
            .optional("between_samples", |e| {
                e.choice(&[
                    ("hold", BetweenSamples::Hold),
                    ("linear", BetweenSamples::Linear),
                ])
            })?
            .unwrap_or_default(),
        method: simulate::method(&mut section)?,
        time: section
            .optional("time", Entry::name)?
            .map_or(defaults.time, |name| name.text),
        columns: match section.take("columns") {
            None => Vec::new(),
            Some(table) => table
                .pairs()?
                .into_iter()
                .map(|(name, header)| Ok((name, header.name()?.text)))
                .collect::<Result<_, Error>>()?,
        },
        strict: section.optional("strict", Entry::boolean)?.unwrap_or(false),
    })
}
