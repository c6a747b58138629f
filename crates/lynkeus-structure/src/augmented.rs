//! The plant as an observer sees it.

use std::collections::HashMap;

use lynkeus_expr::{Graph, MissingInput, Node, jacobian};
use lynkeus_model::{Plant, Variable, Whens};

use crate::{Dimension, Finding, Reason, Region, regularity, steps};

/// Who measures what.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Sensors {
    /// names of the measured outputs; empty for every output of the plant
    pub measured: Vec<String>,
    /// inputs that nobody measures: estimated along with the state
    pub unknown: Vec<String>,
    /// inputs that act on the plant and that the observer takes as zero
    pub disturbances: Vec<String>,
}

/// A name or a range that does not fit the plant.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SensorsError {
    /// no such output or input
    #[error(
        "{key}: the plant '{plant}' has no {kind} named '{name}'; it has {}",
        list(found)
    )]
    NoSuchName {
        /// the study key the name stands under
        key: &'static str,
        /// name of the plant
        plant: String,
        /// `output` or `input`
        kind: &'static str,
        /// the name in question
        name: String,
        /// the names there are
        found: Vec<String>,
    },
    /// the same name twice
    #[error("'{name}' is listed twice among the sensors ({first} and {second}): keep one")]
    Twice {
        /// the name in question
        name: String,
        /// key of the first mention
        first: &'static str,
        /// key of the second
        second: &'static str,
    },
    /// nothing is measured
    #[error(
        "nothing is measured: the plant '{plant}' has no output; declare one, e.g. 'output Real y = x;'"
    )]
    NothingMeasured {
        /// name of the plant
        plant: String,
    },
    /// a smaller box is asked for in no state or input
    #[error(
        "the box has no side '{name}': expected a state, an input or time ({})",
        list(found)
    )]
    NoSuchSide {
        /// the name in question
        name: String,
        /// the names there are
        found: Vec<String>,
    },
    /// a smaller box has nothing in common with the declared range
    #[error("'{name}' is declared in [{min}, {max}]: expected a part of that range")]
    Outside {
        /// the variable
        name: String,
        /// its declared minimum
        min: f64,
        /// its declared maximum
        max: f64,
    },
}

fn list(names: &[String]) -> String {
    match names.is_empty() {
        true => "none".to_owned(),
        false => names.join(", "),
    }
}

/// A measured output.
#[derive(Clone, Debug)]
pub struct Measurement {
    /// the output's declaration; its node is h(t, x, u)
    pub variable: Variable,
    /// index of the augmented state it is an affine function of, if it is one:
    /// y = slope·x + offset
    pub state: Option<(usize, Node, Node)>,
}

/// The plant with its unknown inputs as further states, x' = f(t, x, v, u) and
/// v' = 0 (the true v' is an unknown bounded disturbance of that equation, as for
/// the feed composition in Hammouri, Targui and Armanet, section 3), and with
/// its disturbances set to zero.
#[derive(Clone, Debug)]
pub struct AugmentedPlant<'p> {
    /// the plant
    pub plant: &'p Plant,
    /// states, then unknown inputs
    pub states: Vec<Variable>,
    /// right-hand side, one expression per entry of `states`
    pub derivatives: Vec<Node>,
    /// inputs the observer knows
    pub inputs: Vec<Variable>,
    /// per known input: bounds of |u'|, |u''|, …, as many as are known; none where they are not declared
    pub input_derivatives: Vec<Vec<f64>>,
    /// measured outputs, in the order of the study
    pub outputs: Vec<Measurement>,
    /// by which the states jump
    pub whens: Whens,
    /// row by row which augmented states the derivative depends on
    pub pattern: Vec<Vec<usize>>,
    /// the side of time in the box; the whole line unless narrowed
    pub time: Dimension,
}

