//! The analysis.

use std::time::{Duration, Instant};

use lynkeus_expr::Node;
use lynkeus_model::{Plant, Variable, parse_expression};

use crate::field::{Modular, Random};
use crate::search::Search;
use crate::series::{Program, Stop, Unsupported};
use crate::start::{self, Start};
use crate::{Answer, Asked, Quantity, Verdict, point};

/// Seed of the first point.
const FIRST: u64 = 1;
const SINGULAR: &str = "its series is not defined at any of the random points tried: a division by zero, or roots of negative numbers";

/// When to stop.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limits {
    /// wall-clock time
    pub time: Duration,
    /// memory of the series, bytes
    pub memory: usize,
}

impl Default for Limits {
    fn default() -> Self {
        Self {
            time: Duration::from_secs(20),
            memory: 1 << 30,
        }
    }
}

/// What is known and what is asked.
#[derive(Clone, Debug, Default)]
pub struct Question {
    /// names of the measured outputs; empty for all
    pub measured: Vec<String>,
    /// names of the inputs that nobody measures
    pub unknown: Vec<String>,
    /// names of the inputs that are zero
    pub disturbances: Vec<String>,
    /// parameters are unknown constants
    pub parameters: bool,
    /// names of the states whose start values are known, beside those declared with
    /// `fixed = true`
    pub known_starts: Vec<String>,
    /// expressions to decide on, in states, parameters and inputs
    pub about: Vec<String>,
    /// when to stop
    pub limits: Limits,
}

/// A question that cannot be answered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuestionError {
    /// nothing is measured
    #[error(
        "nothing is measured: the plant '{0}' has no output; declare one, e.g. 'output Real y = x;'"
    )]
    NothingMeasured(String),
    /// a name that the plant does not have
    #[error("the plant has no {kind} named '{name}'; it has {found}")]
    NoSuchName {
        /// what was looked for
        kind: &'static str,
        /// the name
        name: String,
        /// the names there are
        found: String,
    },
    /// an expression that cannot be read
    #[error("{0}")]
    Expression(String),
}

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

/// One symbol with its first coefficient and its column among the unknowns.
pub(crate) struct Symbol {
    node: Node,
    pub role: Role,
    pub column: Option<usize>,
    pub start: Option<Modular>,
}

/// A plant with a question, ready to be expanded. The roots of the program are the
/// states' derivatives, the outputs and the expressions asked about.
pub(crate) struct Model {
    pub symbols: Vec<Symbol>,
    /// name and kind of each of the leading columns
    pub named: Vec<(String, Quantity)>,
    pub program: Program,
    pub states: usize,
    pub outputs: usize,
    pub about: usize,
    pub unknown_inputs: usize,
    /// every start is a generic point: the rank that does not grow once never grows
    pub generic: bool,
    /// orders that are enough at a generic point
    pub depth: usize,
}

/// Decides what can be known.
///
/// # Errors
/// [`QuestionError`].
pub fn analyse(plant: &Plant, question: &Question) -> Result<Answer, QuestionError> {
    let about = expressions(plant, question)?;
    let now = Instant::now();
    // a limit beyond what a clock can tell is none
    let deadline = now
        .checked_add(question.limits.time)
        .unwrap_or(now + Duration::from_secs(1 << 30));
    let model = match Model::new(plant, question, &about)? {
        Ok(model) => model,
        Err((named, Unsupported(reason))) => {
            return Ok(undecided(
                &named,
                question,
                &format!("the model contains {reason}"),
            ));
        }
    };
    let start = match start::find(&model, question.limits, Start::new(&model, FIRST), deadline) {
        Ok(start) => start,
        Err(Stop::Point(_)) => return Ok(undecided(&model.named, question, SINGULAR)),
        Err(stop) => {
            return Ok(undecided(
                &model.named,
                question,
                &format!("the limit of {} struck at once", stop.word()),
            ));
        }
    };
    let mut search = Search::new(&model, question.limits, &start, deadline);
    search.expect(generic_rank(&model, question, deadline));
    let stop = search.run().err();
    Ok(search.answer(question, stop, deadline))
}

