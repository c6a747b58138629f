//! The box, the unknown influences and the measurement errors of a guarantee.

use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Assumptions;
use lynkeus_structure::{Dimension, Extended, Region, range};

use crate::study::{Name, Noise};
use crate::{Error, Study};

/// Measurement errors are taken to stay within this many standard deviations.
const DEVIATIONS: f64 = 3.0;

/// What the guarantee takes for granted.
pub(super) fn of(study: &Study, extended: &Extended<'_>) -> Result<Assumptions, Error> {
    let (plant, region) = (extended.plant, extended.region());
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
    let graph = &plant.graph;
    let mut drift = vec![];
    for (&actual, &assumed) in plant.derivatives.iter().zip(&extended.derivatives) {
        let difference = graph.expr(actual) - graph.expr(assumed);
        drift.push(match actual == assumed {
            true => 0.0,
            false => range(graph, difference.node(), &wider)
                .map_err(Error::from_source)?
                .enclosure
                .magnitude(),
        });
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

/// Per measured output: three standard deviations.
fn noise(
    study: &Study,
    plant: &Plant,
    extended: &Extended<'_>,
    region: &Region,
) -> Result<Vec<f64>, Error> {
    let of = |output: &Variable| {
        let given = study
            .sensors
            .noise
            .iter()
            .find(|(name, _)| name.text == output.name);
        Ok(match given {
            None => 0.0,
            Some((_, Noise::Absolute(deviation))) => DEVIATIONS * deviation,
            Some((_, Noise::Relative(share))) => {
                let values =
                    range(&plant.graph, output.node, region).map_err(Error::from_source)?;
                DEVIATIONS * share * values.enclosure.magnitude()
            }
        })
    };
    extended.outputs.iter().map(|o| of(&o.variable)).collect()
}
