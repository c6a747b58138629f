//! The plant under the disturbance that a study states.

use lynkeus_expr::Node;
use lynkeus_model::Plant;
use lynkeus_observers::Observer;
use lynkeus_run::Simulation;

use crate::prepare::systems::settings;
use crate::prepare::systems::{self, named};
use crate::words::explain;
use crate::{Error, Study};

/// A run with `disturbance` of `[tune]` on the plant's inputs; what the observer reads of them
/// stays as it was.
///
/// # Errors
/// Names that the plant does not have.
pub(super) fn disturbed(
    study: &Study,
    plant: &Plant,
    observer: &Observer,
    run: Simulation,
) -> Result<Simulation, Error> {
    let settings = settings(study)?;
    let graph = &plant.graph;
    let mut inputs = systems::input_expressions(study, plant, settings)?;
    let derivatives = observer
        .input_derivative_expressions(graph, &inputs)
        .map_err(explain)?;
    let mut signals: Vec<(String, Node)> = named(&plant.inputs);
    for (name, expression) in &study.tune.disturbance {
        let signal = signals.iter_mut().find(|(n, _)| *n == name.text);
        let input = inputs.iter().find(|(n, _)| *n == name.text);
        let (Some(signal), Some((_, input))) = (signal, input) else {
            return Err(name.blame(systems::unknown(plant, "input", &plant.inputs, name)));
        };
        let added = systems::expression(plant, expression)?;
        let sum = graph.expr(*input) + graph.expr(added);
        signal.0 = apart(&name.text);
        inputs.push((apart(&name.text), sum.node()));
    }
    inputs.extend(derivatives);
    Ok(Simulation {
        plant: systems::plant_reading(plant, settings, &signals)?,
        inputs: systems::of_time(plant, &inputs)?,
        ..run
    })
}

/// The name of an input as the plant has it while the observer reads the undisturbed one.
fn apart(name: &str) -> String {
    // no name in a model's text has a blank, unless it is in quotes
    format!("{name} disturbed")
}
