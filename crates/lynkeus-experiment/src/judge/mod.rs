//! Whether an estimate is credible: the one judgement of every run, whatever its family.
//!
//! It takes what a run knows (readings beside what was expected of them, estimates beside their
//! declared ranges, sensors that hang) and returns doubts. One of the level [`Level::Refusal`] is the
//! answer "not credible". Thresholds and how often they err: `docs/credibility.md`.

pub(crate) mod accuracy;
pub(crate) mod assertions;
pub(crate) mod expected;
pub(crate) mod frozen;
pub mod interval;
pub(crate) mod outcome;
pub mod outside;
pub(crate) mod saturated;

mod evidence;
mod innovations;
mod quantile;
mod ranges;
mod residuals;
mod sensors;

pub(crate) use lynkeus_run::credible::By;

pub(crate) use evidence::Evidence;
pub use innovations::Innovations;
pub(crate) use innovations::{InnovationCounts, innovations};
pub(crate) use ranges::{RUN_AWAY, Screen};
pub(crate) use residuals::residuals;
pub(crate) use sensors::Judged;
pub use sensors::contradicted;

use crate::Error;
use crate::course::doubt::{Doubt, Kind, Level};
use crate::judge::outside::percent;

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
                "{} is frozen in {} of its readings",
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
