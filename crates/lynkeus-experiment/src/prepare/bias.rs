//! Constant offsets of sensors, estimated along: `bias` of `[sensors]`.

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_study::{Name, bias_of};

use crate::{Error, Study, near};

/// The plant with a state b' = 0 for each offset: an output shows h + b, and the plant feels u − b where an input
/// reads u.
///
/// # Errors
/// A name that is no output and no known input, a state that is called as the offset would be.
pub(super) fn added(study: &Study, mut plant: Plant) -> Result<Plant, Error> {
    for (name, _) in &study.sensors.bias {
        let refuse = |message: String, hint: &str| {
            let refusal = Error::input(format!("`bias` of [sensors]: {message}"));
            name.blame(refusal.at(&study.file).hint(hint))
        };
        let outputs = plant.outputs.iter().filter(|v| name.is_or_has(&v.name));
        let outputs: Vec<Variable> = outputs.cloned().collect();
        let inputs = plant.inputs.iter().filter(|v| name.is_or_has(&v.name));
        let inputs: Vec<Variable> = inputs.cloned().collect();
        let signals = if outputs.is_empty() {
            &inputs
        } else {
            &outputs
        };
        let Some(first) = signals.first() else {
            let known = plant.outputs.iter().chain(&plant.inputs);
            let hint = near::suggest(&name.text, known.map(|v| v.name.as_str()));
            return Err(refuse(
                format!("no output and no input is called \"{name}\""),
                &hint,
            ));
        };
        if outputs.is_empty() && is_unread(study, name) {
            return Err(refuse(
                format!("nobody reads the input {}", first.name),
                "an offset is one of a sensor: take it out of `bias`, or out of `unknown` and `disturbances`",
            ));
        }
        for signal in signals {
            let own = offset(&plant, signal);
            if plant.states.iter().any(|state| state.name == own.name) {
                let message = format!("the model has a state {} of its own", own.name);
                return Err(refuse(message, "rename it, or leave `bias` out"));
            }
            let offset = own.node;
            plant.states.push(own);
            plant.derivatives.push(plant.graph.constant(0.0).node());
            match outputs.is_empty() {
                true => take_from(&mut plant, signal.node, offset),
                false => add_to(&mut plant, &signal.name, offset),
            }
        }
    }
    Ok(plant)
}

/// Whether an input is estimated, or taken as zero.
fn is_unread(study: &Study, input: &Name) -> bool {
    let sensors = &study.sensors;
    let mut others = sensors.unknown.iter().chain(&sensors.disturbances);
    others.any(|other| other.is_or_has(&input.text) || input.is_or_has(&other.text))
}

fn offset(plant: &Plant, signal: &Variable) -> Variable {
    let name = bias_of(&signal.name);
    Variable {
        node: plant.graph.fresh(name.as_str()).node(),
        unit: signal.unit.clone(),
        description: Some(format!("offset of {}", signal.name)),
        start: Some(0.0),
        start_node: None,
        min: f64::NEG_INFINITY,
        max: f64::INFINITY,
        nominal: None,
        integer: false,
        discrete: false,
        fixed: false,
        home: Home::Line,
        name,
    }
}

fn add_to(plant: &mut Plant, output: &str, offset: Node) {
    let graph = &plant.graph;
    for variable in plant.outputs.iter_mut().filter(|v| v.name == output) {
        variable.node = (graph.expr(variable.node) + graph.expr(offset)).node();
    }
}

fn take_from(plant: &mut Plant, input: Node, offset: Node) {
    let graph = &plant.graph;
    let felt = (graph.expr(input) - graph.expr(offset)).node();
    let felt = HashMap::from([(input, felt)]);
    plant.derivatives = graph.substitute(&plant.derivatives, &felt);
    plant.whens = plant.whens.substituted(graph, &felt);
    for variable in plant.outputs.iter_mut().chain(&mut plant.algebraics) {
        variable.node = graph.substitute(&[variable.node], &felt)[0];
    }
    for assertion in &mut plant.assertions {
        assertion.condition = graph.substitute(&[assertion.condition], &felt)[0];
    }
}
