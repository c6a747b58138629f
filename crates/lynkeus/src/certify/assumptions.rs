//! The box, the unknown influences and the measurement errors of a guarantee.

use lynkeus_expr::{Graph, Interval, Node, jacobian};
use lynkeus_model::{Plant, Variable};
use lynkeus_observers::Assumptions;
use lynkeus_structure::{Dimension, Extended, Matrix, Region, range};

use crate::study::{Name, Noise};
use crate::{Error, Study, filter};

/// Gaussian measurement errors are taken to stay within this many standard deviations.
const DEVIATIONS: f64 = 3.0;

/// What the guarantee takes for granted.
pub(super) fn of(study: &Study, extended: &Extended<'_>) -> Result<Assumptions, Error> {
    let (plant, region) = (extended.plant, extended.region());
    let drift = drift(study, plant, extended, &region)?;
    let noise = noise(study, plant, extended, &region)?;
    let assumptions = Assumptions::new(extended, region).map_err(Error::from_source)?;
    let limits = filter::limits(study, extended)?.into_iter();
    let limits = limits.map(|limits| Interval::new(limits?.low, limits?.high).ok());
    let limits: Vec<Option<Interval>> = limits.collect();
    assumptions
        .with_drift(drift)
        .with_noise(noise)
        .with_input_derivatives(input_derivatives(study, extended)?)
        .with_limits(extended, &limits)
        .map_err(Error::from_source)
}

/// Per known input: the bounds of its derivatives that the study gives.
fn input_derivatives(study: &Study, extended: &Extended<'_>) -> Result<Vec<Vec<f64>>, Error> {
    let names: Vec<&str> = extended.inputs.iter().map(|i| i.name.as_str()).collect();
    let given = &study.certify.input_derivatives;
    if let Some((name, _)) = given
        .iter()
        .find(|(n, _)| !names.contains(&n.text.as_str()))
    {
        let known = match names.is_empty() {
            true => "none".to_owned(),
            false => names.join(", "),
        };
        let message = format!(
            "no known input is called '{name}'; `input_derivatives` bounds the derivatives of the known inputs ({known})"
        );
        return Err(name.blame(Error::input(message)));
    }
    let of = |input: &&str| {
        let found = given.iter().find(|(name, _)| name.text == **input);
        found.map_or_else(Vec::new, |(_, bounds)| bounds.clone())
    };
    Ok(names.iter().map(of).collect())
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
    let wider = disturbed(study, plant, region);
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
fn disturbed(study: &Study, plant: &Plant, region: &Region) -> Region {
    let mut wider = region.clone();
    for input in disturbances(study, plant) {
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

fn disturbances<'p>(study: &Study, plant: &'p Plant) -> Vec<&'p Variable> {
    let named = |name: &Name| plant.inputs.iter().find(|i| i.name == name.text);
    study
        .sensors
        .disturbances
        .iter()
        .filter_map(named)
        .collect()
}

/// The largest absolute value; infinite where the expression has none somewhere.
fn magnitude(graph: &Graph, node: Node, region: &Region) -> Result<f64, Error> {
    let found = range(graph, node, region).map_err(Error::from_source)?;
    Ok(found.enclosure.magnitude())
}

/// The largest |actual − assumed|; what is linear in the inputs without the states that
/// cancel, so that an output without range has one.
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
    let inputs: Vec<Node> = plant.inputs.iter().map(|i| i.node).collect();
    let slopes = jacobian::forward(graph, &[difference.node()], &inputs);
    let zero = graph.constant(0.0);
    let linear = slopes
        .row(0)
        .map(|(i, slope)| graph.expr(slope) * graph.expr(inputs[i]))
        .fold(zero, |sum, term| sum + term);
    let rest = (difference - linear).node();
    let same = Matrix::from_fn(graph, (1, 1), |_, _| Some(rest));
    let equal = same.get(0, 0).is_none();
    let tightest = if equal { linear } else { difference };
    magnitude(graph, tightest.node(), region)
}

/// Per measured output: how far what is measured may be from h(x, u) without disturbances.
/// That is what these add to h, and the bound of a uniform noise or three standard
/// deviations of a Gaussian one, of which a relative one counts from the disturbed value.
fn noise(
    study: &Study,
    plant: &Plant,
    extended: &Extended<'_>,
    region: &Region,
) -> Result<Vec<f64>, Error> {
    let graph = &plant.graph;
    let wider = disturbed(study, plant, region);
    let of = |output: &Variable| {
        let declared = plant.outputs.iter().find(|o| o.name == output.name);
        let actual = declared.map_or(output.node, |o| o.node);
        let added = largest_difference(plant, actual, output.node, &wider)?;
        let mut given = study.sensors.noise.iter();
        let given = given.find(|(name, _)| name.text == output.name);
        let deviations = Interval::point(DEVIATIONS);
        // a share of nothing is nothing, of an unbounded output too
        let error = match given.map(|(_, n)| *n).filter(|n| n.size() > 0.0) {
            None => Interval::ZERO,
            Some(Noise::Absolute(deviation)) => deviations * Interval::point(deviation),
            Some(Noise::Uniform(bound)) => Interval::point(bound),
            Some(Noise::Relative(share)) => {
                let size = Interval::point(magnitude(graph, actual, &wider)?);
                deviations * Interval::point(share) * size
            }
        };
        Ok((error + Interval::point(added)).hi())
    };
    extended.outputs.iter().map(|o| of(&o.variable)).collect()
}

/// What a reader of the guarantee has to know about what acts unknown to the observer.
pub(super) fn notes(study: &Study, plant: &Plant, extended: &Extended<'_>) -> Vec<String> {
    let mut notes = vec![];
    let unbounded = disturbances(study, plant).into_iter();
    let unbounded = unbounded.filter(|d| !(d.min.is_finite() && d.max.is_finite()));
    let unbounded: Vec<&str> = unbounded.map(|d| d.name.as_str()).collect();
    if !unbounded.is_empty() {
        notes.push(format!(
            "no bound covers what {} does to the error: it decays at the rate only up to what that leaves; declare min and max",
            unbounded.join(", ")
        ));
    }
    let unknown = &extended.states[extended.plant_states()..];
    let given = |v: &&Variable| {
        study
            .certify
            .slew
            .iter()
            .any(|(name, _)| name.text == v.name)
    };
    let (bounded, constant): (Vec<&Variable>, Vec<&Variable>) = unknown.iter().partition(given);
    let names = |variables: &[&Variable]| {
        let names: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
        names.join(", ")
    };
    if !constant.is_empty() {
        notes.push(format!(
            "{} is taken as constant: `slew` in [certify] bounds how fast an unknown input changes",
            names(&constant)
        ));
    }
    if !bounded.is_empty() {
        notes.push(format!(
            "{} changes no faster than `slew` says",
            names(&bounded)
        ));
    }
    let open = unknown
        .iter()
        .filter(|v| !(v.min.is_finite() && v.max.is_finite()));
    let open: Vec<&str> = open.map(|v| v.name.as_str()).collect();
    if !open.is_empty() {
        notes.push(format!(
            "the unknown input {} has no declared range: the box does not bound it; declare min and max",
            open.join(", ")
        ));
    }
    notes
}
