//! Samples held out of a log, and the observer that runs without them.

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_model::Plant;
use lynkeus_observers::{Monitor, Observer, Signal};

use super::speed::transparent;
use crate::study::TuneSettings;
use crate::systems::Reported;
use crate::{Error, Study};

/// The signal that is above zero where the measurements are held out; no name in a model's text
/// has a blank, unless it is in quotes.
pub(super) const HELD_OUT: &str = "held out";

/// The course of a predicted measurement, by its place among the observer's measured outputs.
pub(super) fn predicted<'r>(
    observer: &Observer,
    reported: Reported<'r>,
    place: usize,
) -> Option<&'r [f64]> {
    reported.monitor(observer.states.len() + place)
}

/// The observer with a switch: where [`HELD_OUT`] is above zero, it reads its own prediction
/// h(x̂) in the place of every measurement, so that its innovation is zero and it runs as a
/// model. Its monitors are its states, then its predictions.
pub(super) fn switchable(plant: &Plant, observer: &Observer) -> Observer {
    let graph = &plant.graph;
    let predictions = predictions(plant, observer);
    let switch = graph.fresh(HELD_OUT);
    let is_out = switch.greater(graph.constant(0.0)).node();
    let pairs = observer.measured.iter().zip(&predictions);
    let replaced: HashMap<Node, Node> = pairs
        .map(|(signal, prediction)| {
            let read = graph.select(is_out, *prediction, signal.symbol);
            (signal.symbol, read)
        })
        .collect();
    let mut switchable = transparent(observer);
    switchable.derivatives = graph.substitute(&observer.derivatives, &replaced);
    switchable.inputs.push(Signal {
        name: HELD_OUT.to_owned(),
        symbol: switch.node(),
    });
    let pairs = observer.measured.iter().zip(predictions);
    switchable
        .monitors
        .extend(pairs.map(|(signal, node)| Monitor {
            name: signal.name.clone(),
            node,
            alarm_below: f64::NEG_INFINITY,
            meaning: String::new(),
        }));
    switchable
}

/// h at the estimate, by measured output; disturbances are zero, as the observer takes them.
fn predictions(plant: &Plant, observer: &Observer) -> Vec<Node> {
    let graph = &plant.graph;
    let mut map: HashMap<Node, Node> = HashMap::new();
    let zero = graph.constant(0.0).node();
    map.extend(plant.inputs.iter().map(|input| (input.node, zero)));
    map.insert(plant.time, observer.time);
    for input in &plant.inputs {
        let read = observer.inputs.iter().find(|s| s.name == input.name);
        map.extend(read.map(|signal| (input.node, signal.symbol)));
    }
    for estimate in &observer.estimates {
        map.insert(estimate.variable.node, estimate.node);
    }
    let output = |signal: &Signal| {
        let output = plant.outputs.iter().find(|o| o.name == signal.name);
        output.map_or(signal.symbol, |o| o.node)
    };
    let outputs: Vec<Node> = observer.measured.iter().map(output).collect();
    graph.substitute(&outputs, &map)
}

/// Which rows of a log are held out, and which are scored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    /// by row: 1 where it is held out
    pub held_out: Vec<f64>,
    /// rows before this one are the observer's start and are not scored
    pub first: usize,
}

impl Plan {
    /// Equal blocks of rows, each with its last share held out.
    ///
    /// # Errors
    /// A log too short for the blocks.
    pub fn new(study: &Study, rows: usize) -> Result<Self, Error> {
        let TuneSettings {
            held_out, blocks, ..
        } = study.tune;
        let edge = |block: usize| block * rows / blocks;
        let out = |length: usize| ((held_out * length as f64).round() as usize).max(1);
        let shortest = rows / blocks;
        if shortest < 2 || out(shortest) >= shortest {
            return Err(Error::input(format!(
                "a log of {rows} rows is too short for {blocks} blocks of which {held_out} is held out: expected 2 rows or more in each"
            ))
            .at(&study.file)
            .hint("set fewer `blocks` or a smaller `held_out` in [tune]"));
        }
        let mut plan = vec![0.0; rows];
        for block in 0..blocks {
            let (from, to) = (edge(block), edge(block + 1));
            let tail = plan.get_mut(to - out(to - from)..to);
            tail.into_iter().flatten().for_each(|row| *row = 1.0);
        }
        Ok(Self {
            held_out: plan,
            first: edge(1),
        })
    }

    /// The rows that are scored.
    pub fn scored(&self) -> impl Iterator<Item = usize> + '_ {
        let rows = self.held_out.iter().enumerate().skip(self.first);
        rows.filter(|(_, out)| **out > 0.0).map(|(row, _)| row)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan(text: &str, rows: usize) -> Result<Plan, Error> {
        Plan::new(&Study::parse(text, "s.toml").unwrap(), rows)
    }

    #[test]
    fn the_end_of_every_block_is_held_out_and_the_first_block_not_scored() {
        let plan = plan("tune = { blocks = 3, held_out = 0.4 }", 15).unwrap();
        assert_eq!(plan.scored().collect::<Vec<_>>(), [8, 9, 13, 14]);
        assert_eq!(plan.held_out.iter().sum::<f64>(), 6.0);
    }

    #[test]
    fn a_short_log_is_refused() {
        let error = plan("", 30).unwrap_err().to_string();
        assert!(
            error.contains("a log of 30 rows is too short for 20 blocks"),
            "{error}"
        );
        assert!(plan("", 40).is_ok());
    }
}