impl<'p> AugmentedPlant<'p> {
    /// Applies the sensors to the plant.
    ///
    /// # Errors
    /// Names that the plant does not have or that are listed twice; no output.
    pub fn new(plant: &'p Plant, sensors: &Sensors) -> Result<Self, SensorsError> {
        let graph = &plant.graph;
        refuse_doubles(sensors)?;
        let measured = measured(plant, sensors)?;
        let unknown = inputs(plant, "unknown", &sensors.unknown)?;
        let disturbances = inputs(plant, "disturbances", &sensors.disturbances)?;
        let zero = graph.constant(0.0).node();
        let silenced: HashMap<Node, Node> = disturbances.iter().map(|d| (d.node, zero)).collect();
        let mut derivatives = graph.substitute(&plant.derivatives, &silenced);
        derivatives.extend(unknown.iter().map(|_| zero));
        let whens = plant.whens.substituted(graph, &silenced);
        let known =
            |v: &&Variable| !sensors.unknown.contains(&v.name) && !silenced.contains_key(&v.node);
        let inputs: Vec<Variable> = plant.inputs.iter().filter(known).cloned().collect();
        let states: Vec<Variable> = plant.states.iter().cloned().chain(unknown).collect();
        let symbols: Vec<Node> = states.iter().map(|s| s.node).collect();
        let pattern = jacobian::pattern(graph, &derivatives, &symbols);
        let outputs = measured
            .into_iter()
            .map(|mut variable| {
                variable.node = graph.substitute(&[variable.node], &silenced)[0];
                let state = affine_state(graph, variable.node, &symbols);
                Measurement { variable, state }
            })
            .collect();
        Ok(Self {
            plant,
            states,
            derivatives,
            input_derivatives: vec![vec![]; inputs.len()],
            inputs,
            outputs,
            whens,
            pattern,
            time: Dimension::new("time", plant.time, f64::NEG_INFINITY, f64::INFINITY),
        })
    }

    /// The same on a smaller box: states and inputs named by `side` (an array's name
    /// stands for its elements), or `time`, are limited to [low, high] as well.
    ///
    /// # Errors
    /// No such variable, or nothing in common with its declared range.
    pub fn narrow(&mut self, side: &str, low: f64, high: f64) -> Result<(), SensorsError> {
        if side == "time" {
            // no state or input can have that name
            let Dimension { min, max, .. } = &mut self.time;
            return limit(side, min, max, (low, high));
        }
        let is_meant = |name: &str| {
            let element = name.strip_prefix(side);
            element.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
        };
        let variables = self.states.iter_mut().chain(&mut self.inputs);
        let mut meant = variables.filter(|v| is_meant(&v.name)).peekable();
        if meant.peek().is_some() {
            return meant.try_for_each(|v| limit(&v.name, &mut v.min, &mut v.max, (low, high)));
        }
        let variables = self.states.iter().chain(&self.inputs);
        Err(SensorsError::NoSuchSide {
            name: side.to_owned(),
            found: variables.map(|v| v.name.clone()).collect(),
        })
    }

    /// The bound of the derivative of that order, from 1, of a known input; infinite where none is known.
    pub fn input_derivative(&self, input: usize, order: usize) -> f64 {
        let bounds = self.input_derivatives.get(input);
        let bound = bounds.and_then(|bounds| bounds.get(order.checked_sub(1)?));
        bound.copied().unwrap_or(f64::INFINITY)
    }

    /// The graph of the plant.
    pub fn graph(&self) -> &'p Graph {
        &self.plant.graph
    }

    /// Number of states that are not unknown inputs.
    pub fn plant_states(&self) -> usize {
        self.plant.states.len()
    }

    /// Symbols of the augmented states.
    pub fn symbols(&self) -> Vec<Node> {
        self.states.iter().map(|s| s.node).collect()
    }

    /// h(t, x, u), one expression per measured output.
    pub fn output_nodes(&self) -> Vec<Node> {
        self.outputs.iter().map(|o| o.variable.node).collect()
    }

    /// Index of the augmented state of that name.
    pub fn state_index(&self, name: &str) -> Option<usize> {
        self.states.iter().position(|s| s.name == name)
    }

    /// ∂f_row/∂x_column as an expression; none where it is zero everywhere.
    pub fn partial(&self, row: usize, column: usize) -> Option<Node> {
        let jacobian = jacobian::forward(
            self.graph(),
            &[self.derivatives[row]],
            &[self.states[column].node],
        );
        jacobian.get(0, 0)
    }

    /// Whether f and h have values on the whole of a box and jump nowhere as the states
    /// move: what every condition and every proof on that box takes for granted. Of a plant with a delay
    /// nothing is proved: the states that hold it are not all of it.
    ///
    /// # Errors
    /// [`MissingInput`] where the plant has parameters without value.
    pub fn regularity(&self, region: &Region) -> Result<Finding, MissingInput> {
        if let Some(delay) = self.plant.delays.first() {
            return Ok(Finding::undecided(Reason::Delayed {
                delay: delay.text.clone(),
                states: delay.count,
            }));
        }
        if let Some(clause) = self.whens.clauses.first() {
            let reason = Reason::StateJumps { line: clause.line };
            return Ok(Finding::undecided(reason));
        }
        let all = [self.derivatives.clone(), self.output_nodes()].concat();
        regularity(self.graph(), &all, &self.symbols(), region)
    }

    /// The box: declared ranges of the states, unknown and known inputs, time.
    pub fn region(&self) -> Region {
        let side = |v: &Variable| Dimension {
            name: v.name.clone(),
            symbol: v.node,
            min: v.min,
            max: v.max,
            integer: v.integer,
        };
        let mut dimensions: Vec<Dimension> =
            self.states.iter().chain(&self.inputs).map(side).collect();
        dimensions.push(self.time.clone());
        Region { dimensions }
    }
}

