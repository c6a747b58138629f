//! What speaks against an estimate.

use lynkeus_words::figures;
use serde::Serialize;

/// How much a doubt weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Level {
    /// Worth a look.
    Note,
    /// Something declared is probably wrong; the estimate may still serve.
    Warning,
    /// The estimate is not credible.
    Refusal,
}

/// What a doubt rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
pub enum Kind {
    /// The run ended before its last row.
    Ended,
    /// An estimate is outside of its declared range.
    Range,
    /// Readings are farther from the estimate than their noise and the model's explain.
    Innovations,
    /// The gate rejects readings.
    Rejected,
    /// A sensor is frozen.
    Frozen,
    /// A single reading moves the estimate by many of its deviations.
    Jump,
    /// Few particles count, or none.
    Particles,
    /// Readings are much closer to the estimate than declared.
    Noise,
    /// Innovations that follow from the ones before.
    Coloured,
}

/// Something that speaks against an estimate.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Doubt {
    /// what it rests on
    pub kind: Kind,
    /// the measured output, or the estimated quantity
    pub name: String,
    /// in words
    pub text: String,
    /// how much it weighs; a refusal makes the result not credible
    pub level: Level,
}

impl Level {
    pub(crate) fn word(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Refusal => "refusal",
        }
    }
}

impl Kind {
    pub(crate) fn hint(self) -> &'static str {
        match self {
            Self::Range => {
                "see whether `lynkeus certify` proves this tuning, try another (`lynkeus tune`), compare units, columns and the model with the log; if the plant really goes there, declare a wider min and max (the result is still written)"
            }
            Self::Frozen => {
                "repair the sensor, or declare its range (`limits` of [sensors]) if that is what its readings show (the result is still written)"
            }
            Self::Particles => {
                "take more `particles`, proposal = \"auxiliary\", a larger `initial_variance` or densities under [process_noise], or a noise that explains the readings (the result is still written)"
            }
            _ => {
                "declare larger densities under [process_noise] for what the model does not know, or a larger noise of the sensor; compare units, signs and columns of the log with the model (the result is still written)"
            }
        }
    }
}

impl Doubt {
    /// A run that ended before its last row.
    pub(crate) fn ended(text: String) -> Self {
        Self {
            kind: Kind::Ended,
            name: String::new(),
            text,
            level: Level::Refusal,
        }
    }

    /// Whether it is worth a line: what refuses is told by the refusal, and what hangs beside the log.
    pub(crate) fn is_told(&self) -> bool {
        self.level != Level::Refusal && self.kind != Kind::Frozen
    }
}

/// A ratio in words.
pub(crate) fn times(ratio: f64) -> String {
    format!("{} times", figures(ratio, 2))
}
