//! The plant of a study as a function of what is unknown.

use std::collections::{BTreeSet, HashMap};

use lynkeus_expr::{Expr, Node};
use lynkeus_model::{Home, Plant, Variable};
use lynkeus_observers::FilterTuning;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Likelihood, Limits, ParametricLevel, ParametricPlant,
    ParametricSensor,
};
use lynkeus_run::{Level, Manifold};
use lynkeus_structure::AugmentedPlant;

use super::unknown::{Kind, Unknown};
use crate::{Error, Study, near};
use lynkeus_experiment::course::filter::noise::drawn;
use lynkeus_experiment::prepare::{self, Prepared, manifold};
use lynkeus_experiment::words::explain;

/// The plant with the parameters that are found as symbols.
///
/// # Errors
/// As [`prepare::plant`].
pub(super) fn symbolic(study: &Study) -> Result<Plant, Error> {
    let all = prepare::symbolic_plant(study, BTreeSet::new())?;
    let is_found = |name: &str| study.fit.parameters.iter().any(|p| p.is_or_has(name));
    let names = all.parameters.iter().map(|p| &p.variable.name);
    let unknown_ones = |name: &str| study.sensors.unknown.iter().any(|u| u.is_or_has(name));
    let numbers = names.filter(|name| !is_found(name) && !unknown_ones(name));
    prepare::symbolic_plant(study, numbers.cloned().collect())
}

/// What a likelihood is made of.
#[derive(Clone, Copy)]
pub(super) struct Source<'s> {
    pub prepared: &'s Prepared<'s>,
    /// with the parameters that are found as symbols
    pub symbolic: &'s AugmentedPlant<'s>,
    pub tuning: &'s FilterTuning,
    /// the plant alone: it starts where it is said to, and nothing disturbs it
    pub is_alone: bool,
    /// sensors beside the study's
    pub further: &'s [Further],
}

/// A sensor that the study does not have.
#[derive(Clone, Copy, Debug)]
pub(super) struct Further {
    pub output: Node,
    pub level: Level,
    pub limits: Option<Limits>,
}

impl Source<'_> {
    /// The likelihood of a log whose states start here, as a function of the unknowns that it depends on, by their
    /// places.
    ///
    /// # Errors
    /// A noise that is 0, or that nobody states.
    pub fn likelihood(
        &self,
        unknowns: &[(usize, &Unknown)],
        starts: &[f64],
    ) -> Result<Likelihood, Error> {
        let Self {
            prepared,
            symbolic,
            tuning,
            is_alone,
            further,
        } = *self;
        let graph = symbolic.graph();
        let number = |value: f64| graph.constant(value).node();
        let symbols: Vec<Node> = (unknowns.iter())
            .map(|(_, unknown)| match unknown.kind {
                Kind::Parameter => parameter(symbolic.plant, &unknown.name),
                _ => graph.fresh(unknown.label()).node(),
            })
            .collect();
        let symbol = |kind: fn(&Kind) -> Option<usize>| -> HashMap<usize, Node> {
            let all = unknowns.iter().zip(&symbols);
            all.filter_map(|((_, unknown), symbol)| Some((kind(&unknown.kind)?, *symbol)))
                .collect()
        };
        let noises = symbol(|kind| match kind {
            Kind::Noise(place) => Some(*place),
            _ => None,
        });
        let densities = symbol(|kind| match kind {
            Kind::Density(place) => Some(*place),
            _ => None,
        });
        let begins = symbol(|kind| match kind {
            Kind::Start { state, .. } => Some(*state),
            _ => None,
        });
        let declared = prepared.declared();
        let initial = &prepared.study().observer.tuning.initial;
        // of a rotation, those of its vector
        let share = |state: &Variable| match state.home {
            Home::Rotation { .. } => 0.25,
            _ => 1.0,
        };
        let start = |(i, state): (usize, &Variable)| {
            if let Some(&symbol) = begins.get(&i) {
                return (symbol, number(0.0));
            }
            let given = initial.of(&state.name).or(initial.default);
            // a start of the model may depend on parameters
            let own = state.start_node.filter(|_| given.is_none());
            let deviation = match is_alone {
                true => 0.0,
                false => (share(state) * tuning.initial_variance[i]).sqrt(),
            };
            (own.unwrap_or(number(starts[i])), number(deviation))
        };
        let density = |(i, state): (usize, &Variable)| {
            let own = declared.process_noise.of(&state.name).copied();
            let first = match state.home {
                Home::Rotation { element } => i - element,
                _ => i,
            };
            match densities.get(&first) {
                _ if is_alone => number(0.0),
                Some(&symbol) if first == i && share(state) == 1.0 => symbol,
                Some(&symbol) => (graph.expr(symbol) * share(state)).node(),
                None => number(share(state) * own.unwrap_or(0.0)),
            }
        };
        let sensors = symbolic.outputs.iter().enumerate().map(|(i, output)| {
            let name = &output.variable.name;
            let level = declared.noise.of(name).map(|noise| Level::from(*noise));
            let named = named(prepared.study(), symbolic.plant, name)?;
            let size = match (noises.get(&i).copied().or(named), level) {
                (Some(size), _) => graph.expr(size),
                (None, Some(level)) if level.size() > 0.0 => graph.constant(level.size()),
                (None, _) => return Err(no_noise(prepared.study(), name)),
            };
            Ok(ParametricSensor {
                output: output.variable.node,
                noise: noise(level.filter(|_| named.is_none()), size),
                limits: declared.limits.of(name).copied(),
                is_dial: matches!(output.variable.home, Home::Circle { .. }),
            })
        });
        let further = further.iter().map(|sensor| {
            Ok(ParametricSensor {
                output: sensor.output,
                noise: noise(Some(sensor.level), graph.constant(sensor.level.size())),
                limits: sensor.limits,
                is_dial: false,
            })
        });
        let plant = ParametricPlant {
            graph,
            time: symbolic.plant.time,
            states: symbolic.states.iter().map(|state| state.node).collect(),
            derivatives: symbolic.derivatives.clone(),
            inputs: symbolic.inputs.iter().map(|input| input.node).collect(),
            sensors: sensors.chain(further).collect::<Result<_, Error>>()?,
            process_noise: symbolic.states.iter().enumerate().map(density).collect(),
            ranges: symbolic
                .states
                .iter()
                .map(|state| match state.home {
                    Home::Rotation { .. } => Limits {
                        low: f64::NEG_INFINITY,
                        high: f64::INFINITY,
                    },
                    _ => Limits {
                        low: state.min,
                        high: state.max,
                    },
                })
                .collect(),
            start: symbolic.states.iter().enumerate().map(start).collect(),
            drawn: 0,
            whens: symbolic.whens.clone(),
            parameters: symbols,
        };
        let named = |input: &Variable| (input.name.clone(), input.node);
        let inputs: Vec<(String, Node)> = symbolic.inputs.iter().map(named).collect();
        let drawn = drawn(declared, symbolic, &inputs).filter(|_| !is_alone);
        let plant = match &drawn {
            Some(drawn) => plant.drawing(drawn),
            None => plant,
        };
        let likelihood = compiled(&plant, manifold::of(symbolic), tuning, is_alone);
        likelihood.map_err(explain)
    }
}

