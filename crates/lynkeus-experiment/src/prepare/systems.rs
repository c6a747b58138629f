//! Plants, inputs and observers as systems that can be run.

use lynkeus_expr::Node;
use lynkeus_model::{Plant, Variable, parse_expression};
use lynkeus_observers::{Monitor, Observer, Signal};
use lynkeus_run::{
    Column, EstimatorSettings, Margin, Method, Parts, Role, Step, System, Tolerances,
};

use crate::prepare::manifold;
use crate::words::explain;
use crate::{Error, Study};
use lynkeus_study::{
    self, BetweenSamples, EstimateSettings, Expression, Name, Rk4Step, SimulateSettings, Solver,
};

/// The study's `[simulate]`.
pub fn settings(study: &Study) -> Result<&SimulateSettings, Error> {
    study.simulate.as_ref().ok_or_else(|| {
        Error::input("the study has no [simulate] section")
            .at(&study.file)
            .hint("add [simulate] with `until` and `inputs`")
    })
}

/// The time between two samples of the simulation where the study says that it is sampled: its
/// sensors have noise, which is drawn anew with each, or there is a `sample_step`.
pub fn sampled_every(study: &Study, settings: &SimulateSettings) -> Option<f64> {
    let mut all = study.sensors.noise.iter().chain(&study.sensors.input_noise);
    let is_noisy = all.any(|(_, n)| n.size() > 0.0);
    let drawn = is_noisy.then(|| settings.row_step());
    settings.sample_step.or(drawn)
}

/// What the column of an estimate is called, where the model has not that name itself.
pub fn hat(name: &str) -> String {
    format!("{name}_hat")
}

/// The column of a run that holds a state, an input or an output of the plant, by its node.
pub fn column_of(plant: &Plant, variable: &Variable) -> Option<Column> {
    let among = |variables: &[Variable], role: Role| {
        let place = variables.iter().position(|v| v.node == variable.node);
        place.map(|place| role.at(place))
    };
    among(&plant.states, Role::State)
        .or_else(|| among(&plant.inputs, Role::Input))
        .or_else(|| among(&plant.outputs, Role::Output))
}

/// The place among the plant's outputs of the one that a signal measures.
pub(crate) fn output_of(plant: &Plant, signal: &Signal) -> Option<usize> {
    plant.outputs.iter().position(|o| o.name == signal.name)
}

/// The column of a run that holds a monitor of an observer, by its place among them: they are
/// reported after the estimates.
pub(crate) fn monitor_column(observer: &Observer, place: usize) -> Column {
    Role::Estimate.at(observer.estimates.len() + place)
}

/// An observer as a system that can be run: its signals are the measured outputs,
/// then the known inputs, by name; its outputs are the estimates (`<name>_hat`),
/// then its monitors.
///
/// # Errors
/// The observer's expressions read a symbol that it does not list.
pub fn observer(plant: &Plant, observer: &Observer) -> Result<System, Error> {
    let states: Vec<(String, Node, f64)> = observer
        .states
        .iter()
        .map(|(signal, start)| (signal.name.clone(), signal.symbol, *start))
        .collect();
    let read = observer.measured.iter().chain(&observer.inputs);
    let derivatives = observer.input_derivatives.iter().map(|d| &d.signal);
    let signals: Vec<(String, Node)> = read
        .chain(derivatives)
        .map(|signal| (signal.name.clone(), signal.symbol))
        .collect();
    let estimates = observer
        .estimates
        .iter()
        .map(|e| (hat(&e.variable.name), e.node));
    let monitors = observer.monitors.iter().map(|m| (m.name.clone(), m.node));
    let outputs: Vec<(String, Node)> = estimates.chain(monitors).collect();
    System::new(
        &plant.graph,
        observer.time,
        &states,
        &signals,
        &observer.derivatives,
        &outputs,
    )
    .map(|system| system.with_margins(margins(observer)))
    .map_err(explain)
}

