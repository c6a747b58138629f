//! Plants and observers in continuous time, x' = f(t, x, u), y = h(t, x, u), as functional mock-up units.

use std::collections::BTreeSet;

use lynkeus_export::curly::fmu::{Quantity, Version};
use lynkeus_export::curly::{Exchange, Ode, State};
use lynkeus_expr::{Graph, Node};
use lynkeus_model::{BaseUnit, Plant, Variable};
use lynkeus_observers::Observer;
use lynkeus_run::{Method, System};

use super::{experiment, free, packed, quantity, time, units};
use crate::export::Artifact;
use crate::fixed_steps::typical;
use crate::study::SimulateSettings;
use crate::systems::{hat, starts};
use crate::{Error, Study};

/// Equations over a graph, with what is known of their variables.
#[derive(Debug)]
pub(crate) struct Equations<'a> {
    name: String,
    title: String,
    study: &'a Study,
    graph: &'a Graph,
    time: Node,
    states: Vec<Equation>,
    inputs: Vec<(Quantity, Node)>,
    /// but for states that are outputs
    outputs: Vec<(Quantity, Node)>,
}

#[derive(Debug)]
struct Equation {
    state: State,
    symbol: Node,
    derivative: Node,
}

impl<'a> Equations<'a> {
    /// The plant with the starts of the study.
    ///
    /// # Errors
    /// A start of something that is no state.
    pub fn of_plant(study: &'a Study, plant: &'a Plant) -> Result<Self, Error> {
        let given = study.simulate.as_ref().map(|s| &s.initial[..]);
        let starts = starts(plant, given.unwrap_or_default())?;
        let mut names = Taken::new();
        let inputs = plant.inputs.iter();
        let inputs = inputs.map(|v| (names.take(ranged(v, typical(v))), v.node));
        let inputs = inputs.collect();
        let is_state = |name: &str| plant.states.iter().any(|state| state.name == name);
        let states = plant.states.iter().zip(starts).zip(&plant.derivatives);
        let states = states.map(|((state, start), derivative)| Equation {
            state: State {
                quantity: names.take(ranged(state, start)),
                derivative: Quantity::default(),
                is_output: plant.outputs.iter().any(|o| o.name == state.name),
            },
            symbol: state.node,
            derivative: *derivative,
        });
        let states = states.collect();
        let own = plant.outputs.iter().filter(|o| !is_state(&o.name));
        let outputs = own.map(|v| (names.take(ranged(v, 0.0)), v.node)).collect();
        let made = Self {
            name: format!("{}_plant", plant.name),
            title: format!("The plant {}", plant.name),
            study,
            graph: &plant.graph,
            time: plant.time,
            states,
            inputs,
            outputs,
        };
        Ok(made.with_derivatives(names))
    }

    /// The observer as its family has it: measurements are inputs, given at any time.
    pub fn of_observer(study: &'a Study, plant: &'a Plant, observer: &Observer) -> Self {
        let mut names = Taken::new();
        let variables = plant.inputs.iter().chain(&plant.outputs);
        let variables: Vec<&Variable> = variables.collect();
        let read = observer.measured.iter().chain(&observer.inputs);
        let read = read.map(|signal| {
            let known = variables.iter().find(|v| v.name == signal.name);
            let start = known.map_or(0.0, |v| typical(v));
            let told = quantity(signal.name.clone(), known.copied(), start);
            (names.take(told), signal.symbol)
        });
        let mut inputs: Vec<(Quantity, Node)> = read.collect();
        inputs.extend(observer.input_derivatives.iter().map(|derivative| {
            let told = Quantity {
                name: derivative.signal.name.clone(),
                description: format!(
                    "the derivative of order {} of {}",
                    derivative.order, derivative.input
                ),
                ..Quantity::default()
            };
            (names.take(told), derivative.signal.symbol)
        }));
        let shown = |node: Node| observer.estimates.iter().find(|e| e.node == node);
        let states = observer.states.iter().zip(&observer.derivatives);
        let states = states.map(|((signal, start), derivative)| {
            let estimate = shown(signal.symbol).map(|e| &e.variable);
            let name = estimate.map_or_else(|| signal.name.clone(), |v| hat(&v.name));
            Equation {
                state: State {
                    quantity: names.take(quantity(name, estimate, *start)),
                    derivative: Quantity::default(),
                    is_output: estimate.is_some(),
                },
                symbol: signal.symbol,
                derivative: *derivative,
            }
        });
        let states: Vec<Equation> = states.collect();
        let is_state = |node: Node| states.iter().any(|s| s.symbol == node);
        let own = observer.estimates.iter().filter(|e| !is_state(e.node));
        let own = own.map(|e| {
            let variable = &e.variable;
            let told = quantity(hat(&variable.name), Some(variable), 0.0);
            (names.take(told), e.node)
        });
        let mut outputs: Vec<(Quantity, Node)> = own.collect();
        outputs.extend(observer.monitors.iter().map(|monitor| {
            let told = Quantity {
                name: monitor.name.clone(),
                description: format!("{}, where below {}", monitor.meaning, monitor.alarm_below),
                ..Quantity::default()
            };
            (names.take(told), monitor.node)
        }));
        let made = Self {
            name: format!("{}_observer", plant.name),
            title: format!("Observer of {}", plant.name),
            study,
            graph: &plant.graph,
            time: observer.time,
            states,
            inputs,
            outputs,
        };
        made.with_derivatives(names)
    }

