//! What the names of a parsed model are (states, outputs, inputs, parameters), and its plant.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::Node;

use super::lexer::Mention;
use super::parser::{Equation, ParsedModel, is_elementary};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{Budget, MAX_SCALARS};
use crate::names::did_you_mean;
use crate::{Attributes, LoadOptions, Model, Plant, elaborate};

/// What a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    State,
    Output,
    Input,
    Parameter,
}

/// What the names of a model are.
pub(super) struct Roles<'s> {
    source: &'s str,
    /// every name so far, with its role and where it first stands
    known: HashMap<&'s str, (Role, Span)>,
    budget: Budget,
    /// names that no equation defines, where they first stand
    inputs: Vec<Span>,
    parameters: Vec<Span>,
}

/// Says what every name is.
pub(super) fn roles<'s>(source: &'s str, model: &ParsedModel) -> Result<Roles<'s>> {
    let mut roles = Roles {
        source,
        known: HashMap::new(),
        budget: Budget::new(MAX_SCALARS, "variables and parameters"),
        inputs: vec![],
        parameters: vec![],
    };
    for equation in &model.equations {
        roles.define(equation)?;
    }
    for mention in &model.mentions {
        roles.mention(*mention)?;
    }
    Ok(roles)
}

impl<'s> Roles<'s> {
    fn insert(&mut self, name: Span, role: Role) -> Result<()> {
        let text = name.text(self.source);
        if text == "time" {
            let problem = Problem::new(name, "`time` cannot be the name of a variable");
            return Err(problem.hint("the time is `t`; choose another name for anything else"));
        }
        self.budget.charge(1, name)?;
        self.known.insert(text, (role, name));
        Ok(())
    }

    /// The name on a left side.
    fn define(&mut self, equation: &Equation) -> Result<()> {
        let name = equation.name;
        let text = name.text(self.source);
        if text == "t" || is_elementary(text) {
            let problem = Problem::new(name, format!("`{text}` cannot be the name of a variable"));
            return Err(problem.hint("choose another name"));
        }
        let role = match equation.is_derivative {
            true => Role::State,
            false => Role::Output,
        };
        match self.known.get(text) {
            None => self.insert(name, role),
            Some(&(other, place)) => Err(self.twice(name, role, other, place)),
        }
    }

    fn twice(&self, name: Span, role: Role, other: Role, place: Span) -> Problem {
        let text = name.text(self.source);
        let line = place.line(self.source);
        let label = format!("the other equation is on line {line}");
        if role == other {
            let problem = Problem::new(name, format!("`{text}` has two equations"));
            return problem.label(label).hint("remove one of the two");
        }
        let message = format!("`{text}` is both a state and an output");
        Problem::new(name, message).label(label).hint(format!(
            "give the output a name of its own, as in `y_{text}(t) = {text}(t)`"
        ))
    }

    /// A name on a right side.
    fn mention(&mut self, mention: Mention) -> Result<()> {
        let Mention { name, is_function } = mention;
        let text = name.text(self.source);
        let role = match is_function {
            true => Role::Input,
            false => Role::Parameter,
        };
        match self.known.get(text).copied() {
            None if text == "t" => Err(Problem::new(name, "`t` is the time, not a function of it")),
            None => {
                self.insert(name, role)?;
                match is_function {
                    true => self.inputs.push(name),
                    false => self.parameters.push(name),
                }
                Ok(())
            }
            Some((Role::Output, _)) => Err(self.output_on_the_right(name)),
            Some((known, place)) if is_function == (known == Role::Parameter) => {
                Err(self.with_and_without_time(name, place))
            }
            Some(_) => Ok(()),
        }
    }

    fn output_on_the_right(&self, name: Span) -> Problem {
        let text = name.text(self.source);
        let message = format!("the output `{text}` stands on a right side");
        Problem::new(name, message).hint(format!(
            "write what `{text}(t)` is equal to, in states, inputs and parameters"
        ))
    }

