//! Unknown parameters: estimated as constants, that is as states that do not move.

use std::collections::HashMap;

use lynkeus_expr::Node;
use lynkeus_model::{Plant, Variable};

use crate::{Error, Study};
use lynkeus_study::Name;

/// Whether the study lists parameters of the plant among what is unknown.
pub(crate) fn are_asked(study: &Study, plant: &Plant) -> bool {
    study
        .sensors
        .unknown
        .iter()
        .any(|name| !is_input(plant, name) && is_parameter(plant, name))
}

fn is_input(plant: &Plant, name: &Name) -> bool {
    plant.inputs.iter().any(|input| name.is_or_has(&input.name))
}

fn is_parameter(plant: &Plant, name: &Name) -> bool {
    plant
        .parameters
        .iter()
        .any(|p| name.is_or_has(&p.variable.name))
}

/// The plant with its unknown parameters as states p' = 0 that start at the value of the model;
/// `plant` has its parameters as symbols. Where `valued`, all others take their values.
///
/// # Errors
/// A parameter without value.
pub(crate) fn as_states(study: &Study, mut plant: Plant, valued: bool) -> Result<Plant, Error> {
    let asked = |variable: &Variable| {
        let mut names = study
            .sensors
            .unknown
            .iter()
            .filter(|name| !is_input(&plant, name));
        names.any(|name| name.is_or_has(&variable.name))
    };
    let (unknown, known): (Vec<_>, Vec<_>) = plant
        .parameters
        .iter()
        .cloned()
        .partition(|p| asked(&p.variable));
    if valued {
        let mut values: HashMap<Node, Node> = HashMap::new();
        for parameter in &known {
            let Some(value) = parameter.value else {
                let message = format!("the parameter \"{}\" has no value", parameter.variable.name);
                return Err(Error::input(message)
                    .at(&study.file)
                    .hint("give it one under [parameters]"));
            };
            values.insert(parameter.variable.node, plant.graph.constant(value).node());
        }
        plant.derivatives = plant.graph.substitute(&plant.derivatives, &values);
        plant.whens = plant.whens.substituted(&plant.graph, &values);
        for variable in plant.outputs.iter_mut().chain(&mut plant.algebraics) {
            variable.node = plant.graph.substitute(&[variable.node], &values)[0];
        }
        for assertion in &mut plant.assertions {
            assertion.condition = plant.graph.substitute(&[assertion.condition], &values)[0];
        }
    }
    plant.parameters = known;
    for parameter in unknown {
        plant.states.push(Variable {
            start: parameter.value,
            start_node: None,
            ..parameter.variable
        });
        plant.derivatives.push(plant.graph.constant(0.0).node());
    }
    Ok(plant)
}

/// The plant with these inputs as states that do not move.
pub fn constant_inputs(mut plant: Plant, names: &[String]) -> Plant {
    let (constant, inputs): (Vec<_>, Vec<_>) = plant
        .inputs
        .drain(..)
        .partition(|input| names.contains(&input.name));
    plant.inputs = inputs;
    for input in constant {
        plant.states.push(Variable {
            fixed: false,
            ..input
        });
        plant.derivatives.push(plant.graph.constant(0.0).node());
    }
    plant
}

/// The names of `unknown` that are inputs, arrays element by element; a name that is neither an
/// input nor a parameter stays, for the message about it.
pub(crate) fn unknown_inputs(study: &Study, plant: &Plant) -> Vec<String> {
    let mut found = vec![];
    for name in &study.sensors.unknown {
        let inputs = plant
            .inputs
            .iter()
            .filter(|input| name.is_or_has(&input.name));
        let inputs: Vec<String> = inputs.map(|input| input.name.clone()).collect();
        let is_constant = plant.states.iter().any(|state| name.is_or_has(&state.name));
        match (inputs.is_empty(), is_constant) {
            (true, true) => {}
            (true, false) => found.push(name.text.clone()),
            (false, _) => found.extend(inputs),
        }
    }
    found
}
