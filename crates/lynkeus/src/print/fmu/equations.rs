//! Plants and observers in continuous time, x' = f(t, x, u), y = h(t, x, u), as functional mock-up units.

use lynkeus_export::curly::c::File;
use lynkeus_export::curly::fmu::{Quantity, Version};
use lynkeus_export::curly::{Exchange, Ode, State};
use lynkeus_expr::{Budget, Graph, Node};
use lynkeus_model::{Plant, Variable, Whens};
use lynkeus_observers::Observer;
use lynkeus_run::{Method, Parts, System};

use super::rate::rate;
use super::{experiment, packed, quantity, time, units};
use crate::print::target::Artifact;
use crate::{Error, Study};
use lynkeus_experiment::course::fixed_steps::{size, typical, unset};
use lynkeus_experiment::prepare::headers::Headers;
use lynkeus_experiment::prepare::systems::{hat, starts};
use lynkeus_experiment::words::explain;
use lynkeus_study::SimulateSettings;

/// Equations over a graph, with what is known of their variables.
#[derive(Debug)]
pub(crate) struct Equations<'a> {
    name: String,
    title: String,
    study: &'a Study,
    graph: &'a Graph,
    time: Node,
    /// the same as a variable
    independent: Quantity,
    states: Vec<Equation>,
    inputs: Vec<Input>,
    /// what stays but may be set
    parameters: Vec<(Quantity, Node)>,
    /// but for states that are outputs
    outputs: Vec<(Quantity, Node)>,
    /// by which the states jump
    whens: Option<&'a Whens>,
    headers: Headers,
}

#[derive(Debug)]
struct Input {
    quantity: Quantity,
    symbol: Node,
    /// a value that it may have
    typical: f64,
}

#[derive(Debug)]
struct Equation {
    state: State,
    symbol: Node,
    derivative: Node,
    /// how large the state is
    size: f64,
}

impl<'a> Equations<'a> {
    /// The plant with the starts of the study, and as parameters those that are symbols of its equations.
    ///
    /// # Errors
    /// A start of something that is no state.
    pub fn of_plant(study: &'a Study, plant: &'a Plant) -> Result<Self, Error> {
        let given = study.simulate.as_ref().map(|s| &s.initial[..]);
        let starts = starts(plant, given.unwrap_or_default())?;
        let mut made = Self::none(study, plant, plant.time, "plant");
        made.title = format!("The plant {}", plant.name);
        made.whens = Some(&plant.whens);
        for parameter in &plant.parameters {
            made.headers.take(&parameter.variable.name);
        }
        made.inputs.extend(plant.inputs.iter().map(|input| Input {
            quantity: ranged(input, unset(study, plant, input)),
            symbol: input.node,
            typical: typical(input),
        }));
        for ((state, start), derivative) in plant.states.iter().zip(starts).zip(&plant.derivatives)
        {
            let is_output = plant.outputs.iter().any(|o| shows(o, state));
            made.state(ranged(state, start), is_output, [state.node, *derivative]);
            made.sized(state);
        }
        for output in &plant.outputs {
            if plant.states.iter().any(|state| shows(output, state)) {
                continue;
            }
            let mut told = ranged(output, 0.0);
            if plant.states.iter().any(|state| state.name == output.name) {
                let what = format!("the reading of {}", output.name);
                told.name = made.headers.free(&output.name, &what);
            }
            made.outputs.push((told, output.node));
        }
        let told = plant.outputs.iter().map(|output| output.node);
        let told: Vec<Node> = plant.derivatives.iter().copied().chain(told).collect();
        let read = plant.graph.symbols_of(&told);
        let parameters = plant.parameters.iter();
        let parameters = parameters.filter(|p| read.contains(&p.variable.node));
        made.parameters.extend(parameters.filter_map(|parameter| {
            let variable = &parameter.variable;
            Some((ranged(variable, parameter.value?), variable.node))
        }));
        Ok(made)
    }

