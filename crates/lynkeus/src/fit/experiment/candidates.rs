//! Experiments that could be made: the study's, or usual ones.

use std::collections::HashMap;

use lynkeus_expr::{Node, Tape};
use lynkeus_model::Variable;
use lynkeus_run::filter::Row;
use lynkeus_study::{self, Expression, Name};

use super::extra::{Extra, usual};
use crate::fit::logs::FittedLog;
use crate::fit::plant::Source;
use crate::{Error, Study, near};
use lynkeus_experiment::prepare::{self, systems};
use lynkeus_experiment::words::{explain, number};

/// Most rows of an experiment.
const ROWS: f64 = 1e6;

/// Most sensors that are tried where the study names no candidates.
const SENSORS: usize = 12;

/// Steps of an input over the length of a log, and how far they go, as shares of the declared range.
const STEPS: f64 = 8.0;
const ENDS: [f64; 2] = [0.25, 0.75];

/// A row that is this share of an interval late is in time.
const LATE: f64 = 1e-6;

/// An experiment that could be made.
#[derive(Clone, Debug)]
pub(crate) struct Candidate {
    /// what the study calls it, or what it is
    name: Title,
    pub(super) extras: Vec<Extra>,
    /// by the places of known inputs
    inputs: HashMap<usize, Course>,
    /// the usual time between two rows
    every: f64,
    duration: f64,
}

#[derive(Clone, Debug)]
enum Title {
    Named(String),
    /// with what it measures
    Sensors,
}

/// What an input does.
#[derive(Clone, Debug)]
enum Course {
    Expression(Tape),
    Steps { ends: [f64; 2], length: f64 },
}

/// The log of an experiment.
#[derive(Clone, Debug)]
pub(super) struct Experiment {
    pub time: Vec<f64>,
    /// row by row; no number where a sensor does not report
    pub readings: Vec<f64>,
    pub inputs: Vec<f64>,
    /// numbers in a row of each
    pub widths: [usize; 2],
}

impl Experiment {
    /// As a likelihood reads it.
    pub fn rows(&self) -> impl Iterator<Item = Row<'_>> {
        let [outputs, inputs] = self.widths;
        let time = self.time.iter().enumerate();
        time.map(move |(k, &t)| Row {
            t,
            readings: &self.readings[k * outputs..(k + 1) * outputs],
            inputs: &self.inputs[k * inputs..(k + 1) * inputs],
        })
    }

    /// The inputs that leave their declared ranges.
    pub fn beyond<'v>(&self, inputs: &'v [Variable]) -> impl Iterator<Item = &'v str> {
        let [_, count] = self.widths;
        let leaves = move |place: usize, input: &Variable| {
            let mut rows = self.inputs.chunks_exact(count.max(1));
            rows.any(|row| row[place] < input.min || row[place] > input.max)
        };
        let inputs = inputs.iter().enumerate();
        inputs
            .filter(move |(place, input)| leaves(*place, input))
            .map(|(_, input)| input.name.as_str())
    }

    pub fn readings(&self) -> usize {
        self.readings.iter().filter(|y| y.is_finite()).count()
    }

    pub fn duration(&self) -> f64 {
        let ends = self.time.first().zip(self.time.last());
        ends.map_or(0.0, |(first, last)| last - first)
    }
}

impl Candidate {
    /// Those of the study beside the first log once more; usual ones where it names none.
    ///
    /// # Errors
    /// Names that the plant does not have, expressions that are none.
    pub fn all(source: Source<'_>, study: &Study, log: &FittedLog) -> Result<Vec<Self>, Error> {
        let mut all = vec![Self::again(log)];
        if study.fit.candidates.is_empty() {
            all.extend(Self::usual(source, study, log));
        }
        for (name, given) in &study.fit.candidates {
            all.push(Self::declared(source, study, log, name, given)?);
        }
        Ok(all)
    }

    /// The log once more.
    pub fn again(log: &FittedLog) -> Self {
        Self {
            name: Title::Named("the same again".to_owned()),
            extras: vec![],
            inputs: HashMap::new(),
            every: log.interval(),
            duration: fitted_span(log),
        }
    }

