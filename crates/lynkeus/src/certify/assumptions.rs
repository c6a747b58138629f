//! The box, the unknown influences and the measurement errors of a guarantee.

use lynkeus_expr::{Graph, Interval, Node, jacobian};
use lynkeus_model::{Plant, Variable};
use lynkeus_observers::{Assumptions, ReadingError};
use lynkeus_structure::{AugmentedPlant, Dimension, Matrix, Region, range};

use crate::Error;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::prepare::declared::Declared;
use lynkeus_experiment::words::explain;
use lynkeus_study::Noise;

/// What the guarantee takes for granted: all that the study declares, on the box of `augmented`.
pub(super) fn of(
    prepared: &Prepared<'_>,
    augmented: &AugmentedPlant<'_>,
) -> Result<Assumptions, Error> {
    let (declared, plant, region) = (prepared.declared(), augmented.plant, augmented.region());
    let drift = drift(declared, plant, augmented, &region)?;
    let readings = errors(declared, plant, augmented, &region)?;
    let assumptions = Assumptions::new(augmented, region).map_err(explain)?;
    let shown = |name: &str| {
        let limits = declared.limits.of(name)?;
        Interval::new(limits.low, limits.high).ok()
    };
    let limits: Vec<Option<Interval>> = augmented
        .outputs
        .iter()
        .map(|o| shown(&o.variable.name))
        .collect();
    let density = |state: &Variable| {
        declared
            .process_noise
            .of(&state.name)
            .copied()
            .unwrap_or(0.0)
    };
    let derivatives = |input: &Variable| {
        declared
            .input_derivatives
            .of(&input.name)
            .cloned()
            .unwrap_or_default()
    };
    assumptions
        .with_drift(drift)
        .with_readings(readings)
        .with_process_noise(augmented.states.iter().map(density).collect())
        .with_input_derivatives(augmented.inputs.iter().map(derivatives).collect())
        .with_limits(augmented, &limits)
        .map_err(explain)
}

/// Per augmented state: what disturbances within their declared ranges add to its
/// derivative; for an unknown input the bound of its rate of change.
fn drift(
    declared: &Declared,
    plant: &Plant,
    augmented: &AugmentedPlant<'_>,
    region: &Region,
) -> Result<Vec<f64>, Error> {
    let wider = disturbed(declared, plant, region);
    let mut drift = vec![];
    for (&actual, &assumed) in plant.derivatives.iter().zip(&augmented.derivatives) {
        drift.push(largest_difference(plant, actual, assumed, &wider)?);
    }
    let unknown = &augmented.states[augmented.plant_states()..];
    drift.extend(
        unknown
            .iter()
            .map(|v| declared.slew.of(&v.name).copied().unwrap_or(0.0)),
    );
    Ok(drift)
}

/// The box with the declared ranges of the disturbances.
fn disturbed(declared: &Declared, plant: &Plant, region: &Region) -> Region {
    let mut wider = region.clone();
    for input in disturbances(declared, plant) {
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

fn disturbances<'p>(declared: &Declared, plant: &'p Plant) -> impl Iterator<Item = &'p Variable> {
    let inputs = plant.inputs.iter();
    inputs.filter(|input| declared.disturbances.of(&input.name).is_some())
}

/// The largest absolute value; infinite where the expression has none somewhere.
fn magnitude(graph: &Graph, node: Node, region: &Region) -> Result<f64, Error> {
    let found = range(graph, node, region).map_err(explain)?;
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
/// That is what these add to h, and the noise, of which a relative one counts from the disturbed value.
fn errors(
    declared: &Declared,
    plant: &Plant,
    augmented: &AugmentedPlant<'_>,
    region: &Region,
) -> Result<Vec<ReadingError>, Error> {
    let graph = &plant.graph;
    let wider = disturbed(declared, plant, region);
    let of = |output: &Variable| {
        let own = plant.outputs.iter().find(|o| o.name == output.name);
        let actual = own.map_or(output.node, |o| o.node);
        let disturbed = largest_difference(plant, actual, output.node, &wider)?;
        let given = declared.noise.of(&output.name).copied();
        // a share of nothing is nothing, of an unbounded output too
        let (uniform, deviation) = match given.filter(|noise| noise.size() > 0.0) {
            None => (0.0, 0.0),
            Some(Noise::Absolute(deviation)) => (0.0, deviation),
            Some(Noise::Uniform(bound)) => (bound, 0.0),
            Some(Noise::Relative(share)) => {
                let size = Interval::point(magnitude(graph, actual, &wider)?);
                (0.0, (Interval::point(share) * size).hi())
            }
        };
        Ok(ReadingError {
            disturbed,
            uniform,
            deviation,
        })
    };
    augmented.outputs.iter().map(|o| of(&o.variable)).collect()
}

/// What a reader of the guarantee has to know about what acts unknown to the observer.
pub(super) fn notes(prepared: &Prepared<'_>, augmented: &AugmentedPlant<'_>) -> Vec<String> {
    let declared = prepared.declared();
    let is_open = |v: &Variable| !(v.min.is_finite() && v.max.is_finite());
    let names = |variables: Vec<&Variable>| {
        let names: Vec<&str> = variables.into_iter().map(|v| v.name.as_str()).collect();
        (!names.is_empty()).then(|| names.join(", "))
    };
    let unknown = || augmented.states[augmented.plant_states()..].iter();
    let is_slow = |v: &Variable| declared.slew.of(&v.name).is_some();
    let wanders = |v: &Variable| declared.process_noise.of(&v.name).is_some_and(|q| *q > 0.0);
    let is_gaussian = |v: &Variable| match declared.noise.of(&v.name) {
        Some(Noise::Absolute(size) | Noise::Relative(size)) => *size > 0.0,
        Some(Noise::Uniform(_)) | None => false,
    };
    let outputs = augmented.outputs.iter().map(|o| &o.variable);
    let said = [
        names(outputs.filter(|v| is_gaussian(v)).collect()).map(|names| format!(
            "the noise of {names} is Gaussian: its readings are taken to lie within {} standard deviations, as 99.7 % of them do",
            ReadingError::DEVIATIONS
        )),
        names(disturbances(declared, augmented.plant).filter(|d| is_open(d)).collect()).map(|names| format!(
            "no bound covers what {names} does to the error: it decays at the rate only up to what that leaves; declare min and max"
        )),
        names(unknown().filter(|v| !is_slow(v) && !wanders(v)).collect()).map(|names| format!(
            "{names} is taken as constant: `slew` in [certify] bounds how fast an unknown input changes"
        )),
        names(unknown().filter(|v| is_slow(v)).collect())
            .map(|names| format!("{names} changes no faster than `slew` says")),
        names(unknown().filter(|v| wanders(v)).collect())
            .map(|names| format!("{names} wanders as [process_noise] says")),
        names(unknown().filter(|v| is_open(v)).collect()).map(|names| format!(
            "the unknown input {names} has no declared range: the box does not bound it; declare min and max"
        )),
    ];
    said.into_iter().flatten().collect()
}