/// The monitors of an observer that say how far a matrix is from singular.
pub(crate) fn margins(observer: &Observer) -> Vec<Margin> {
    let monitors = observer.monitors.iter().enumerate();
    let margin = |(i, monitor): (usize, &Monitor)| {
        let matrix = monitor.matrix?;
        Some(Margin {
            output: observer.estimates.len() + i,
            name: monitor.name.clone(),
            matrix: matrix.to_owned(),
            below: monitor.alarm_below,
            meaning: format!(
                "the outputs and their derivatives hardly tell the states apart there, so the correction {matrix}⁻¹K(y − ŷ) has no bound; start the estimate nearer to the plant (`initial`), take slower poles, another `variant` or other inputs, or fixed steps (method = \"rk4\"), which pass such a place with the flag raised"
            ),
        })
    };
    monitors.filter_map(margin).collect()
}

/// The plant with the study's start values; its outputs are those of the model.
pub(crate) fn plant(plant: &Plant, settings: &SimulateSettings) -> Result<System, Error> {
    plant_reading(plant, settings, &named(&plant.inputs))
}

/// As [`plant`], with its inputs under these names.
pub(crate) fn plant_reading(
    plant: &Plant,
    settings: &SimulateSettings,
    signals: &[(String, Node)],
) -> Result<System, Error> {
    let starts = starts(plant, &settings.initial)?;
    let states: Vec<(String, Node, f64)> = plant
        .states
        .iter()
        .zip(starts)
        .map(|(s, start)| (s.name.clone(), s.node, start))
        .collect();
    System::of(&Parts {
        graph: &plant.graph,
        time: plant.time,
        states: &states,
        signals,
        derivatives: &plant.derivatives,
        outputs: &named(&plant.outputs),
        whens: Some(&plant.whens),
    })
    .map_err(explain)
}

/// Where the plant's states start.
///
/// # Errors
/// A name that is no state.
pub fn starts(plant: &Plant, given: &[(Name, f64)]) -> Result<Vec<f64>, Error> {
    for (name, _) in given {
        if !plant.states.iter().any(|s| name.is_or_has(&s.name)) {
            return Err(name.blame(unknown(plant, "state", &plant.states, name)));
        }
    }
    let start = |variable: &Variable| {
        let given = Name::best(given, &variable.name);
        // Modelica's own default
        given.copied().or(variable.start).unwrap_or(0.0)
    };
    let mut starts: Vec<f64> = plant.states.iter().map(start).collect();
    manifold::started(&plant.states, &mut starts, "simulation")?;
    Ok(starts)
}

/// Variables with the nodes that stand for them.
pub(crate) fn named(variables: &[Variable]) -> Vec<(String, Node)> {
    variables.iter().map(|v| (v.name.clone(), v.node)).collect()
}

/// The refusal of a name that no variable of a kind has.
pub(crate) fn unknown(plant: &Plant, kind: &str, variables: &[Variable], name: &Name) -> Error {
    let names = variables.iter().map(|v| v.name.as_str());
    let message = format!("the plant '{}' has no {kind} named \"{name}\"", plant.name);
    Error::input(message).hint(crate::near::suggest(&name.text, names))
}

/// The plant's inputs as expressions of time, and the derivatives that the
/// observer reads.
pub(crate) fn inputs(
    study: &Study,
    plant: &Plant,
    settings: &SimulateSettings,
    observer: &Observer,
) -> Result<System, Error> {
    let mut outputs = input_expressions(study, plant, settings)?;
    let derivatives = observer
        .input_derivative_expressions(&plant.graph, &outputs)
        .map_err(explain)?;
    outputs.extend(derivatives);
    of_time(plant, &outputs)
}

/// Expressions of time as a system.
pub(crate) fn of_time(plant: &Plant, outputs: &[(String, Node)]) -> Result<System, Error> {
    System::new(&plant.graph, plant.time, &[], &[], &[], outputs).map_err(explain)
}

