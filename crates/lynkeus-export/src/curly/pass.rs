//! How a flow is integrated in the draft: smooth, or in steps that end at events, found as the library's fixed steps
//! find them.

use lynkeus_run::System;
use lynkeus_run::filter::NoisyModel;

use super::template::{chosen, exchanged};

pub(super) const INTEGRATE: &str = include_str!("runtime/integrate.c");
const PASS: &str = include_str!("runtime/pass.c");

/// Facts that pieces of the runtime ask for: there is a timer, a relation.
pub(super) fn holds(system: &System) -> Vec<&'static str> {
    let Some(whens) = system.whens() else {
        return vec![];
    };
    let facts = [
        (!whens.timers.is_empty(), "timers"),
        (!whens.relations.is_empty(), "watched"),
    ];
    facts
        .iter()
        .filter(|fact| fact.0)
        .map(|fact| fact.1)
        .collect()
}

/// States that events alone change, and that have no deviation.
pub(super) fn discrete(model: &NoisyModel) -> Vec<usize> {
    let whens = model.flow.system().whens();
    let discrete = whens
        .iter()
        .flat_map(|whens| whens.discrete.iter().copied());
    let is_sure = |i: &usize| model.initial_variance[*i] == 0.0 && model.process_noise[*i] == 0.0;
    discrete.filter(is_sure).collect()
}

/// How a flow is integrated: x with what is carried along it.
pub(super) fn integrated(flow: &System, more: &[&'static str]) -> String {
    match flow.has_clauses() {
        true => chosen(PASS, &[&holds(flow), more, &["carried"]].concat()),
        false => INTEGRATE.to_owned(),
    }
}

/// How a flow is integrated, x alone.
pub(super) fn integrated_alone(flow: &System) -> String {
    match flow.has_clauses() {
        true => chosen(PASS, &holds(flow)),
        false => INTEGRATE.to_owned(),
    }
}

/// How a flow is integrated from a point, x alone, beside what is carried along another one.
pub(super) fn integrated_point(flow: &System) -> String {
    let text = match flow.has_clauses() {
        true => {
            let mut holds = holds(flow);
            holds.push(match holds.contains(&"watched") {
                true => "point_watched",
                false => "point_blind",
            });
            chosen(PASS, &holds)
        }
        false => INTEGRATE.to_owned(),
    };
    exchanged(&text, |word| match word {
        "DIMENSION" => Some("STATES".to_owned()),
        "integrate" | "leap" | "look" | "first_change" | "carry_jump" | "occur" | "pass" => {
            Some(format!("{word}_point"))
        }
        _ => None,
    })
}

/// A piece of the runtime with what is remembered of events, handed on where there are some.
pub(super) fn remembering(text: &str, has_events: bool) -> String {
    let words = match has_events {
        true => [", double *m", ", m", ", s->memory"],
        false => [""; 3],
    };
    text.replace("MEMORY_PARAMETER", words[0])
        .replace("MEMORY_ARGUMENT", words[1])
        .replace("MEMORY_OF_STATE", words[2])
}