    /// The observer as its family has it: measurements are inputs, given at any time.
    pub fn of_observer(study: &'a Study, plant: &'a Plant, observer: &Observer) -> Self {
        let mut made = Self::none(study, plant, observer.time, "observer");
        made.title = format!("Observer of {}", plant.name);
        made.read(plant, observer);
        // in the order of the table of estimates, which gives them the same names
        let headers = &mut made.headers;
        let hats = observer.estimates.iter().map(|estimate| {
            let name = &estimate.variable.name;
            headers.free(&hat(name), &format!("the estimate of {name}"))
        });
        let hats: Vec<String> = hats.collect();
        let estimates = || hats.iter().cloned().zip(&observer.estimates);
        for ((signal, start), derivative) in observer.states.iter().zip(&observer.derivatives) {
            let nodes = [signal.symbol, *derivative];
            match estimates().find(|(_, e)| e.node == signal.symbol) {
                Some((name, e)) => {
                    made.state(quantity(name, Some(&e.variable), *start), true, nodes);
                    made.sized(&e.variable);
                }
                None => {
                    let what = format!("{}, a state of the observer,", signal.name);
                    let name = made.headers.free(&signal.name, &what);
                    made.state(quantity(name, None, *start), false, nodes);
                }
            }
        }
        let is_state = |node: Node| observer.states.iter().any(|(s, _)| s.symbol == node);
        let own = estimates().filter(|(_, e)| !is_state(e.node));
        let own = own.map(|(name, e)| (quantity(name, Some(&e.variable), 0.0), e.node));
        made.outputs.extend(own);
        for monitor in &observer.monitors {
            let told = Quantity {
                name: made.headers.free(&monitor.name, &monitor.name),
                description: format!("{}, where below {}", monitor.meaning, monitor.alarm_below),
                ..Quantity::default()
            };
            made.outputs.push((told, monitor.node));
        }
        made
    }

    /// Without any variable but time.
    fn none(study: &'a Study, plant: &'a Plant, symbol: Node, what: &str) -> Self {
        let mut headers = Headers::beside(plant).of_variables();
        Self {
            name: format!("{}_{what}", plant.name),
            title: String::new(),
            study,
            graph: &plant.graph,
            time: symbol,
            independent: time(study, &mut headers),
            states: vec![],
            inputs: vec![],
            parameters: vec![],
            outputs: vec![],
            whens: None,
            headers,
        }
    }

    /// What an observer reads: variables of the plant, and derivatives of its inputs.
    fn read(&mut self, plant: &Plant, observer: &Observer) {
        let known = |name: &str| {
            let mut all = plant.inputs.iter().chain(&plant.outputs);
            all.find(|v| v.name == name)
        };
        for signal in observer.measured.iter().chain(&observer.inputs) {
            let variable = known(&signal.name);
            let start = variable.map_or(0.0, |v| unset(self.study, plant, v));
            self.inputs.push(Input {
                quantity: quantity(signal.name.clone(), variable, start),
                symbol: signal.symbol,
                typical: variable.map_or(0.0, typical),
            });
        }
        for derivative in &observer.input_derivatives {
            let name = &derivative.signal.name;
            let description = format!(
                "the derivative of order {} of {}",
                derivative.order, derivative.input
            );
            self.inputs.push(Input {
                quantity: Quantity {
                    name: self.headers.free(name, &description),
                    description,
                    ..Quantity::default()
                },
                symbol: derivative.signal.symbol,
                typical: 0.0,
            });
        }
    }

    /// A state by its symbol, and its derivative.
    fn state(&mut self, told: Quantity, is_output: bool, [symbol, derivative]: [Node; 2]) {
        let Quantity { name, unit, .. } = &told;
        let time = self.study.time_unit.as_deref();
        let by_time = Quantity {
            name: self.headers.free(
                &format!("der({name})"),
                &format!("the derivative of {name}"),
            ),
            unit: unit
                .as_deref()
                .zip(time)
                .and_then(|(unit, time)| rate(unit, time)),
            ..Quantity::default()
        };
        self.states.push(Equation {
            state: State {
                quantity: told,
                derivative: by_time,
                is_output,
            },
            symbol,
            derivative,
            size: 1.0,
        });
    }

    /// The last state is as large as a variable.
    fn sized(&mut self, variable: &Variable) {
        if let Some(last) = self.states.last_mut() {
            last.size = size(variable);
        }
    }

    /// As a system whose signals are the inputs, then the parameters.
    ///
    /// # Errors
    /// Expressions that read what is neither state nor input.
    pub fn system(&self) -> Result<System, Error> {
        let states = self.states.iter();
        let states = states.map(|equation| {
            let Quantity { name, start, .. } = &equation.state.quantity;
            (name.clone(), equation.symbol, *start)
        });
        let states: Vec<(String, Node, f64)> = states.collect();
        let derivatives: Vec<Node> = self.states.iter().map(|e| e.derivative).collect();
        let inputs = self.inputs.iter();
        let inputs = inputs.map(|input| (input.quantity.name.clone(), input.symbol));
        let parameters = self.parameters.iter();
        let parameters = parameters.map(|(told, symbol)| (told.name.clone(), *symbol));
        let outputs = self.outputs.iter();
        let outputs = outputs.map(|(told, node)| (told.name.clone(), *node));
        System::of(&Parts {
            graph: self.graph,
            time: self.time,
            states: &states,
            signals: &inputs.chain(parameters).collect::<Vec<_>>(),
            derivatives: &derivatives,
            outputs: &outputs.collect::<Vec<_>>(),
            whens: self.whens,
        })
        .map_err(explain)
    }