/// Looks through `inputs` of `[simulate]`, where not every input needs a value.
///
/// # Errors
/// A name that is no input, or an expression that is none.
pub(crate) fn check_inputs(plant: &Plant, settings: &SimulateSettings) -> Result<(), Error> {
    check_names(plant, settings)?;
    let mut given = settings.inputs.iter();
    given.try_for_each(|(_, given)| expression(plant, given).map(drop))
}

fn check_names(plant: &Plant, settings: &SimulateSettings) -> Result<(), Error> {
    for (name, _) in &settings.inputs {
        if !plant.inputs.iter().any(|i| name.is_or_has(&i.name)) {
            return Err(name.blame(unknown(plant, "input", &plant.inputs, name)));
        }
    }
    Ok(())
}

/// The plant's inputs by name.
pub fn input_expressions(
    study: &Study,
    plant: &Plant,
    settings: &SimulateSettings,
) -> Result<Vec<(String, Node)>, Error> {
    check_names(plant, settings)?;
    plant
        .inputs
        .iter()
        .map(|input| {
            Ok((
                input.name.clone(),
                input_expression(study, plant, settings, input)?,
            ))
        })
        .collect()
}

/// An expression of time as it is written in a study.
pub fn expression(plant: &Plant, expression: &Expression) -> Result<Node, Error> {
    let source = &expression.source;
    let names = |name: &str| (name == "time").then_some(plant.time);
    parse_expression(&source.text, &plant.graph, &names)
        .map_err(|error| source.blame(Error::input(error.one_line())))
}

/// The study's expression, else the input's start value; a disturbance is zero
/// unless it is given.
pub fn input_expression(
    study: &Study,
    plant: &Plant,
    settings: &SimulateSettings,
    input: &Variable,
) -> Result<Node, Error> {
    let graph = &plant.graph;
    if let Some(given) = Name::best(&settings.inputs, &input.name) {
        return expression(plant, given);
    }
    let disturbance = study
        .sensors
        .disturbances
        .iter()
        .any(|d| d.is_or_has(&input.name));
    match input.start.or(disturbance.then_some(0.0)) {
        Some(value) => Ok(graph.constant(value).node()),
        None => Err(Error::input(format!(
            "the input \"{}\" has no value: expected an expression of time under `inputs` of [simulate]",
            input.name
        ))
        .at(&study.file)
        .hint(format!("add inputs = {{ {} = \"…\" }}, or a start value in the model", input.name))),
    }
}

/// The study's method as the runner has it.
pub fn method(method: &lynkeus_study::Method) -> Method {
    match *method {
        lynkeus_study::Method::Rk4(Rk4Step::Length(h)) => Method::Rk4(Step::AtMost(h)),
        lynkeus_study::Method::Rk4(Rk4Step::PerRow(n)) => {
            Method::Rk4(Step::Substeps(usize::try_from(n).unwrap_or(usize::MAX)))
        }
        lynkeus_study::Method::Adaptive { solver, rtol, atol } => {
            let tolerances = Tolerances {
                relative: rtol,
                absolute: atol,
                ..Tolerances::default()
            };
            match solver {
                Solver::Auto => Method::Adaptive(tolerances),
                Solver::Explicit => Method::Explicit(tolerances),
                Solver::Stiff => Method::Stiff(tolerances),
            }
        }
    }
}

/// The study's settings as the runner has them.
pub(crate) fn run_settings(settings: &EstimateSettings) -> EstimatorSettings {
    EstimatorSettings {
        between: match settings.between_samples {
            // the inter-sample predictor is not the integrator's business
            BetweenSamples::Hold | BetweenSamples::Predict => lynkeus_run::BetweenSamples::Hold,
            BetweenSamples::Linear => lynkeus_run::BetweenSamples::Linear,
        },
        method: method(&settings.method),
    }
}
