//! Plants written in Rust: functions over expressions with overloaded operators.

use std::cell::RefCell;
use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Expr, Graph, Node};

use crate::{Parameter, Plant, Variable};

/// Why a model written in Rust is not a plant.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[non_exhaustive]
pub enum ModelError {
    /// Two variables have one name.
    #[error("`{0}` is declared twice")]
    Duplicate(String),
    /// The name is taken by the language.
    #[error("`{0}` cannot be the name of a variable")]
    Reserved(String),
    /// A state has no derivative.
    #[error("state `{0}` has no derivative; give it one with `der`")]
    MissingDerivative(String),
    /// A state has two derivatives.
    #[error("state `{0}` has two derivatives")]
    TwoDerivatives(String),
    /// `der` was called with something that is no state of this model.
    #[error("`der` was called with {0}, which is no state of the model")]
    NotAState(String),
    /// An expression reads something that was not declared.
    #[error("{place} reads `{name}`, which is not declared in the model")]
    Undeclared {
        /// whose expression it is
        place: String,
        /// the name
        name: String,
    },
    /// An expression was made by another model.
    #[error("{0} is an expression of another model")]
    Foreign(String),
    /// The range of a variable is empty or not a number.
    #[error("`{0}` has an empty range: min must not exceed max")]
    EmptyRange(String),
}

/// A plant under construction. Expressions borrow the model; [`Model::finish`] takes it.
#[derive(Debug)]
pub struct Model {
    name: String,
    graph: Graph,
    parts: RefCell<Parts>,
}

#[derive(Debug, Default)]
struct Parts {
    states: Vec<Variable>,
    inputs: Vec<Variable>,
    outputs: Vec<Variable>,
    parameters: Vec<Parameter>,
    derivatives: Vec<(Node, Node)>,
    /// what was given an expression of another graph, whose nodes mean nothing here
    foreign: Option<String>,
}

impl Model {
    /// A model without variables.
    pub fn new(name: &str) -> Self {
        Self {
            name: name.to_owned(),
            graph: Graph::new(),
            parts: RefCell::default(),
        }
    }

    /// The graph the expressions live in, for constants and functions of two arguments.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The symbol of time.
    pub fn time(&self) -> Expr<'_> {
        self.graph.symbol("time")
    }

    /// Declares a state; `describe` says what is known of it, as `|_| ()` where nothing is.
    pub fn state(&self, name: &str, describe: impl FnOnce(&mut Variable)) -> Expr<'_> {
        let symbol = self.graph.symbol(name);
        let state = variable(name, symbol.node(), describe);
        self.parts.borrow_mut().states.push(state);
        symbol
    }

    /// Declares an input; `describe` says what is known of it.
    pub fn input(&self, name: &str, describe: impl FnOnce(&mut Variable)) -> Expr<'_> {
        let symbol = self.graph.symbol(name);
        let input = variable(name, symbol.node(), describe);
        self.parts.borrow_mut().inputs.push(input);
        symbol
    }

    /// Declares a parameter that stays a symbol; `None` where its value is unknown.
    pub fn parameter(
        &self,
        name: &str,
        value: Option<f64>,
        describe: impl FnOnce(&mut Variable),
    ) -> Expr<'_> {
        let symbol = self.graph.symbol(name);
        let variable = variable(name, symbol.node(), describe);
        let parameter = Parameter { variable, value };
        self.parts.borrow_mut().parameters.push(parameter);
        symbol
    }

    /// States the derivative of a state.
    pub fn der(&self, state: Expr<'_>, derivative: Expr<'_>) {
        if self.is_own(state, "a state in `der`") && self.is_own(derivative, "a derivative") {
            let pair = (state.node(), derivative.node());
            self.parts.borrow_mut().derivatives.push(pair);
        }
    }

    /// Declares an output with its value; `describe` says what is known of it.
    pub fn output(&self, name: &str, value: Expr<'_>, describe: impl FnOnce(&mut Variable)) {
        if self.is_own(value, &format!("the value of output `{name}`")) {
            let output = variable(name, value.node(), describe);
            self.parts.borrow_mut().outputs.push(output);
        }
    }

    fn is_own(&self, expression: Expr<'_>, what: &str) -> bool {
        let is_own = std::ptr::eq(expression.graph(), &self.graph);
        if !is_own {
            let foreign = &mut self.parts.borrow_mut().foreign;
            foreign.get_or_insert_with(|| what.to_owned());
        }
        is_own
    }

    /// The plant.
    ///
    /// # Errors
    /// A name is used twice or is reserved, a range is empty, a state has no derivative or two,
    /// or an expression reads a symbol that is not declared.
    pub fn finish(self) -> Result<Plant, ModelError> {
        let Self { name, graph, parts } = self;
        let parts = parts.into_inner();
        if let Some(what) = parts.foreign {
            return Err(ModelError::Foreign(what));
        }
        parts.check_declared()?;
        let derivatives = parts.derivatives(&graph)?;
        let time = graph.symbol("time").node();
        parts.check_symbols(&graph, time, &derivatives)?;
        Ok(Plant {
            states: parts.states,
            derivatives,
            inputs: parts.inputs,
            outputs: parts.outputs,
            parameters: parts.parameters,
            ..Plant::empty(name, graph, time)
        })
    }
}

