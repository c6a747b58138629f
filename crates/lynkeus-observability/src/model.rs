//! A plant with a question, ready to be expanded.

use lynkeus_expr::{Budget, Node};
use lynkeus_model::{Plant, Variable, parse_expression};

use crate::branches::Reference;
use crate::series::Program;
use crate::{Note, Quantity, Question, QuestionError, branches};
use lynkeus_expr::modular::Modular;

/// What role a symbol plays in the series.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Role {
    /// a state: coefficients from its derivative (root `usize`)
    State(usize),
    /// an unknown constant
    Constant,
    /// a known signal
    Known,
    /// a signal that is zero
    Zero,
    /// an unknown signal: every coefficient is an unknown
    Unknown,
    Time,
}

/// What is known of a symbol's first value.
#[derive(Clone, Copy, Debug)]
pub(crate) enum First {
    /// nothing: any value is as good
    Free,
    Given(Modular),
    /// an expression in the parameters: a root of [`Model::starts`]
    Computed(usize),
}

/// One symbol with its first value and its column among the unknowns.
pub(crate) struct Symbol {
    node: Node,
    pub role: Role,
    pub column: Option<usize>,
    pub first: First,
    /// below zero at the reference point
    pub negative: bool,
}

/// A plant with a question. The roots of the program are the states' derivatives, the
/// outputs and the expressions asked about.
#[derive(Default)]
pub(crate) struct Model {
    pub symbols: Vec<Symbol>,
    /// name and kind of each of the leading columns
    pub named: Vec<(String, Quantity)>,
    pub program: Program,
    /// starts that are expressions in the parameters
    pub starts: Program,
    pub states: usize,
    pub outputs: usize,
    pub about: usize,
    pub unknown_inputs: usize,
    /// orders that are enough at a generic point
    pub depth: usize,
    /// when to stop
    pub budget: Budget,
}

impl Model {
    /// The model in one branch, `outputs` and the expressions `about` being over the plant's graph.
    ///
    /// # Errors
    /// Why it has no series.
    pub fn new(
        plant: &Plant,
        question: &Question,
        (outputs, about): (&[Node], &[Node]),
        reference: Option<&Reference>,
    ) -> Result<Self, (Vec<(String, Quantity)>, Note)> {
        let mut model = Self {
            states: plant.states.len(),
            outputs: outputs.len(),
            about: about.len(),
            budget: question.budget.clone(),
            ..Self::default()
        };
        let starts = model.add_symbols(plant, question);
        let roots = [&plant.derivatives[..], outputs, about].concat();
        let nodes: Vec<Node> = model.symbols.iter().map(|s| s.node).collect();
        let own = || branches::own(plant, question);
        let reference = reference.cloned().unwrap_or_else(own);
        for symbol in &mut model.symbols {
            symbol.negative = reference.get(&symbol.node).is_some_and(|x| *x < 0.0);
        }
        let branch = |node: Node| branches::value(&plant.graph, node, &reference);
        let compiled = |roots: &[Node]| Program::new(&plant.graph, &nodes, roots, &branch);
        let programs = compiled(&roots).and_then(|program| Ok((program, compiled(&starts)?)));
        (model.program, model.starts) = match programs {
            Ok(programs) => programs,
            Err(note) => return Err((model.named, note)),
        };
        let of_kind = |kind: Quantity| model.named.iter().filter(|(_, k)| *k == kind).count();
        model.unknown_inputs = of_kind(Quantity::UnknownInput);
        model.depth = model.states + of_kind(Quantity::Parameter) + 1;
        Ok(model)
    }

    /// Places of the states whose start is known.
    pub fn known_starts(&self) -> impl Iterator<Item = usize> + '_ {
        let known =
            |s: &Symbol| matches!(s.role, Role::State(_)) && !matches!(s.first, First::Free);
        let symbols = self.symbols.iter().enumerate();
        symbols.filter_map(move |(place, s)| known(s).then_some(place))
    }

    /// The place of time, where the model depends on it explicitly.
    pub fn time(&self) -> Option<usize> {
        let mut symbols = self.symbols.iter();
        let place = symbols.position(|s| matches!(s.role, Role::Time))?;
        self.program.reads(place).then_some(place)
    }
}