    /// Values that the system's signals may have, in their order.
    pub fn typical_signals(&self) -> impl Iterator<Item = f64> + '_ {
        let parameters = self.parameters.iter().map(|(told, _)| told.start);
        self.inputs
            .iter()
            .map(|input| input.typical)
            .chain(parameters)
    }

    /// How large the states are.
    pub fn sizes(&self) -> Vec<f64> {
        self.states.iter().map(|equation| equation.size).collect()
    }

    /// The texts of the archive of their [system](Self::system): model exchange, and co-simulation by a
    /// method with fixed steps.
    ///
    /// # Errors
    /// What cannot run elsewhere.
    pub fn texts(
        &self,
        system: &System,
        method: Method,
        about: &[String],
        version: Version,
        notes: &mut Vec<String>,
    ) -> Result<Texts, Error> {
        notes.extend(self.headers.notes.iter().cloned());
        let inputs = self.inputs.iter().map(|input| input.quantity.clone());
        let inputs: Vec<Quantity> = inputs.collect();
        let quantities = |of: &[(Quantity, Node)]| -> Vec<Quantity> {
            of.iter().map(|(quantity, _)| quantity.clone()).collect()
        };
        let (parameters, outputs) = (quantities(&self.parameters), quantities(&self.outputs));
        let states: Vec<State> = self.states.iter().map(|e| e.state.clone()).collect();
        let own = states.iter().flat_map(|s| [&s.quantity, &s.derivative]);
        let (indicators, told) = self.indicators(system);
        notes.extend(told);
        let exchange = Exchange {
            ode: &Ode {
                name: &self.name,
                title: &self.title,
                system,
                method,
                inputs: &inputs,
                parameters: &parameters,
                states: &states,
                outputs: &outputs,
                indicators: &indicators,
                about,
            },
            units: &units(
                inputs
                    .iter()
                    .chain(&outputs)
                    .chain(&parameters)
                    .chain(own)
                    .chain([&self.independent]),
            ),
            time: &self.independent,
            experiment: experiment(self.study, SimulateSettings::row_step),
        };
        let files = exchange
            .files(version)
            .map_err(|refusal| Error::refused(refusal.to_string()).at(&self.study.file))?;
        Ok(Texts {
            identifier: exchange.identifier(),
            files,
            version,
            budget: self.study.budget.clone(),
        })
    }
}

impl Equations<'_> {
    /// What passes zero where a state may jump, and what is to be said of their names.
    fn indicators(&self, system: &System) -> (Vec<Quantity>, Vec<String>) {
        let Some(whens) = system.whens() else {
            return (vec![], vec![]);
        };
        let mut headers = self.headers.clone();
        let known = headers.notes.len();
        let graph = &system.expressions().graph;
        let relations = whens.relations.iter().zip(1..);
        let indicators = relations.map(|(relation, k)| {
            let relation = graph.render(*relation, 60);
            let what = format!("what passes zero where {relation} changes");
            Quantity {
                name: headers.free(&format!("event {k}"), &what),
                description: what,
                ..Quantity::default()
            }
        });
        let indicators = indicators.collect();
        (indicators, headers.notes.split_off(known))
    }
}

/// What an archive is made of.
#[derive(Debug)]
pub(crate) struct Texts {
    identifier: String,
    files: Vec<File>,
    version: Version,
    budget: Budget,
}

impl Texts {
    /// With the library that the system's C compiler makes of them.
    pub fn archive(self, notes: &mut Vec<String>) -> Artifact {
        packed(
            &self.identifier,
            self.files,
            self.version,
            &self.budget,
            notes,
        )
    }
}

/// Whether an output is a state itself; one with an offset of its sensor only has its name.
fn shows(output: &Variable, state: &Variable) -> bool {
    output.name == state.name && output.node == state.node
}

/// A variable of the plant; a range that its own start leaves is no range of a run.
fn ranged(variable: &Variable, start: f64) -> Quantity {
    let end = |limit: f64| limit.is_finite().then_some(limit);
    let is_inside = (variable.min..=variable.max).contains(&start);
    Quantity {
        range: match is_inside {
            true => [end(variable.min), end(variable.max)],
            false => [None; 2],
        },
        nominal: variable
            .nominal
            .map(f64::abs)
            .filter(|size| size.is_normal()),
        ..quantity(variable.name.clone(), Some(variable), start)
    }
}