    /// The derivatives of the states as variables.
    fn with_derivatives(mut self, mut names: Taken) -> Self {
        for Equation { state, .. } in &mut self.states {
            let Quantity { name, unit, .. } = &state.quantity;
            let told = Quantity {
                name: format!("der({name})"),
                unit: unit
                    .as_deref()
                    .zip(self.study.time_unit.as_deref())
                    .and_then(|(unit, time)| rate(unit, time)),
                ..Quantity::default()
            };
            state.derivative = names.take(told);
        }
        self
    }

    /// As a system whose signals are the inputs.
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
        let named = |of: &[(Quantity, Node)]| -> Vec<(String, Node)> {
            of.iter().map(|(q, node)| (q.name.clone(), *node)).collect()
        };
        System::new(
            self.graph,
            self.time,
            &states,
            &named(&self.inputs),
            &derivatives,
            &named(&self.outputs),
        )
        .map_err(Error::from_source)
    }

    /// Values that the inputs may have, in the order of the system's signals.
    pub fn typical_inputs(&self) -> impl Iterator<Item = f64> + '_ {
        self.inputs.iter().map(|(input, _)| input.start)
    }

    /// The archive of their [system](Self::system): model exchange, and co-simulation by a method with
    /// fixed steps.
    ///
    /// # Errors
    /// What cannot run elsewhere.
    pub fn archive(
        &self,
        system: &System,
        method: Method,
        about: &[String],
        version: Version,
        notes: &mut Vec<String>,
    ) -> Result<Artifact, Error> {
        let quantities = |of: &[(Quantity, Node)]| -> Vec<Quantity> {
            of.iter().map(|(quantity, _)| quantity.clone()).collect()
        };
        let (inputs, outputs) = (quantities(&self.inputs), quantities(&self.outputs));
        let states: Vec<State> = self.states.iter().map(|e| e.state.clone()).collect();
        let own = states.iter().flat_map(|s| [&s.quantity, &s.derivative]);
        let exchange = Exchange {
            ode: &Ode {
                name: &self.name,
                title: &self.title,
                system,
                method,
                inputs: &inputs,
                states: &states,
                outputs: &outputs,
                about,
            },
            units: &units(inputs.iter().chain(&outputs).chain(own)),
            time: &time(self.study),
            experiment: experiment(self.study, SimulateSettings::row_step),
        };
        let files = exchange
            .files(version)
            .map_err(|refusal| Error::refused(refusal.to_string()).at(&self.study.file))?;
        Ok(packed(&exchange.identifier(), files, version, notes))
    }
}

/// Names that are given out, each once.
struct Taken(BTreeSet<String>);

impl Taken {
    fn new() -> Self {
        Self(["time".to_owned()].into())
    }

    fn take(&mut self, mut quantity: Quantity) -> Quantity {
        quantity.name = free(&mut self.0, quantity.name);
        quantity
    }
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

/// A unit by a unit of time, as Modelica writes it; none where a part is not known.
fn rate(unit: &str, time: &str) -> Option<String> {
    let divided = match unit.split_once('/') {
        Some((above, below)) => format!("{above}.{time}-1/{below}"),
        None => format!("{unit}/{time}"),
    };
    let is_known = |text: &str| BaseUnit::of(text).is_some_and(|unit| unit.offset == 0.0);
    (is_known(unit) && is_known(&divided)).then_some(divided)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_rate_is_a_unit_by_time() {
        let found = |unit: &str| rate(unit, "min");
        assert_eq!(found("m").as_deref(), Some("m/min"));
        assert_eq!(found("kg.m2/s").as_deref(), Some("kg.m2.min-1/s"));
        let (slow, fast) = (
            BaseUnit::of("m/s").unwrap(),
            BaseUnit::of("m.min-1/s").unwrap(),
        );
        assert_eq!(fast.powers[2], slow.powers[2] - 1);
        assert!((fast.factor * 60.0 / slow.factor - 1.0).abs() < 1e-15);
        // another zero, and a word that is no unit
        assert_eq!((found("degC"), found("barrels")), (None, None));
    }
}