    fn usual(source: Source<'_>, study: &Study, log: &FittedLog) -> Vec<Self> {
        let again = Self::again(log);
        let named = |name: &str| Title::Named(name.to_owned());
        let mut all = vec![
            Self {
                name: named("twice as long"),
                duration: 2.0 * again.duration,
                ..again.clone()
            },
            Self {
                name: named("twice as often"),
                every: 0.5 * again.every,
                ..again.clone()
            },
        ];
        let inputs = source.symbolic.inputs.iter().enumerate();
        all.extend(inputs.filter_map(|(place, input)| {
            let range = input.max - input.min;
            if !(range > 0.0 && range.is_finite()) {
                return None;
            }
            let ends = ENDS.map(|share| input.min + share * range);
            let length = again.duration / STEPS;
            Some(Self {
                name: Title::Named(format!(
                    "{} in {STEPS} steps between {} and {}",
                    input.name,
                    number(ends[0]),
                    number(ends[1])
                )),
                inputs: HashMap::from([(place, Course::Steps { ends, length })]),
                ..again.clone()
            })
        }));
        let hidden = hidden(source, study).into_iter().take(SENSORS);
        all.extend(hidden.map(|variable| Self {
            name: Title::Sensors,
            extras: vec![Extra {
                noise: (source.prepared.declared().noise.of(&variable.name).copied())
                    .filter(|noise| noise.size() > 0.0)
                    .or(usual(variable.min, variable.max)),
                ..extra(source, study, &variable)
            }],
            ..again.clone()
        }));
        all
    }

    fn declared(
        source: Source<'_>,
        study: &Study,
        log: &FittedLog,
        name: &Name,
        given: &lynkeus_study::Candidate,
    ) -> Result<Self, Error> {
        let again = Self::again(log);
        let mut extras = vec![];
        for (sensor, noise) in &given.sensors {
            let own = sources(source).filter(|v| sensor.is_or_has(&v.name));
            let own: Vec<Extra> = own
                .map(|variable| Extra {
                    noise: Some(*noise),
                    ..extra(source, study, variable)
                })
                .collect();
            if own.is_empty() {
                let known = sources(source).map(|v| v.name.as_str());
                return Err(stray(study, "sensors", "output or state", sensor, known));
            }
            extras.extend(own);
        }
        let mut inputs = HashMap::new();
        for (input, expression) in &given.inputs {
            let all = source.symbolic.inputs.iter().enumerate();
            let own: Vec<usize> = all
                .filter(|(_, v)| input.is_or_has(&v.name))
                .map(|(place, _)| place)
                .collect();
            if own.is_empty() {
                let known = source.symbolic.inputs.iter().map(|v| v.name.as_str());
                return Err(stray(study, "inputs", "known input", input, known));
            }
            let tape = tape(source, expression)?;
            inputs.extend(
                own.into_iter()
                    .map(|i| (i, Course::Expression(tape.clone()))),
            );
        }
        let every = given.every.unwrap_or(again.every);
        let duration = given.duration.unwrap_or(again.duration);
        if duration / every > ROWS {
            let message = format!(
                "the candidate \"{name}\" of [fit] has {:.1e} rows, more than {ROWS:.0e}",
                duration / every
            );
            return Err(name.blame(Error::input(message).hint("choose a larger `every`")));
        }
        let found = Self {
            name: Title::Named(name.text.clone()),
            extras,
            inputs,
            every,
            duration,
        };
        // an input without a value is told before the search
        found.experiment(log, 0, &[])?;
        Ok(found)
    }

    /// What it is called, with these sensors.
    pub(super) fn words(&self, extras: &[&Extra]) -> String {
        match &self.name {
            Title::Named(name) => name.clone(),
            Title::Sensors => {
                let names: Vec<String> = extras.iter().map(|extra| extra.words()).collect();
                format!("with {}", names.join(", "))
            }
        }
    }

