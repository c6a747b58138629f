//! A reference point in ordinary numbers, where branches are chosen.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Node, Tape};
use lynkeus_model::{Plant, Variable};

use crate::field::Random;

/// How far beside zero a known start is looked at.
const BESIDE: f64 = 1e-6;

/// Values of every symbol: the model's own where it gives them, else inside the range.
pub(crate) fn reference(plant: &Plant, random: &mut Random) -> HashMap<Node, f64> {
    let mut values = HashMap::new();
    for variable in plant.states.iter().chain(&plant.inputs) {
        values.insert(variable.node, inside(variable, None, random));
    }
    for parameter in &plant.parameters {
        values.insert(
            parameter.variable.node,
            inside(&parameter.variable, parameter.value, random),
        );
    }
    values.insert(plant.time, 0.1 + random.unit());
    values
}

fn inside(variable: &Variable, value: Option<f64>, random: &mut Random) -> f64 {
    // a known start at zero is no point of its own: beside it, so that thresholds are told apart
    let start = match variable.fixed && variable.start.unwrap_or(0.0) == 0.0 {
        true => Some(BESIDE),
        false => variable.start.filter(|x| *x != 0.0),
    };
    let given = value.or(start);
    if let Some(given) = given {
        return given;
    }
    let low = if variable.min.is_finite() {
        variable.min
    } else {
        0.0
    };
    let high = if variable.max.is_finite() {
        variable.max.max(low)
    } else {
        low + 2.0
    };
    low + (0.1 + 0.8 * random.unit()) * (high - low)
}

/// The value of a node there, where it is finite.
pub(crate) fn value(graph: &Graph, node: Node, values: &HashMap<Node, f64>) -> Option<f64> {
    let symbols = graph.symbols_of(&[node]);
    let inputs: Option<Vec<f64>> = symbols.iter().map(|s| values.get(s).copied()).collect();
    let tape = Tape::new(graph, &symbols, &[node]).ok()?;
    let mut out = [0.0];
    tape.evaluator().eval(&inputs?, &mut out);
    out[0].is_finite().then_some(out[0])
}
