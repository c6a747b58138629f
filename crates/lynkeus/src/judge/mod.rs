//! Whether an estimate is credible: the one judgement of every run, whatever its family.
//!
//! It takes what a run knows (readings beside what was expected of them, estimates beside their
//! declared ranges, sensors that hang) and returns doubts. One of the level [`Level::Refusal`] is the
//! answer "not credible". Thresholds and how often they err: `docs/credibility.md`.

mod innovations;
mod quantile;
mod ranges;
mod residuals;
mod sensors;
mod trace;

use lynkeus_model::Variable;
pub(crate) use lynkeus_run::credible::By;
use lynkeus_structure::figures;
use serde_json::{Value, json};

pub use innovations::Innovations;
pub(crate) use innovations::innovations;
#[cfg_attr(not(feature = "tune"), allow(unused_imports))]
pub(crate) use ranges::{RUN_AWAY, Screen};
pub(crate) use residuals::residuals;
pub(crate) use sensors::Judged;
pub(crate) use trace::Trace;

use crate::outside::percent;
use crate::{Error, Frozen, Quantity, Series};

/// How much a doubt weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Level {
    /// Worth a look.
    Note,
    /// Something declared is probably wrong; the estimate may still serve.
    Warning,
    /// The estimate is not credible.
    Refusal,
}

/// What a doubt rests on.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Kind {
    /// The run ended before its last row.
    Ended,
    /// An estimate is outside of its declared range.
    Range,
    /// Readings are farther from the estimate than their noise and the model's explain.
    Innovations,
    /// The gate rejects readings.
    Rejected,
    /// A sensor hangs.
    Frozen,
    /// A single reading moves the estimate by many of its deviations.
    Jump,
    /// Readings are much closer to the estimate than declared.
    Noise,
    /// Innovations that follow from the ones before.
    Coloured,
}

/// Something that speaks against an estimate.
#[derive(Clone, Debug, PartialEq)]
pub struct Doubt {
    /// What it rests on.
    pub kind: Kind,
    /// The measured output, or the estimated quantity.
    pub name: String,
    /// In words.
    pub text: String,
    /// How much it weighs.
    pub level: Level,
}

impl Level {
    fn word(self) -> &'static str {
        match self {
            Self::Note => "note",
            Self::Warning => "warning",
            Self::Refusal => "refusal",
        }
    }
}

impl Kind {
    fn word(self) -> &'static str {
        match self {
            Self::Ended => "ended",
            Self::Range => "range",
            Self::Innovations => "innovations",
            Self::Rejected => "rejected",
            Self::Frozen => "frozen",
            Self::Jump => "jump",
            Self::Noise => "noise",
            Self::Coloured => "coloured",
        }
    }

    fn hint(self) -> &'static str {
        match self {
            Self::Range => {
                "see whether `lynkeus certify` proves this tuning, try another `theta` or `clamp = true`, compare the model with the log; if the plant really goes there, declare a wider min and max (the result is written all the same)"
            }
            Self::Frozen => {
                "mend the sensor, or declare its range (`limits` of [sensors]) if that is what its readings show (the result is written all the same)"
            }
            _ => {
                "declare larger densities under [process_noise] for what the model does not know, or a larger noise of the sensor; compare units, signs and columns of the log with the model (the result is written all the same)"
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

    /// For machines.
    #[must_use]
    pub fn to_json(&self) -> Value {
        json!({
            "kind": self.kind.word(),
            "name": self.name,
            "text": self.text,
            "level": self.level.word(),
        })
    }
}

/// What a run knows of itself.
pub(crate) struct Evidence<'e> {
    pub time: &'e Series,
    pub quantities: &'e [Quantity],
    /// what is declared of everything estimated
    pub declared: Vec<&'e Variable>,
    /// standard deviations of quantities by name, whether or not they are told
    pub deviations: Vec<(&'e str, &'e Series)>,
    /// by measured output
    pub sensors: Vec<Judged<'e>>,
    pub frozen: &'e [Frozen],
    /// whether the deviations are a filter's own, or those of a linearised error system
    pub is_filter: bool,
    /// whether the readings are those of a log
    pub replayed: bool,
}

/// Hanging readings are worth a refusal from this share of a sensor's readings on.
const HANGS: f64 = 0.25;

/// Everything that speaks against the estimates of a run; what weighs most comes first.
pub(crate) fn doubts(evidence: &Evidence<'_>) -> Vec<Doubt> {
    let mut found = ranges::doubts(evidence);
    for doubt in evidence.sensors.iter().flat_map(sensors::doubts) {
        // of one kind the heaviest
        let is_same = |d: &Doubt| d.kind == doubt.kind && d.name == doubt.name;
        match found.iter().position(is_same) {
            Some(place) if found[place].level < doubt.level => found[place] = doubt,
            Some(_) => {}
            None => found.push(doubt),
        }
    }
    found.extend(hanging(evidence));
    found.sort_by(|a, b| b.level.cmp(&a.level).then(a.kind.cmp(&b.kind)));
    found
}

/// Sensors that hang, one doubt for each.
fn hanging(evidence: &Evidence<'_>) -> Vec<Doubt> {
    let of = |sensor: &Judged<'_>| {
        if sensor.by == By::Settled {
            return None;
        }
        let own = || evidence.frozen.iter().filter(|f| f.output == sensor.name);
        // an end of the sensor's range may well be shown for long: where `limits` declare it, it is no fault here
        let rows: usize = own().map(|f| f.rows).sum();
        let share = rows as f64 / sensor.trace.readings().max(1) as f64;
        let first = own().next()?;
        let text = match share >= HANGS {
            true => format!(
                "{} hangs in {} of its readings",
                sensor.name,
                percent(share)
            ),
            false => first.words(),
        };
        Some(Doubt {
            kind: Kind::Frozen,
            name: sensor.name.to_owned(),
            text,
            level: match share >= HANGS {
                true => Level::Refusal,
                false => Level::Warning,
            },
        })
    };
    evidence.sensors.iter().filter_map(of).collect()
}

/// Names that a refusal tells beside the first.
const NAMED: usize = 4;

/// The answer "not credible", with its first reason; none where nothing weighs so much. The doubts
/// are as [`doubts`] sorts them.
pub(crate) fn refusal(doubts: &[Doubt]) -> Option<Error> {
    let refusals = || doubts.iter().filter(|d| d.level == Level::Refusal);
    let first = refusals().next()?;
    let mut others: Vec<&str> = vec![];
    for doubt in refusals().skip(1) {
        if doubt.name != first.name && !others.contains(&doubt.name.as_str()) {
            others.push(&doubt.name);
        }
    }
    let more = others.len().saturating_sub(NAMED);
    others.truncate(NAMED);
    let also = match (others.is_empty(), more) {
        (true, _) => String::new(),
        (false, 0) => format!("; doubtful, too: {}", others.join(", ")),
        (false, more) => format!("; doubtful, too: {} and {more} more", others.join(", ")),
    };
    let message = format!("the estimate is not credible: {}{also}", first.text);
    Some(Error::refused(message).hint(first.kind.hint()))
}

/// A ratio in words.
fn times(ratio: f64) -> String {
    format!("{} times", figures(ratio, 2))
}
