//! What the study asks for.

use crate::peaking;
use crate::{Tuning, TuningError};

/// Which observer of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Correction {
    /// (7)
    Lee,
    /// (3)
    Classical,
}

/// The choices that decide which conditions there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Settings {
    pub correction: Correction,
    /// the form of Astolfi and Marconi
    pub low_power: bool,
    /// K comes from the study
    pub given: bool,
}

impl Settings {
    pub fn read(tuning: &Tuning) -> Result<Self, TuningError> {
        let low_power = peaking::asked_for(tuning, &["k", "k_poles"])?;
        let choice = tuning.choice("correction", &["lee", "classical"])?;
        let correction = match choice.as_deref() {
            Some("classical") => Correction::Classical,
            _ => Correction::Lee,
        };
        Ok(Self {
            correction,
            low_power,
            given: tuning.values.contains_key("k"),
        })
    }
}
