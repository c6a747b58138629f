//! Keys that make another observer than the one of the family's paper.

use super::Remedies;
use crate::Check;
use crate::guarantee::Lmi;
use crate::statement::{Statement, undecided};

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
    /// The first one.
    pub fn of(gain: Option<&Lmi>, remedies: &Remedies) -> Option<Self> {
        let departures = [
            (gain.is_some(), Self::Gain),
            (remedies.low_power, Self::LowPower),
            (remedies.transient.is_some(), Self::Transient),
            (remedies.limit.is_set(), Self::InnovationLimit),
        ];
        let mut asked = departures.into_iter().filter(|(asked, _)| *asked);
        asked.next().map(|(_, departure)| departure)
    }

    fn key(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::LowPower => "form",
            Self::Transient => "transient",
            Self::InnovationLimit => "innovation_limit",
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
