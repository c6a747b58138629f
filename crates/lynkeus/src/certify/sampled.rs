//! What is proved of samples, for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::Line;
use lynkeus_observers::guarantee::{AtSamples, Said, SampledDecay};
use lynkeus_words::Words;
use serde::Serialize;

use super::{CertifyReport, bounds};
use lynkeus_experiment::entries::{Named, finite};
use lynkeus_experiment::words::number;

/// What is proved of samples with measurements that follow the model between them.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "SampledProof"))]
pub(super) struct SampledEntry {
    /// for every sequence of samples no further apart than the longest interval found
    longest: Option<AtSamplesEntry>,
    /// for the samples of the study's simulation; null where it has none or they are not proved
    at: Option<AtSamplesEntry>,
    /// an interval T such that some sequence of samples at most T apart would let the error grow, if slopes changed within
    /// their ranges, or from one point of the box to another, as the proof allows; null where that was not seen
    broken: Option<f64>,
    /// for readings that are held instead, as far apart as the study's: with the proof for continuous sensors
    held: Option<AtSamplesEntry>,
    /// why there is no proof, or what ended the search
    obstacle: Option<String>,
}

/// What is proved for samples at most some interval apart.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "AtSamples"))]
struct AtSamplesEntry {
    /// the longest time from one to the next
    interval: f64,
    /// the decay of the error that is proved, in 1/(unit of time)
    rate: f64,
    /// the factor by which the error may peak
    overshoot: Option<f64>,
    /// the norm below which the error ends where samples are just so far apart
    ultimate_bound: Option<f64>,
    /// the same for each quantity, in its unit
    ultimate_bounds: Named<Option<f64>>,
}

impl From<&AtSamples> for AtSamplesEntry {
    fn from(at: &AtSamples) -> Self {
        let ultimate = at.ultimate.as_ref();
        Self {
            interval: at.interval,
            rate: at.rate,
            overshoot: at.overshoot.and_then(finite),
            ultimate_bound: ultimate.and_then(|b| finite(b.norm)),
            ultimate_bounds: bounds::by_name(ultimate.map_or(&[], |b| &b.states)),
        }
    }
}

impl From<&Result<SampledDecay, Said>> for SampledEntry {
    fn from(sampled: &Result<SampledDecay, Said>) -> Self {
        let found = sampled.as_ref().ok();
        let obstacle = match sampled {
            Ok(found) => found.spent.as_ref(),
            Err(said) => Some(said),
        };
        Self {
            longest: found.map(|found| AtSamplesEntry::from(&found.longest)),
            at: found
                .and_then(|found| found.at.as_ref())
                .map(AtSamplesEntry::from),
            broken: found.and_then(|found| finite(found.broken)),
            held: found
                .and_then(|found| found.held.as_ref())
                .map(AtSamplesEntry::from),
            obstacle: obstacle.map(Words::words),
        }
    }
}

/// The clause of the first line, where something is proved.
pub(super) fn also(report: &CertifyReport) -> Option<String> {
    let found = report.sampled.as_ref()?.as_ref().ok()?;
    Some(format!(
        "; also for samples up to {} apart, predicted between them",
        number(found.longest.interval)
    ))
}

/// The part of the answer about samples.
pub(super) fn tell(
    sampled: &Result<SampledDecay, Said>,
    report: &CertifyReport,
    document: &mut Document,
) {
    let heading = Line::from("samples, predicted between them (between_samples = \"predict\"): ");
    let found = match sampled {
        Ok(found) => found,
        Err(said) => {
            document.heading(heading.decided("undecided"));
            document.item(said.words());
            return;
        }
    };
    // no theorem: a plant that leaves the box is not covered
    let verdict = match report.strays.words(false) {
        Some(_) => "proved inside the box",
        None => "proved",
    };
    document.heading(heading.decided(verdict));
    document.item(format!(
        "up to {} apart, however they come: the error decays at {} or faster",
        number(found.longest.interval),
        number(found.longest.rate)
    ));
    if found.broken.is_finite() {
        let slopes = match found.together {
            true => "from one point of the box to another",
            false => "within their ranges",
        };
        document.item(format!(
            "not up to {} apart: some would let it grow, if slopes changed {slopes}, as the proof allows",
            number(found.broken)
        ));
    }
    if let Some(at) = &found.at {
        let overshoot = at
            .overshoot
            .map(|c| format!(", |e(t)| ≤ {}·e^(−{} t)·|e(0)|", number(c), number(at.rate)));
        document.item(format!(
            "up to {} apart, as the study's are: at {} or faster{}",
            number(at.interval),
            number(at.rate),
            overshoot.unwrap_or_default()
        ));
        let ultimate = at.ultimate.as_ref().filter(|b| b.norm > 0.0);
        if let Some(ultimate) = ultimate {
            let bounds = bounds::in_words(report, &ultimate.states).join(", ");
            document.item(format!(
                "in the end within, where they come regularly: {bounds}"
            ));
        }
    } else if let Some(sampling) = &report.sampling {
        document.item(format!(
            "the study's are {} apart: not proved",
            number(sampling.interval)
        ));
    }
    if let Some((held, ultimate)) = found
        .held
        .as_ref()
        .and_then(|h| Some((h, h.ultimate.as_ref()?)))
    {
        let bounds = bounds::in_words(report, &ultimate.states).join(", ");
        document.item(format!(
            "held instead for up to {}: at {} or faster, in the end within {bounds}",
            number(held.interval),
            number(held.rate)
        ));
    }
    document.notes(found.spent.as_ref().map(Words::words));
}