/// Makes a declared range smaller.
fn limit(
    name: &str,
    min: &mut f64,
    max: &mut f64,
    (low, high): (f64, f64),
) -> Result<(), SensorsError> {
    let part = (min.max(low), max.min(high));
    if part.0 <= part.1 {
        (*min, *max) = part;
        return Ok(());
    }
    Err(SensorsError::Outside {
        name: name.to_owned(),
        min: *min,
        max: *max,
    })
}

fn refuse_doubles(sensors: &Sensors) -> Result<(), SensorsError> {
    let inputs = [
        ("unknown", &sensors.unknown),
        ("disturbances", &sensors.disturbances),
    ];
    // an output may be called like an input
    for group in [&inputs[..], &[("measured", &sensors.measured)]] {
        let mut seen = HashMap::new();
        let all = group
            .iter()
            .flat_map(|(key, names)| names.iter().map(|name| (name, *key)));
        for (name, second) in all {
            if let Some(first) = seen.insert(name, second) {
                let name = name.clone();
                return Err(SensorsError::Twice {
                    name,
                    first,
                    second,
                });
            }
        }
    }
    Ok(())
}

fn measured(plant: &Plant, sensors: &Sensors) -> Result<Vec<Variable>, SensorsError> {
    if plant.outputs.is_empty() {
        return Err(SensorsError::NothingMeasured {
            plant: plant.name.clone(),
        });
    }
    if sensors.measured.is_empty() {
        return Ok(plant.outputs.clone());
    }
    let names = sensors.measured.iter();
    names
        .map(|name| find(plant, "measured", "output", &plant.outputs, name))
        .collect()
}

fn inputs(
    plant: &Plant,
    key: &'static str,
    names: &[String],
) -> Result<Vec<Variable>, SensorsError> {
    names
        .iter()
        .map(|name| find(plant, key, "input", &plant.inputs, name))
        .collect()
}

fn find(
    plant: &Plant,
    key: &'static str,
    kind: &'static str,
    variables: &[Variable],
    name: &str,
) -> Result<Variable, SensorsError> {
    let found = variables.iter().find(|v| v.name == name).cloned();
    found.ok_or_else(|| SensorsError::NoSuchName {
        key,
        plant: plant.name.clone(),
        kind,
        name: name.to_owned(),
        found: variables.iter().map(|v| v.name.clone()).collect(),
    })
}

/// y = slope·x + offset with one state x, slope and offset free of states.
fn affine_state(graph: &Graph, output: Node, states: &[Node]) -> Option<(usize, Node, Node)> {
    let jacobian = jacobian::forward(graph, &[output], states);
    let [(_, state, slope)] = jacobian.entries[..] else {
        return None;
    };
    let depends = |node: Node| !jacobian::pattern(graph, &[node], states)[0].is_empty();
    if depends(slope) || jacobian::pattern(graph, &[output], states)[0] != [state] {
        return None;
    }
    // y = 2x − sign(x) has a constant derivative, too
    if steps(graph, output, states) {
        return None;
    }
    let zero = graph.constant(0.0).node();
    let offset = graph.substitute(&[output], &HashMap::from([(states[state], zero)]))[0];
    Some((state, slope, offset))
}

#[cfg(test)]
mod tests;
