//! How the measurements correct the estimate, for people and machines.

use std::collections::HashMap;

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Table};
use lynkeus_expr::{Node, Tape};
use lynkeus_model::Plant;
use lynkeus_observers as observers;
use lynkeus_observers::Observer;
use lynkeus_structure::AugmentedPlant;
use lynkeus_words::short;
use serde::Serialize;

use crate::entries::Named;
use crate::{Error, Study, prepare::systems};

/// Characters of an expression that a machine reads.
const WHOLE: usize = 2000;

/// How the measurements correct an observer's estimate.
#[derive(Clone, Debug, PartialEq)]
pub enum Correction {
    /// x̂' = f(x̂, u) − K (ŷ − y) with a constant K: its entries that are not 0
    Gain(Vec<GainEntry>),
    /// the derivatives of the observer's right-hand side with respect to what is measured
    Varying(Vec<InjectionEntry>),
}

/// An entry of K.
#[derive(Clone, Debug, PartialEq)]
pub struct GainEntry {
    /// name of the estimated quantity
    pub state: String,
    /// name of the measured output
    pub output: String,
    /// the gain, in the state's unit per time unit and unit of the output
    pub value: f64,
}

/// The correction of a state by an output, an entry of ∂F/∂y, where it is no constant gain.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[cfg_attr(
    feature = "schema",
    derive(schemars::JsonSchema),
    schemars(rename = "Injection")
)]
pub struct InjectionEntry {
    /// name of the observer's state
    #[serde(skip)]
    pub state: String,
    /// name of the measured output
    #[serde(skip)]
    pub output: String,
    /// the derivative, cut with `…` where it is very long
    pub expression: String,
    /// its value at the start of the study, where the output is what the estimate says;
    /// none where the study gives an input no value
    pub at_start: Option<f64>,
}

/// The correction of a study's observer.
pub fn of(
    study: &Study,
    plant: &Plant,
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
) -> Result<Correction, Error> {
    let found = observers::Correction::of(augmented, observer)
        .map_err(|error| Error::input(error.to_string()))?;
    let injections = match found {
        observers::Correction::Varying(injections) => injections,
        observers::Correction::Gain(K) => {
            let places = (0..K.ncols()).flat_map(|j| (0..K.nrows()).map(move |i| (i, j)));
            let entries = places.filter(|place| K[*place] != 0.0);
            let entry = |(i, j): (usize, usize)| GainEntry {
                state: observer.states[i].0.name.clone(),
                output: observer.measured[j].name.clone(),
                value: K[(i, j)],
            };
            return Ok(Correction::Gain(entries.map(entry).collect()));
        }
    };
    let nodes: Vec<Node> = injections.iter().map(|i| i.node).collect();
    let nodes = at_estimate(study, plant, augmented, observer, &nodes)?;
    let entries = injections.into_iter().zip(nodes).map(|(injection, node)| {
        let expression = plant.graph.render(injection.node, WHOLE);
        InjectionEntry {
            at_start: at_start(study, plant, observer, node),
            state: injection.state,
            output: injection.output,
            expression,
        }
    });
    Ok(Correction::Varying(entries.collect()))
}

/// The expressions where the outputs are what the estimate says and the inputs what the
/// study simulates; an input without value stays.
fn at_estimate(
    study: &Study,
    plant: &Plant,
    augmented: &AugmentedPlant<'_>,
    observer: &Observer,
    nodes: &[Node],
) -> Result<Vec<Node>, Error> {
    let graph = &plant.graph;
    let states = augmented.symbols().into_iter();
    let estimates: HashMap<Node, Node> = states
        .zip(observer.estimates.iter().map(|e| e.node))
        .collect();
    let outputs: Vec<Node> = augmented.outputs.iter().map(|o| o.variable.node).collect();
    let seen = graph.substitute(&outputs, &estimates);
    let signals = observer.measured.iter().map(|m| m.symbol);
    let nodes = graph.substitute(nodes, &signals.zip(seen).collect());
    let mut inputs = vec![];
    for input in &augmented.inputs {
        let node = match &study.simulate {
            Some(settings) => systems::input_expression(study, plant, settings, input).ok(),
            None => input.start.map(|start| graph.constant(start).node()),
        };
        inputs.extend(node.map(|node| (input.name.clone(), node)));
    }
    let derivatives = observer
        .input_derivative_expressions(graph, &inputs)
        .map_err(|error| Error::input(error.to_string()))?;
    let signals = observer.inputs.iter();
    let signals = signals.chain(observer.input_derivatives.iter().map(|d| &d.signal));
    let known = inputs.iter().chain(&derivatives);
    let known: HashMap<&str, Node> = known.map(|(name, node)| (name.as_str(), *node)).collect();
    let images = signals.filter_map(|s| Some((s.symbol, *known.get(s.name.as_str())?)));
    Ok(graph.substitute(&nodes, &images.collect()))
}