impl Parts {
    /// What an expression may read.
    fn readable(&self) -> impl Iterator<Item = &Variable> {
        let parameters = self.parameters.iter().map(|parameter| &parameter.variable);
        self.states.iter().chain(&self.inputs).chain(parameters)
    }

    fn check_declared(&self) -> Result<(), ModelError> {
        let all = || self.readable().chain(&self.outputs);
        let mut names = HashSet::new();
        for Variable { name, .. } in all() {
            if name == "time" || name.is_empty() {
                return Err(ModelError::Reserved(name.clone()));
            }
            if !names.insert(name) {
                return Err(ModelError::Duplicate(name.clone()));
            }
        }
        let is_range = |variable: &&Variable| variable.min <= variable.max;
        match all().find(|variable| !is_range(variable)) {
            Some(variable) => Err(ModelError::EmptyRange(variable.name.clone())),
            None => Ok(()),
        }
    }

    /// The derivatives in the order of the states.
    fn derivatives(&self, graph: &Graph) -> Result<Vec<Node>, ModelError> {
        let states: HashSet<Node> = self.states.iter().map(|state| state.node).collect();
        let mut found = HashMap::new();
        for &(state, derivative) in &self.derivatives {
            let name = graph.symbol_name(state);
            if !states.contains(&state) {
                let what = name.map_or("an expression".to_owned(), |name| format!("`{name}`"));
                return Err(ModelError::NotAState(what));
            }
            if found.insert(state, derivative).is_some() {
                return Err(ModelError::TwoDerivatives(name.unwrap_or_default()));
            }
        }
        let derivative = |state: &Variable| {
            let missing = || ModelError::MissingDerivative(state.name.clone());
            found.get(&state.node).copied().ok_or_else(missing)
        };
        self.states.iter().map(derivative).collect()
    }

    fn check_symbols(&self, graph: &Graph, time: Node, slopes: &[Node]) -> Result<(), ModelError> {
        let known = self.readable().map(|variable| variable.node);
        let known: HashSet<Node> = known.chain([time]).collect();
        let states = self.states.iter().zip(slopes);
        let slopes = states.map(|(state, &slope)| (format!("der({})", state.name), slope));
        let outputs = self.outputs.iter();
        let outputs = outputs.map(|output| (output.name.clone(), output.node));
        for (place, node) in slopes.chain(outputs) {
            let mut read = graph.symbols_of(&[node]).into_iter();
            if let Some(stranger) = read.find(|symbol| !known.contains(symbol)) {
                let name = graph.symbol_name(stranger).unwrap_or_default();
                return Err(ModelError::Undeclared { place, name });
            }
        }
        Ok(())
    }
}

fn variable(name: &str, node: Node, describe: impl FnOnce(&mut Variable)) -> Variable {
    let mut variable = Variable::new(name.to_owned(), node);
    describe(&mut variable);
    variable
}

#[cfg(test)]
mod tests {
    use super::*;

    fn with_state() -> Model {
        let model = Model::new("M");
        let x = model.state("x", |_| ());
        model.der(x, -x);
        model
    }

    #[test]
    fn duplicate_names() {
        let model = with_state();
        model.input("x", |_| ());
        assert_eq!(
            model.finish().unwrap_err(),
            ModelError::Duplicate("x".into())
        );
    }

    #[test]
    fn derivatives_are_counted() {
        let model = with_state();
        model.state("z", |_| ());
        let missing = ModelError::MissingDerivative("z".into());
        assert_eq!(model.finish().unwrap_err(), missing);
        let model = with_state();
        let x = model.graph().symbol("x");
        model.der(x, x);
        assert_eq!(
            model.finish().unwrap_err(),
            ModelError::TwoDerivatives("x".into())
        );
        let model = with_state();
        let u = model.input("u", |_| ());
        model.der(u, u);
        assert_eq!(
            model.finish().unwrap_err(),
            ModelError::NotAState("`u`".into())
        );
    }

    #[test]
    fn undeclared_symbols() {
        let model = with_state();
        let q = model.graph().symbol("q");
        model.output("y", q, |_| ());
        let error = model.finish().unwrap_err();
        assert_eq!(
            error.to_string(),
            "y reads `q`, which is not declared in the model"
        );
    }

    #[test]
    fn expressions_of_another_model() {
        let (model, other) = (with_state(), with_state());
        let x = other.graph().symbol("x");
        model.output("y", x, |_| ());
        let error = model.finish().unwrap_err();
        assert_eq!(
            error.to_string(),
            "the value of output `y` is an expression of another model"
        );
    }

    #[test]
    fn ranges() {
        let model = with_state();
        model.input("u", |u| (u.min, u.max) = (1.0, 0.0));
        assert_eq!(
            model.finish().unwrap_err(),
            ModelError::EmptyRange("u".into())
        );
    }
}
