//! `[serve]`: how a study's estimator runs beside a plant.

use super::keys::SERVE;
use super::section::Entry;
use lynkeus_answer::Error;

/// How a study's estimator runs beside a plant.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ServeSettings {
    /// So long a row that is older than another is waited for, in units of the plant's time.
    pub wait: f64,
}

pub(super) fn read(entry: Entry<'_>) -> Result<ServeSettings, Error> {
    let mut section = entry.section("[serve]", &SERVE)?;
    Ok(ServeSettings {
        wait: section.optional("wait", waited)?.unwrap_or(0.0),
    })
}

/// A time to wait.
fn waited(entry: Entry<'_>) -> Result<f64, Error> {
    let refusal = entry.wrong("a time >= 0, in units of the plant's time");
    entry.number().ok().filter(|t| *t >= 0.0).ok_or(refusal)
}
