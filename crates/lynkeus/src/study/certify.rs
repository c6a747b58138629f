//! `[box]` and `[certify]`: where a guarantee is asked for, and against what.

use super::Name;
use super::section::Entry;
use crate::Error;

const KEYS: &[&str] = &["tube", "slew"];

/// Ranges narrower than the model's `min` and `max`: (name, smallest, largest). An array's
/// name stands for every element.
pub type Box = Vec<(Name, f64, f64)>;

/// What a certificate takes for granted beside the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CertifySettings {
    /// States stay within this distance of their start values, too.
    pub tube: Option<f64>,
    /// Bounds of the rates of change of unknown inputs; one not listed is constant.
    pub slew: Vec<(Name, f64)>,
}

pub(super) fn read(entry: Entry<'_>) -> Result<CertifySettings, Error> {
    let mut section = entry.section("[certify]", KEYS)?;
    Ok(CertifySettings {
        tube: section.optional("tube", Entry::positive)?,
        slew: section
            .optional("slew", |entry| {
                let pairs = entry.pairs()?.into_iter();
                pairs
                    .map(|(name, value)| Ok((name, value.positive()?)))
                    .collect()
            })?
            .unwrap_or_default(),
    })
}

/// `name = number` or `name = [smallest, largest]`.
pub(super) fn read_box(entry: Entry<'_>) -> Result<Box, Error> {
    let side = |(name, entry): (Name, Entry<'_>)| {
        if !entry.is_list() {
            let value = entry.number()?;
            return Ok((name, value, value));
        }
        let wrong = entry.wrong("a number or [smallest, largest]");
        match entry.list_of(Entry::number)?[..] {
            [low, high] if low <= high => Ok((name, low, high)),
            _ => Err(wrong),
        }
    };
    entry.pairs()?.into_iter().map(side).collect()
}
