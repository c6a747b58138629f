//! `[estimate]`: how a log is replayed.

use super::Name;
use super::keys::{ESTIMATE, INTEGRATOR};
use super::section::Entry;
use super::simulate::{self, Method};
use crate::Error;

/// How a log is replayed.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct EstimateSettings {
    /// What the observer sees between two rows of the log.
    pub between_samples: BetweenSamples,
    /// The integrator and its steps or tolerances.
    pub method: Method,
    /// The header of the time column; `None` is `t`, or `time` where an output or an input of the
    /// plant is called `t` in the log.
    pub time: Option<String>,
    /// Where the log names a signal differently: (the plant's name, the column's header).
    pub columns: Vec<(Name, String)>,
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

pub(super) fn read(entry: Entry<'_>) -> Result<EstimateSettings, Error> {
    let mut section = entry.section("[estimate]", &[&ESTIMATE[..], &INTEGRATOR].concat())?;
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
        time: section.optional("time", Entry::name)?.map(|name| name.text),
        columns: match section.take("columns") {
            None => Vec::new(),
            Some(table) => table
                .pairs()?
                .into_iter()
                .map(|(name, header)| Ok((name, header.name()?.text)))
                .collect::<Result<_, Error>>()?,
        },
    })
}
