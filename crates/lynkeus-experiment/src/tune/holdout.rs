//! Samples held out of a log, and the observer that runs without them.

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_model::Plant;
use lynkeus_observers::{Monitor, Observer, Signal};

use super::speed::transparent;
use crate::course::{Course, Samples};
use crate::{Error, Series, Study};
use lynkeus_study::TuneSettings;

/// The signal that is above zero where the measurements are held out; no name in a model's text
/// has a blank, unless it is in quotes.
pub(super) const HELD_OUT: &str = "held out";

/// Of a course of a [`switchable`] observer: what it predicts of its measured outputs, in their
/// order.
pub(super) fn predicted<'c>(observer: &Observer, course: &'c Course) -> &'c [Series] {
    let states = observer.states.len();
    let range = states..states + observer.measured.len();
    course.monitors.get(range).unwrap_or_default()
}

/// The observer with a switch: where [`HELD_OUT`] is above zero, it reads its own prediction
/// h(x̂) in the place of every measurement, so that its innovation is zero and it runs as a
/// model. Its monitors are its states, then its predictions, then those of [`transparent`].
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
    let shown = pairs.map(|(signal, node)| Monitor {
        name: signal.name.clone(),
        node,
        alarm_below: f64::NEG_INFINITY,
        meaning: String::new(),
        matrix: None,
    });
    let states = observer.states.len();
    switchable.monitors.splice(states..states, shown);
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
        let states = observer.states.iter().map(|(signal, _)| signal);
        // what a filter generates is a state
        let mut known = observer.inputs.iter().chain(states);
        let read = known.find(|s| s.name == input.name);
        map.extend(read.map(|signal| (input.node, signal.symbol)));
    }
    map.extend(observer.generated.iter().copied());
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

/// What to do where a plan does not fit a log.
pub(super) const FEWER: &str = "set fewer `blocks` or a smaller `held_out` in [tune]";

/// Which rows of a log are held out, and which are scored.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Plan {
    /// by row: 1 where it is held out
    pub held_out: Vec<f64>,
    /// rows before this one are the observer's start and are not scored
    pub first: usize,
}

impl Plan {
    /// Blocks with equally many rows in which a sensor reports, the last share of these held out;
    /// the rows between two of them belong to the first.
    ///
    /// # Errors
    /// A log too short for the blocks.
    pub fn new(study: &Study, samples: &Samples) -> Result<Self, Error> {
        let TuneSettings {
            held_out, blocks, ..
        } = study.tune;
        let reporting = reporting(samples);
        let rows = reporting.len();
        let edge = |block: usize| block * rows / blocks;
        let out = |length: usize| ((held_out * length as f64).round() as usize).max(1);
        let shortest = rows / blocks;
        if shortest < 2 || out(shortest) >= shortest {
            return Err(Error::input(format!(
                "a log with readings in {rows} rows is too short for {blocks} blocks of which {held_out} is held out: expected 2 rows or more in each"
            ))
            .at(&study.file)
            .hint(FEWER));
        }
        let row = |place: usize| reporting.get(place).copied().unwrap_or(samples.time.len());
        let mut plan = vec![0.0; samples.time.len()];
        for block in 0..blocks {
            let (from, to) = (edge(block), edge(block + 1));
            let tail = plan.get_mut(row(to - out(to - from))..row(to));
            tail.into_iter().flatten().for_each(|row| *row = 1.0);
        }
        Ok(Self {
            held_out: plan,
            first: row(edge(1)),
        })
    }

    /// Whether a row is scored, by row.
    pub fn scored(&self) -> impl Iterator<Item = bool> + '_ {
        let rows = self.held_out.iter().enumerate();
        rows.map(|(row, out)| row >= self.first && *out > 0.0)
    }

    /// By row, the number of its stretch: rows that are all held out, or all not.
    pub fn stretches(&self) -> impl Iterator<Item = usize> + Clone + '_ {
        let (mut before, mut stretch) = (0.0, 0);
        self.held_out.iter().map(move |&out| {
            stretch += usize::from(std::mem::replace(&mut before, out) != out);
            stretch
        })
    }
}

/// The rows in which a sensor reports.
fn reporting(samples: &Samples) -> Vec<usize> {
    let mut readings: Vec<_> = samples.readings.iter().map(Series::iter).collect();
    let mut reports = |_: &usize| {
        let row = readings.iter_mut().filter_map(Iterator::next);
        // every sensor goes on to the next row
        row.fold(false, |any, y| any | y.is_finite())
    };
    (0..samples.time.len()).filter(|row| reports(row)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Of two sensors, the first of which reports in every so many rows, the second never.
    fn plan(text: &str, rows: usize, every: usize) -> Result<Plan, Error> {
        let reading = |row: usize| match row.is_multiple_of(every) {
            true => 1.0,
            false => f64::NAN,
        };
        let samples = Samples {
            time: (0..rows).map(|row| row as f64).collect::<Vec<_>>().into(),
            readings: vec![
                (0..rows).map(reading).collect::<Vec<_>>().into(),
                vec![f64::NAN; rows].into(),
            ],
            inputs: vec![],
        };
        Plan::new(&Study::parse(text, "s.toml").unwrap(), &samples)
    }

    fn rows(plan: &Plan) -> Vec<usize> {
        let rows = plan.scored().enumerate();
        rows.filter(|(_, is)| *is).map(|(row, _)| row).collect()
    }

    #[test]
    fn the_end_of_every_block_is_held_out_and_the_first_block_not_scored() {
        let plan = plan("tune = { blocks = 3, held_out = 0.4 }", 15, 1).unwrap();
        assert_eq!(rows(&plan), [8, 9, 13, 14]);
        assert_eq!(plan.held_out.iter().sum::<f64>(), 6.0);
        let stretches: Vec<usize> = plan.stretches().collect();
        assert_eq!(stretches, [0, 0, 0, 1, 1, 2, 2, 2, 3, 3, 4, 4, 4, 5, 5]);
    }

    #[test]
    fn blocks_have_equally_many_rows_with_readings() {
        // readings in rows 0, 3, …, 27; of each five the last two are held out
        let plan = plan("tune = { blocks = 2, held_out = 0.4 }", 30, 3).unwrap();
        assert_eq!(plan.first, 15);
        assert_eq!(rows(&plan), [24, 25, 26, 27, 28, 29]);
        assert!(plan.held_out[9..15].iter().all(|out| *out == 1.0));
    }

    #[test]
    fn a_short_log_is_refused() {
        let error = plan("", 90, 3).unwrap_err().to_string();
        assert!(
            error.contains("a log with readings in 30 rows is too short for 20 blocks"),
            "{error}"
        );
        assert!(plan("", 40, 1).is_ok());
    }
}
