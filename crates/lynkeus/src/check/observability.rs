//! What can be known at all, in words.

use lynkeus_answer::Document;
use lynkeus_expr::Budget;
use lynkeus_model::Plant;
use lynkeus_observability::{Answer, Quantity, Question, QuestionError, Verdict, analyse};
use lynkeus_structure::Sensors;
use lynkeus_words::Words;

use super::knowledge::in_part;
use super::{CheckOptions, Report};
use crate::{Error, Study};
use lynkeus_experiment::prepare::manifold::with_lengths;
use lynkeus_experiment::words::explain;
use lynkeus_experiment::words::listed;

/// Symmetries told before the rest becomes a count.
const TOLD: usize = 8;

pub(super) fn answer(
    study: &Study,
    plant: &Plant,
    options: &CheckOptions,
    sensors: &Sensors,
    budget: Budget,
) -> Result<Answer, Error> {
    let own = with_lengths(plant);
    let mut measured = sensors.measured.clone();
    if let (Some(own), false) = (&own, measured.is_empty()) {
        let known = own.outputs[plant.outputs.len()..].iter();
        measured.extend(known.map(|output| output.name.clone()));
    }
    let question = Question {
        measured,
        unknown: sensors.unknown.clone(),
        disturbances: sensors.disturbances.clone(),
        parameters: options.parameters,
        about: options.about.clone(),
        budget,
        ..Question::default()
    };
    let plant = own.as_ref().unwrap_or(plant);
    analyse(plant, &question).map_err(|error| blame(study, error))
}

/// The place in the study of a name that does not fit.
fn blame(study: &Study, error: QuestionError) -> Error {
    let name = match error {
        QuestionError::Expression(_) => return explain(error),
        QuestionError::NoSuchName { ref name, .. } => name.clone(),
        other => return explain(other).at(&study.file),
    };
    let refusal = explain(error);
    let sensors = &study.sensors;
    let measured = sensors.measured.as_deref().unwrap_or_default();
    let mut names = measured
        .iter()
        .chain(&sensors.unknown)
        .chain(&sensors.disturbances);
    match names.find(|n| n.is_or_has(&name)) {
        Some(found) => found.blame(refusal),
        None => refusal.at(&study.file),
    }
}

pub(super) fn tell(document: &mut Document, report: &Report) {
    let answer = &report.answer;
    let asked = |name: &&str| answer.quantities.iter().any(|(q, _)| q.name == *name);
    let names = report.states.iter().map(String::as_str);
    let given: Vec<&str> = names.filter(|name| !asked(name)).collect();
    if !given.is_empty() {
        document.line(format!("states with a known start: {}", listed(&given)));
    }
    for (kind, plural) in [
        (Quantity::State, "states"),
        (Quantity::Parameter, "parameters"),
        (Quantity::UnknownInput, "unknown inputs"),
    ] {
        for (verdict, words) in [
            (Verdict::Observable, "observable"),
            (Verdict::Unobservable, "not observable"),
            (Verdict::Undecided, "undecided"),
        ] {
            let names = answer
                .quantities
                .iter()
                .filter(|(asked, k)| *k == kind && asked.verdict == verdict);
            let names: Vec<&str> = names.map(|(asked, _)| asked.name.as_str()).collect();
            if !names.is_empty() {
                document.line(format!("{plural} {words}: {}", listed(&names)));
            }
        }
    }
    document.items(answer.symmetries.iter().take(TOLD).map(Words::words));
    if answer.symmetries.len() > TOLD {
        let more = answer.symmetries.len() - TOLD;
        document.item(format!("and {more} more such groups"));
    }
    for asked in &answer.about {
        document.line(format!("about {}: {}", asked.name, asked.verdict.word()));
    }
    if report.knowledge.is_empty() {
        let partial = answer.partial.iter();
        document.items(partial.map(|p| format!("{}: {}", p.name, in_part(p.share, &p.at))));
    }
    document.items(hint(answer));
    let is_open = |asked: &lynkeus_observability::Asked| asked.verdict == Verdict::Undecided;
    if !answer.is_complete() || report.parameters || answer.about.iter().any(is_open) {
        // how it was decided matters once something is not as hoped
        let notes = answer.notes.iter();
        document.items(notes.map(|note| format!("({})", note.words())));
    }
}

/// What to do about it.
fn hint(answer: &Answer) -> Option<&'static str> {
    let hidden = |kind: Quantity| {
        let mut quantities = answer.quantities.iter();
        quantities.any(|(asked, k)| *k == kind && asked.verdict == Verdict::Unobservable)
    };
    if hidden(Quantity::State) || hidden(Quantity::UnknownInput) {
        return Some(
            "they leave no trace of their own in the outputs: measure something that they act on, or a quantity of each group above",
        );
    }
    hidden(Quantity::Parameter).then_some(
        "fix one parameter of each group above, or measure something that tells them apart",
    )
}