/// The likelihood by straight-line code with tangents; along the filter itself where the states jump or a rotation is
/// among them, where corrections are iterated, and of an angle by sigma points.
fn compiled(
    plant: &ParametricPlant<'_>,
    manifold: Manifold,
    tuning: &FilterTuning,
    is_alone: bool,
) -> Result<Likelihood, lynkeus_run::Error> {
    let kind = match is_alone {
        true => FilterKind::Extended,
        false => tuning.kind.clone(),
    };
    let is_extended = kind == FilterKind::Extended;
    let iterations = match is_alone {
        true => 1,
        false => tuning.iterations,
    };
    let is_iterated = is_extended && iterations > 1;
    let is_smooth = plant.whens.is_empty() && manifold.rotations.is_empty();
    match kind {
        FilterKind::Extended if is_smooth && !is_iterated => Likelihood::new(plant),
        FilterKind::Unscented(points) if is_smooth && manifold.dials.is_empty() => {
            Likelihood::unscented(plant, points)
        }
        kind => {
            let settings = FilterSettings {
                iterations,
                ..FilterSettings::of(kind)
            };
            Likelihood::along(plant, &settings, manifold)
        }
    }
}

/// A noise of this size, of the kind that it is.
fn noise(level: Option<Level>, size: Expr<'_>) -> ParametricLevel {
    match level {
        Some(Level::Relative(_)) => ParametricLevel::Share(size.node()),
        Some(Level::Uniform(_)) => ParametricLevel::Variance((size.powi(2) / 3.0).node()),
        _ => ParametricLevel::Variance(size.powi(2).node()),
    }
}

/// The symbol of a parameter.
fn parameter(plant: &Plant, name: &str) -> Node {
    let mut all = plant.parameters.iter().map(|p| &p.variable);
    let own = all.find(|variable| variable.name == name);
    // one that no equation reads is a symbol of its own
    own.map_or_else(|| plant.graph.fresh(name).node(), |variable| variable.node)
}

/// The parameter or the variable whose value the standard deviation of a sensor's noise is.
///
/// # Errors
/// The model has neither.
pub(super) fn named(study: &Study, plant: &Plant, output: &str) -> Result<Option<Node>, Error> {
    let mut said = study.fit.deviations.iter();
    let Some((_, name)) = said.find(|(sensor, _)| sensor.is_or_has(output)) else {
        return Ok(None);
    };
    let is_found = study.fit.parameters.iter().any(|p| p.is_or_has(&name.text));
    let parameters = plant.parameters.iter();
    if let Some(own) = parameters.clone().find(|p| p.variable.name == name.text) {
        let number = own.value.filter(|_| !is_found);
        let number = number.map(|value| plant.graph.constant(value).node());
        return Ok(Some(number.unwrap_or(own.variable.node)));
    }
    let variables = plant.outputs.iter().chain(&plant.algebraics);
    if let Some(own) = variables.clone().find(|v| v.name == name.text) {
        return Ok(Some(own.node));
    }
    let known = variables.chain(parameters.map(|p| &p.variable));
    let known: Vec<&str> = known.map(|v| v.name.as_str()).collect();
    let message = format!(
        "`noise` of [fit]: no parameter or variable is called \"{}\"",
        name.text
    );
    let refusal = Error::input(message).at(&study.file);
    Err(name.blame(refusal.hint(near::suggest(&name.text, known))))
}

fn no_noise(study: &Study, name: &str) -> Error {
    let message =
        format!("the noise of {name} is 0, or nobody states it: no reading has a likelihood");
    Error::input(message).at(&study.file).hint(format!(
        "add noise = {{ {name} = … }} to [sensors], or let it be found: noise = [\"{name}\"] in [fit]"
    ))
}