/// The rank with random numbers for the known starts: never smaller than with the given
/// ones, so that a search from those may stop there.
fn generic_rank(model: &Model, question: &Question, deadline: Instant) -> Option<usize> {
    if model.generic || model.unknown_inputs > 0 {
        return None;
    }
    let mut anywhere = Start::new(model, FIRST);
    anywhere.anywhere = true;
    let anywhere = start::find(model, question.limits, anywhere, deadline).ok()?;
    let mut search = Search::new(model, question.limits, &anywhere, deadline);
    search.run().ok()?;
    Some(search.rank())
}

fn undecided(named: &[(String, Quantity)], question: &Question, reason: &str) -> Answer {
    let asked = |name: &String| Asked {
        name: name.clone(),
        verdict: Verdict::Undecided,
    };
    Answer {
        quantities: named
            .iter()
            .map(|(name, kind)| (asked(name), *kind))
            .collect(),
        about: question.about.iter().map(asked).collect(),
        symmetries: vec![],
        order: 0,
        rank: 0,
        unknowns: named.len(),
        notes: vec![format!("undecided: {reason}")],
    }
}

/// The expressions asked about, over the plant's graph.
fn expressions(plant: &Plant, question: &Question) -> Result<Vec<Node>, QuestionError> {
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

type Refused = (Vec<(String, Quantity)>, Unsupported);

impl Model {
    fn new(
        plant: &Plant,
        question: &Question,
        about: &[Node],
    ) -> Result<Result<Self, Refused>, QuestionError> {
        let graph = &plant.graph;
        let outputs = measured(plant, question)?;
        for name in question.unknown.iter().chain(&question.disturbances) {
            find("input", &plant.inputs, name)?;
        }
        for name in &question.known_starts {
            find("state", &plant.states, name)?;
        }
        let (symbols, named) = symbols(plant, question);
        let mut roots = plant.derivatives.clone();
        roots.extend(&outputs);
        roots.extend(about);
        let nodes: Vec<Node> = symbols.iter().map(|s| s.node).collect();
        let reference = point::reference(plant, &mut Random::new(1));
        let branch = |node: Node| point::value(graph, node, &reference);
        let program = match Program::new(graph, &nodes, &roots, &branch) {
            Ok(program) => program,
            Err(unsupported) => return Ok(Err((named, unsupported))),
        };
        let of_kind = |kind: Quantity| named.iter().filter(|(_, k)| *k == kind).count();
        let unknown_constants = of_kind(Quantity::Parameter);
        Ok(Ok(Self {
            generic: !plant.states.iter().any(|s| starts_known(s, question)),
            unknown_inputs: of_kind(Quantity::UnknownInput),
            depth: plant.states.len() + unknown_constants + 1,
            states: plant.states.len(),
            outputs: outputs.len(),
            about: about.len(),
            symbols,
            named,
            program,
        }))
    }
}

fn measured(plant: &Plant, question: &Question) -> Result<Vec<Node>, QuestionError> {
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

/// Whether the start value of a state is known, by its declaration or by the question.
fn starts_known(state: &Variable, question: &Question) -> bool {
    state.fixed || question.known_starts.contains(&state.name)
}

/// Every symbol with its role, and the quantities that have a column of their own.
fn symbols(plant: &Plant, question: &Question) -> (Vec<Symbol>, Vec<(String, Quantity)>) {
    let mut named = vec![];
    let mut symbols = vec![];
    for (i, state) in plant.states.iter().enumerate() {
        let known = starts_known(state, question);
        let start = Modular::from_f64(state.start.unwrap_or(0.0));
        let column = (!known).then(|| {
            named.push((state.name.clone(), Quantity::State));
            named.len() - 1
        });
        symbols.push(Symbol {
            node: state.node,
            role: Role::State(i),
            column,
            start: start.filter(|_| known),
        });
    }
    for parameter in &plant.parameters {
        let column = question.parameters.then(|| {
            named.push((parameter.variable.name.clone(), Quantity::Parameter));
            named.len() - 1
        });
        let value = parameter.value.and_then(Modular::from_f64);
        symbols.push(Symbol {
            node: parameter.variable.node,
            role: Role::Constant,
            column,
            start: value.filter(|_| !question.parameters),
        });
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
        let column = matches!(role, Role::Unknown).then(|| {
            named.push((input.name.clone(), Quantity::UnknownInput));
            named.len() - 1
        });
        let (node, start) = (input.node, None);
        symbols.push(Symbol {
            node,
            role,
            column,
            start,
        });
    }
    symbols.push(Symbol {
        node: plant.time,
        role: Role::Time,
        column: None,
        start: None,
    });
    (symbols, named)
}
