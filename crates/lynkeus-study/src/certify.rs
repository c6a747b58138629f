//! `[box]` and `[certify]`: where a guarantee is asked for, and against what.

use super::Name;
use super::keys::CERTIFY;
use super::section::Entry;
use lynkeus_answer::Error;

/// Ranges narrower than the model's `min` and `max`: (name, smallest, largest). An array's
/// name stands for every element.
pub type Box = Vec<(Name, f64, f64)>;

/// What a certificate takes for granted beside the model.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct CertifySettings {
    /// States stay within this distance of their start values, too.
    pub tube: Option<f64>,
    /// From where the plant starts, where it is asked whether it stays in the box: states and constant
    /// unknown inputs.
    pub start: Option<Box>,
    /// Until when.
    pub until: Option<f64>,
    /// Bounds of the rates of change of unknown inputs; one not listed is constant.
    pub slew: Vec<(Name, f64)>,
    /// Bounds of |u'|, |u''|, … of known inputs, as many as are known.
    pub input_derivatives: Vec<(Name, Vec<f64>)>,
}

pub(super) fn read(entry: Entry<'_>) -> Result<CertifySettings, Error> {
    let mut section = entry.section("[certify]", &CERTIFY)?;
    Ok(CertifySettings {
        tube: section.optional("tube", Entry::positive)?,
        start: section.optional("start", read_box)?,
        until: section.optional("until", Entry::number)?,
        slew: section
            .optional("slew", |entry| {
                let pairs = entry.pairs()?.into_iter();
                pairs
                    .map(|(name, value)| Ok((name, value.positive()?)))
                    .collect()
            })?
            .unwrap_or_default(),
        input_derivatives: section
            .optional("input_derivatives", |entry| {
                let pairs = entry.pairs()?.into_iter();
                pairs
                    .map(|(name, value)| Ok((name, bounds(value)?)))
                    .collect()
            })?
            .unwrap_or_default(),
    })
}

/// A bound, or a list of them: numbers that are not negative.
fn bounds(entry: Entry<'_>) -> Result<Vec<f64>, Error> {
    let one = |entry: Entry<'_>| {
        let wrong = entry.wrong("a bound, a number ≥ 0");
        entry.number().ok().filter(|x| *x >= 0.0).ok_or(wrong)
    };
    match entry.is_list() {
        true => entry.list_of(one),
        false => Ok(vec![one(entry)?]),
    }
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