/// The expressions asked about, over the plant's graph.
pub(crate) fn expressions(plant: &Plant, question: &Question) -> Result<Vec<Node>, QuestionError> {
    let parameters = plant.parameters.iter().map(|p| &p.variable);
    let variables: Vec<&Variable> = plant
        .states
        .iter()
        .chain(&plant.inputs)
        .chain(parameters)
        .chain(&plant.algebraics)
        .chain(&plant.outputs)
        .collect();
    let names = |name: &str| match variables.iter().find(|v| v.name == name) {
        Some(variable) => Some(variable.node),
        None => (name == "time").then_some(plant.time),
    };
    let parse = |text: &String| {
        parse_expression(text, &plant.graph, &names)
            .map_err(|error| QuestionError::Expression(error.one_line()))
    };
    question.about.iter().map(parse).collect()
}

/// Refuses inputs and states that the plant does not have.
pub(crate) fn check_names(plant: &Plant, question: &Question) -> Result<(), QuestionError> {
    for name in question.unknown.iter().chain(&question.disturbances) {
        find("input", &plant.inputs, name)?;
    }
    for name in &question.known_starts {
        find("state", &plant.states, name)?;
    }
    Ok(())
}

fn find<'v>(
    kind: &'static str,
    variables: &'v [Variable],
    name: &str,
) -> Result<&'v Variable, QuestionError> {
    variables.iter().find(|v| v.name == name).ok_or_else(|| {
        let found: Vec<&str> = variables.iter().map(|v| v.name.as_str()).collect();
        QuestionError::NoSuchName {
            kind,
            name: name.to_owned(),
            found: if found.is_empty() {
                "none".into()
            } else {
                found.join(", ")
            },
        }
    })
}

/// The measured outputs.
pub(crate) fn measured(plant: &Plant, question: &Question) -> Result<Vec<Node>, QuestionError> {
    if plant.outputs.is_empty() {
        return Err(QuestionError::NothingMeasured(plant.name.clone()));
    }
    if question.measured.is_empty() {
        return Ok(plant.outputs.iter().map(|o| o.node).collect());
    }
    let names = question.measured.iter();
    names
        .map(|name| Ok(find("output", &plant.outputs, name)?.node))
        .collect()
}

impl Model {
    /// Adds every symbol with its role, and the quantities that have a column of their own; the
    /// start values that are expressions.
    fn add_symbols(&mut self, plant: &Plant, question: &Question) -> Vec<Node> {
        let mut starts = vec![];
        for (i, state) in plant.states.iter().enumerate() {
            self.add_state(i, state, question, &mut starts);
        }
        for parameter in &plant.parameters {
            let column = question
                .parameters
                .then(|| self.column(&parameter.variable, Quantity::Parameter));
            let value = parameter.value.and_then(Modular::from_f64);
            let first = match value {
                Some(value) if !question.parameters => First::Given(value),
                _ => First::Free,
            };
            self.push(parameter.variable.node, Role::Constant, column, first);
        }
        for input in &plant.inputs {
            let among = |names: &[String]| names.contains(&input.name);
            let role = if among(&question.unknown) {
                Role::Unknown
            } else if among(&question.disturbances) {
                Role::Zero
            } else {
                Role::Known
            };
            let column =
                matches!(role, Role::Unknown).then(|| self.column(input, Quantity::UnknownInput));
            self.push(input.node, role, column, First::Free);
        }
        self.push(plant.time, Role::Time, None, First::Free);
        starts
    }

    /// The start value of a state is known by its declaration or by the question; what
    /// the declaration says may be an expression in parameters that are unknown themselves.
    fn add_state(
        &mut self,
        i: usize,
        state: &Variable,
        question: &Question,
        starts: &mut Vec<Node>,
    ) {
        let known = state.fixed || question.known_starts.contains(&state.name);
        let column = (!known).then(|| self.column(state, Quantity::State));
        let computed = state.start_node.filter(|_| state.fixed);
        let first = match (known, computed) {
            (false, _) => First::Free,
            (true, Some(node)) => {
                starts.push(node);
                First::Computed(starts.len() - 1)
            }
            (true, None) => {
                let value = Modular::from_f64(state.start.unwrap_or(0.0));
                value.map_or(First::Free, First::Given)
            }
        };
        self.push(state.node, Role::State(i), column, first);
    }

    fn column(&mut self, of: &Variable, kind: Quantity) -> usize {
        self.named.push((of.name.clone(), kind));
        self.named.len() - 1
    }

    fn push(&mut self, node: Node, role: Role, column: Option<usize>, first: First) {
        self.symbols.push(Symbol {
            node,
            role,
            column,
            first,
            negative: false,
        });
    }
}
