//! The box, the unknown influences and the measurement errors of a guarantee.

use lynkeus_expr::{Node, jacobian};
use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Assumptions;
use lynkeus_structure::{Dimension, Extended, Matrix, Measurement, Region, range};

use crate::study::{Name, Noise};
use crate::{Error, Study};

/// Gaussian measurement errors are taken to stay within this many standard deviations.
const DEVIATIONS: f64 = 3.0;

/// What the guarantee takes for granted.
pub(super) fn of(
    study: &Study,
    plant: &Plant,
    extended: &Extended<'_>,
) -> Result<Assumptions, Error> {
    let region = extended.region();
    Ok(Assumptions {
        drift: drift(study, plant, extended, &region)?,
        noise: noise(study, plant, extended, &region)?,
        region,
    })
}

/// Per extended state: what disturbances within their declared ranges add to its
/// derivative; for an unknown input the bound of its rate of change.
fn drift(
    study: &Study,
    plant: &Plant,
    extended: &Extended<'_>,
    region: &Region,
) -> Result<Vec<f64>, Error> {
    let unknown = &extended.states[extended.plant_states()..];
    if let Some((name, _)) = slew_of_no_unknown(study, unknown) {
        let names: Vec<&str> = unknown.iter().map(|u| u.name.as_str()).collect();
        let message = format!(
            "no unknown input is called '{name}'; `slew` bounds the rates of change of {}",
            names.join(", ")
        );
        return Err(name.blame(Error::input(message)));
    }
    let wider = with_disturbances(study, plant, region);
    let mut drift = vec![];
    for (&actual, &assumed) in plant.derivatives.iter().zip(&extended.derivatives) {
        drift.push(largest_difference(plant, actual, assumed, &wider)?);
    }
    for input in unknown {
        let given = study
            .certify
            .slew
            .iter()
            .find(|(name, _)| name.text == input.name);
        drift.push(given.map_or(0.0, |(_, bound)| *bound));
    }
    Ok(drift)
}

fn slew_of_no_unknown<'s>(study: &'s Study, unknown: &[Variable]) -> Option<&'s (Name, f64)> {
    let is_unknown = |name: &Name| unknown.iter().any(|u| u.name == name.text);
    study
        .certify
        .slew
        .iter()
        .find(|(name, _)| !is_unknown(name))
}

/// The box with the declared ranges of the disturbances.
fn with_disturbances(study: &Study, plant: &Plant, region: &Region) -> Region {
    let mut wider = region.clone();
    for name in &study.sensors.disturbances {
        let Some(input) = plant.inputs.iter().find(|i| i.name == name.text) else {
            continue;
        };
        wider.dimensions.push(Dimension {
            name: input.name.clone(),
            symbol: input.node,
            min: input.min,
            max: input.max,
            integer: input.integer,
        });
    }
    wider
}

fn largest(plant: &Plant, node: Node, region: &Region) -> Result<f64, Error> {
    let values = range(&plant.graph, node, region);
    let values = values.map_err(|error| Error::input(error.to_string()))?;
    Ok(values.enclosure.magnitude())
}

fn largest_difference(
    plant: &Plant,
    actual: Node,
    assumed: Node,
    region: &Region,
) -> Result<f64, Error> {
    if actual == assumed {
        return Ok(0.0);
    }
    let graph = &plant.graph;
    let difference = graph.expr(actual) - graph.expr(assumed);
    // what is linear in the inputs: its range has none of the states that cancel
    let inputs: Vec<Node> = plant.inputs.iter().map(|i| i.node).collect();
    let slopes = jacobian::forward(graph, &[difference.node()], &inputs);
    let zero = graph.constant(0.0);
    let linear = slopes
        .row(0)
        .map(|(i, slope)| graph.expr(slope) * graph.expr(inputs[i]))
        .fold(zero, |sum, term| sum + term);
    let rest = (difference - linear).node();
    let same = Matrix::from_fn(graph, (1, 1), |_, _| Some(rest));
    match same.get(0, 0) {
        None => largest(plant, linear.node(), region),
        Some(_) => largest(plant, difference.node(), region),
    }
}

/// Per measured output: the bound of a uniform noise, three standard deviations of a
/// Gaussian one, and what disturbances that stand in the output add to it.
fn noise(
    study: &Study,
    plant: &Plant,
    extended: &Extended<'_>,
    region: &Region,
) -> Result<Vec<f64>, Error> {
    let wider = with_disturbances(study, plant, region);
    let of = |output: &Measurement| {
        let (name, assumed) = (&output.variable.name, output.variable.node);
        let declared = plant.outputs.iter().find(|o| o.name == *name);
        let actual = declared.map_or(assumed, |o| o.node);
        let given = study.sensors.noise.iter().find(|(of, _)| of.text == *name);
        // a share of nothing is nothing, of an unbounded output too
        let noise = match given.map(|(_, n)| *n).filter(|n| n.size() > 0.0) {
            None => 0.0,
            Some(Noise::Absolute(deviation)) => DEVIATIONS * deviation,
            Some(Noise::Uniform(bound)) => bound,
            Some(Noise::Relative(share)) => DEVIATIONS * share * largest(plant, actual, &wider)?,
        };
        let disturbance = largest_difference(plant, actual, assumed, &wider)?;
        Ok(match noise == 0.0 {
            true => disturbance,
            false => (noise + disturbance).next_up(),
        })
    };
    extended.outputs.iter().map(of).collect()
}
