//! Keys that make another observer than the one of the family's paper.

use super::{innovation, low_power, transient};
use crate::statement::{Statement, undecided};
use crate::{Check, Tuning, TuningError, guarantee};

/// How a study's observer departs from the one that the theorem is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Departure {
    /// a gain by linear matrix inequalities
    Gain,
    /// the form of Astolfi and Marconi
    LowPower,
    /// θ changes with time
    Transient,
    /// the correction sees a limited innovation
    InnovationLimit,
}

impl Departure {
    /// The first one; `gains`: the words for `gain` that the paper covers.
    pub fn of(tuning: &Tuning, gains: &[&str]) -> Result<Option<Self>, TuningError> {
        let has = |key: &str| tuning.values.contains_key(key);
        Ok(if guarantee::asked_for(tuning, gains)? {
            Some(Self::Gain)
        } else if low_power::asked_for(tuning, &[])? {
            Some(Self::LowPower)
        } else if has(transient::KEY) {
            Some(Self::Transient)
        } else if has(innovation::KEY) {
            Some(Self::InnovationLimit)
        } else {
            None
        })
    }

    fn key(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::LowPower => low_power::FORM,
            Self::Transient => transient::KEY,
            Self::InnovationLimit => innovation::KEY,
        }
    }

    /// The hypothesis that the observer is the paper's, which is then open.
    pub fn check(self, statement: impl Into<Statement>) -> Check {
        let detail = format!(
            "the key '{}' makes another observer, which the theorem does not cover",
            self.key()
        );
        undecided(statement, detail)
    }
}