    fn with_and_without_time(&self, name: Span, place: Span) -> Problem {
        let text = name.text(self.source);
        let message = format!("`{text}` stands with and without `(t)`");
        let label = format!("the other one is on line {}", place.line(self.source));
        Problem::new(name, message).label(label).hint(format!(
            "write `{text}(t)` everywhere for a function of time, `{text}` for a parameter"
        ))
    }
}

/// Makes the plant.
pub(super) fn plant(
    source: &str,
    name: &str,
    syntax: &ParsedModel,
    roles: &Roles<'_>,
    options: &LoadOptions,
) -> Result<Plant> {
    check_given(source, syntax, roles, options)?;
    let model = Model::new(name);
    let mut nodes: HashMap<&str, Node> = HashMap::from([("t", model.time().node())]);
    let states = syntax.equations.iter().filter(|e| e.is_derivative);
    for span in states.map(|equation| equation.name) {
        let text = span.text(source);
        let state = model.state(text, Attributes::default());
        nodes.insert(text, state.node());
    }
    for text in roles.inputs.iter().map(|span| span.text(source)) {
        let input = model.input(text, Attributes::default());
        nodes.insert(text, input.node());
    }
    for span in &roles.parameters {
        let text = span.text(source);
        let value = options.parameters.get(text).copied();
        let symbolic =
            options.symbolic_parameters && (value.is_none() || !options.numbers.contains(text));
        let symbol = model.parameter(text, value, Attributes::default());
        let node = match (value, symbolic) {
            (_, true) => symbol.node(),
            (Some(value), false) => model.graph().constant(value).node(),
            (None, false) => return Err(no_value(text, *span)),
        };
        nodes.insert(text, node);
    }
    equations(source, syntax, &model, &nodes)?;
    model
        .finish()
        .map_err(|error| Problem::new(syntax.head, error.to_string()))
}

/// Evaluates the right sides.
fn equations(
    source: &str,
    syntax: &ParsedModel,
    model: &Model,
    nodes: &HashMap<&str, Node>,
) -> Result<()> {
    let graph = model.graph();
    let names = &|name: &str| nodes.get(name).copied();
    elaborate::evaluated(source, &syntax.ast, graph, names, |evaluator| {
        for equation in &syntax.equations {
            let text = equation.name.text(source);
            let value = evaluator.scalar(equation.right)?.real(graph);
            let value = value.ok_or_else(|| {
                let span = syntax.ast.expression(equation.right).span;
                Problem::new(span, "expected a number")
            })?;
            let value = graph.expr(value);
            match equation.is_derivative {
                true => model.der(graph.symbol(text), value),
                false => model.output(text, value, Attributes::default()),
            }
        }
        Ok(())
    })
}

/// Refuses values for what is no parameter, and values that are no numbers.
fn check_given(
    source: &str,
    syntax: &ParsedModel,
    roles: &Roles<'_>,
    options: &LoadOptions,
) -> Result<()> {
    if options.parameters.is_empty() {
        return Ok(());
    }
    let places = roles
        .parameters
        .iter()
        .map(|span| (span.text(source), *span));
    let places: BTreeMap<&str, Span> = places.collect();
    for (name, value) in &options.parameters {
        let Some(place) = places.get(name.as_str()) else {
            let hint = did_you_mean(name, places.keys().copied());
            let message = format!("the model has no parameter `{name}`");
            return Err(Problem::new(syntax.head, message).maybe_hint(hint));
        };
        if !value.is_finite() {
            let message = format!("parameter `{name}` is given the value {value}");
            return Err(Problem::new(*place, message).hint("give a finite number"));
        }
    }
    Ok(())
}

fn no_value(name: &str, span: Span) -> Problem {
    Problem::new(span, format!("parameter `{name}` has no value"))
        .hint("this notation has no values: give them on loading")
}
