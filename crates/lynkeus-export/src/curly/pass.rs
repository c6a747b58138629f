//! The pieces of the runtime that take a flow from one instant to another, with events on the way or without.

use lynkeus_run::System;

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

/// How a flow is integrated: x with what is carried along it.
pub(super) fn integrated(flow: &System, more: &[&'static str]) -> String {
    match flow.has_clauses() {
        true => chosen(PASS, &[&holds(flow), more, &["carried"]].concat()),
        false => INTEGRATE.to_owned(),
    }
}

/// How a flow is integrated from a point, x alone.
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