fn at_start(study: &Study, plant: &Plant, observer: &Observer, node: Node) -> Option<f64> {
    let mut symbols = vec![plant.time];
    symbols.extend(observer.states.iter().map(|(s, _)| s.symbol));
    let mut values = vec![study.simulate.as_ref().map_or(0.0, |s| s.start)];
    values.extend(observer.states.iter().map(|(_, start)| *start));
    let tape = Tape::new(&plant.graph, &symbols, &[node]).ok()?;
    let value = tape.evaluator().value(&values);
    value.is_finite().then_some(value)
}

impl Correction {
    /// K by state, then by measured output; none where the correction is another.
    pub fn gain(&self) -> Option<Named<Named<f64>>> {
        let Self::Gain(entries) = self else {
            return None;
        };
        let entries = entries.iter();
        Some(nested(entries.map(|e| (&*e.state, &*e.output, e.value))))
    }

    /// ∂F/∂y by state, then by measured output; none where it is K.
    pub fn injection(&self) -> Option<Named<Named<&InjectionEntry>>> {
        let Self::Varying(entries) = self else {
            return None;
        };
        let entries = entries.iter();
        Some(nested(entries.map(|e| (&*e.state, &*e.output, e))))
    }
}

fn nested<'a, T>(entries: impl Iterator<Item = (&'a str, &'a str, T)>) -> Named<Named<T>> {
    let mut rows: Named<Named<T>> = Named::new();
    for (state, output, value) in entries {
        let row = rows.entry(state.to_owned()).or_default();
        row.insert(output.to_owned(), value);
    }
    rows
}

impl Correction {
    /// Output by output.
    pub fn tell(&self, document: &mut Document) {
        match self {
            Self::Gain(entries) => {
                for (output, entries) in by_output(entries, |e| &e.output) {
                    let row =
                        |e: &GainEntry| vec![e.state.as_str().into(), Cell::Number(short(e.value))];
                    let table = Table::plain(["estimate", "gain"]);
                    document.heading(format!("gain of {output} on"));
                    document.table(table.with(entries.into_iter().map(row)));
                }
            }
            Self::Varying(entries) => {
                for (output, entries) in by_output(entries, |e| &e.output) {
                    let row = |e: &InjectionEntry| {
                        let value = e.at_start.map_or("?".to_owned(), short);
                        let formula = Cell::Formula(e.expression.clone());
                        vec![e.state.as_str().into(), Cell::from(value), formula]
                    };
                    let table = Table::plain(["estimate", "at the start", "everywhere"]);
                    document.heading(format!(
                        "correction by {output}: what a unit of it adds, at the start, to"
                    ));
                    document.table(table.with(entries.into_iter().map(row)));
                }
            }
        }
    }
}

/// Entries by their outputs, in the order of these.
fn by_output<T>(entries: &[T], output: impl Fn(&T) -> &String) -> Vec<(&String, Vec<&T>)> {
    let mut groups: Vec<(&String, Vec<&T>)> = vec![];
    for entry in entries {
        let name = output(entry);
        match groups.iter_mut().find(|(known, _)| *known == name) {
            Some((_, group)) => group.push(entry),
            None => groups.push((name, vec![entry])),
        }
    }
    groups
}