    /// Its rows: those of the first log, stretched and repeated, with 0 for each reading. Of so many further sensors
    /// report those at `places`.
    ///
    /// # Errors
    /// An input that has no value.
    pub(super) fn experiment(
        &self,
        log: &FittedLog,
        further: usize,
        places: &[usize],
    ) -> Result<Experiment, Error> {
        let rows: Vec<_> = log.rows(log.fitted).collect();
        let Some(first) = rows.first() else {
            return Err(Error::input("no row to fit").at(&log.place));
        };
        let interval = log.interval();
        let own = first.readings.len();
        let widths = [own + further, first.inputs.len()];
        let mut found = Experiment {
            time: vec![],
            readings: vec![],
            inputs: vec![],
            widths,
        };
        let scale = self.every / interval;
        let period = fitted_span(log) + interval;
        let mut tapes: Vec<_> = (self.inputs.iter())
            .map(|(place, course)| match course {
                Course::Expression(tape) => (*place, Some(tape.evaluator()), None),
                Course::Steps { ends, length } => (*place, None, Some((*ends, *length))),
            })
            .collect();
        'all: for repeat in 0.. {
            for row in &rows {
                let pattern = row.t - first.t + f64::from(repeat) * period;
                let offset = scale * pattern;
                if offset > self.duration + LATE * interval {
                    break 'all;
                }
                let t = first.t + offset;
                found.time.push(t);
                found.readings.extend(row.readings.iter().map(|y| 0.0 * y));
                let shows = |i| if places.contains(&i) { 0.0 } else { f64::NAN };
                found.readings.extend((0..further).map(shows));
                let start = found.inputs.len();
                found
                    .inputs
                    .extend_from_slice(held(&rows, (offset + LATE * interval) % period));
                for (place, tape, steps) in &mut tapes {
                    let value = match (tape, steps) {
                        (Some(tape), _) => tape.value(&[t]),
                        (None, Some((ends, length))) => {
                            let step = (offset / *length + LATE).floor();
                            ends[usize::from(step % 2.0 == 0.0)]
                        }
                        (None, None) => f64::NAN,
                    };
                    if !value.is_finite() {
                        let message = format!(
                            "{}: an input of [fit] has no value at {}",
                            self.words(&[]),
                            number(t)
                        );
                        return Err(Error::input(message));
                    }
                    found.inputs[start + *place] = value;
                }
            }
        }
        Ok(found)
    }
}

/// The inputs at a time after the first row, held since the row before.
fn held<'r>(rows: &[Row<'r>], after: f64) -> &'r [f64] {
    let first = rows[0].t;
    let past = rows.partition_point(|row| row.t - first <= after);
    rows[past.saturating_sub(1)].inputs
}

fn fitted_span(log: &FittedLog) -> f64 {
    let time = &log.time[..log.fitted];
    time.first()
        .zip(time.last())
        .map_or(0.0, |(first, last)| last - first)
}

/// What a sensor can show.
fn sources(source: Source<'_>) -> impl Iterator<Item = &Variable> {
    let outputs = &source.symbolic.plant.outputs;
    let is_output = |v: &&Variable| outputs.iter().any(|o| o.name == v.name);
    let states = source.symbolic.states.iter();
    outputs.iter().chain(states.filter(move |v| !is_output(v)))
}

/// Outputs that are not measured, and states and unknown inputs that no output shows.
fn hidden(source: Source<'_>, study: &Study) -> Vec<Variable> {
    let measured = &source.symbolic.outputs;
    let outputs = &source.symbolic.plant.outputs;
    let is_measured = |v: &&Variable| !measured.iter().any(|o| o.variable.name == v.name);
    let unknown = &study.sensors.unknown;
    // a parameter that is estimated is a state that nobody can measure
    let parameters = |v: &&Variable| {
        let is_state = source
            .symbolic
            .plant
            .states
            .iter()
            .any(|s| s.name == v.name);
        is_state && unknown.iter().any(|name| name.is_or_has(&v.name))
    };
    let shown = |v: &&Variable| outputs.iter().any(|o| o.node == v.node);
    let states = source
        .symbolic
        .states
        .iter()
        .filter(|v| !shown(v) && !parameters(v));
    outputs
        .iter()
        .filter(is_measured)
        .chain(states)
        .cloned()
        .collect()
}

/// A sensor on a variable, whose disturbances are 0; its range is also that of a state that it shows.
fn extra(source: Source<'_>, study: &Study, variable: &Variable) -> Extra {
    let plant = source.symbolic.plant;
    let zero = plant.graph.constant(0.0).node();
    let disturbances = prepare::sensors(study, plant).disturbances;
    let silenced = plant
        .inputs
        .iter()
        .filter(|input| disturbances.contains(&input.name));
    let silenced: HashMap<Node, Node> = silenced.map(|input| (input.node, zero)).collect();
    Extra {
        name: variable.name.clone(),
        node: plant.graph.substitute(&[variable.node], &silenced)[0],
        noise: None,
        limits: source
            .prepared
            .declared()
            .limits
            .of(&variable.name)
            .copied(),
    }
}

fn tape(source: Source<'_>, given: &Expression) -> Result<Tape, Error> {
    let plant = source.symbolic.plant;
    let node = systems::expression(plant, given)?;
    Tape::new(&plant.graph, &[plant.time], &[node]).map_err(explain)
}

fn stray<'n>(
    study: &Study,
    key: &str,
    kind: &str,
    name: &Name,
    known: impl Iterator<Item = &'n str>,
) -> Error {
    let known: Vec<&str> = known.collect();
    let message = format!("`{key}` of a candidate of [fit]: no {kind} is called \"{name}\"");
    let refusal = Error::input(message).at(&study.file);
    name.blame(refusal.hint(near::suggest(&name.text, known)))
}
