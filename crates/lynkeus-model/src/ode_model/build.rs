//! What the names of a parsed model are (states, outputs, inputs, parameters), and its plant.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::Node;

use super::parser::{ParsedModel, Role, is_elementary};
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{Budget, MAX_SCALARS};
use crate::names::did_you_mean;
use crate::syntax::ast::Ast;
use crate::{Attributes, LoadOptions, Model, Plant, elaborate};

/// What the names of a model are.
struct Names<'s> {
    source: &'s str,
    /// in the order in which they first stand
    found: Vec<(Span, Role)>,
    /// their places in `found`
    places: HashMap<&'s str, usize>,
    budget: Budget,
}

impl<'s> Names<'s> {
    /// Says what every name is.
    fn new(source: &'s str, model: &ParsedModel<'_>) -> Result<Self> {
        let mut names = Self {
            source,
            found: vec![],
            places: HashMap::new(),
            budget: Budget::new(MAX_SCALARS, "variables and parameters"),
        };
        for &(name, role, _) in &model.equations {
            names.define(name, role)?;
        }
        for &(name, role) in &model.mentions {
            names.mention(name, role)?;
        }
        Ok(names)
    }

    /// Names of one role, each with its place.
    fn of(&self, role: Role) -> impl Iterator<Item = (&'s str, Span)> {
        let found = self.found.iter().filter(move |(_, other)| *other == role);
        found.map(|&(name, _)| (name.text(self.source), name))
    }

    fn known(&self, name: &str) -> Option<(Span, Role)> {
        let place = self.places.get(name)?;
        self.found.get(*place).copied()
    }

    fn insert(&mut self, name: Span, role: Role) -> Result<()> {
        let text = name.text(self.source);
        if text == "time" {
            let problem = Problem::new(name, "`time` cannot be the name of a variable");
            return Err(problem.hint("the time is `t`; choose another name for anything else"));
        }
        self.budget.charge(1, name)?;
        self.places.insert(text, self.found.len());
        self.found.push((name, role));
        Ok(())
    }

    /// A name on a left side.
    fn define(&mut self, name: Span, role: Role) -> Result<()> {
        let text = name.text(self.source);
        if text == "t" || is_elementary(text) {
            let problem = Problem::new(name, format!("`{text}` cannot be the name of a variable"));
            return Err(problem.hint("choose another name"));
        }
        let Some((place, other)) = self.known(text) else {
            return self.insert(name, role);
        };
        let (message, hint) = match role == other {
            true => (
                format!("`{text}` has two equations"),
                "remove one of the two".to_owned(),
            ),
            false => (
                format!("`{text}` is both a state and an output"),
                format!("give the output a name of its own, as in `y_{text}(t) = {text}(t)`"),
            ),
        };
        let label = format!("the other equation is on line {}", place.line(self.source));
        Err(Problem::new(name, message).label(label).hint(hint))
    }

    /// A name on a right side.
    fn mention(&mut self, name: Span, role: Role) -> Result<()> {
        let text = name.text(self.source);
        match self.known(text) {
            None if text == "t" => Err(Problem::new(name, "`t` is the time, not a function of it")),
            None => self.insert(name, role),
            Some((_, Role::Output)) => {
                let message = format!("the output `{text}` stands on a right side");
                Err(Problem::new(name, message).hint(format!(
                    "write what `{text}(t)` is equal to, in states, inputs and parameters"
                )))
            }
            Some((place, known)) if (role == Role::Parameter) != (known == Role::Parameter) => {
                let message = format!("`{text}` stands with and without `(t)`");
                let label = format!("the other one is on line {}", place.line(self.source));
                Err(Problem::new(name, message).label(label).hint(format!(
                    "write `{text}(t)` everywhere for a function of time, `{text}` for a parameter"
                )))
            }
            Some(_) => Ok(()),
        }
    }
}

/// Makes the plant.
pub(super) fn plant(
    source: &str,
    name: &str,
    syntax: &ParsedModel<'_>,
    ast: &Ast,
    options: &LoadOptions,
) -> Result<Plant> {
    let names = Names::new(source, syntax)?;
    check_given(syntax.head, &names, options)?;
    let model = Model::new(name);
    let mut nodes: HashMap<&str, Node> = HashMap::from([("t", model.time().node())]);
    for (text, _) in names.of(Role::State) {
        nodes.insert(text, model.state(text, Attributes::default()).node());
    }
    for (text, _) in names.of(Role::Input) {
        nodes.insert(text, model.input(text, Attributes::default()).node());
    }
    for (text, span) in names.of(Role::Parameter) {
        let value = options.parameters.get(text).copied();
        let symbolic =
            options.symbolic_parameters && (value.is_none() || !options.numbers.contains(text));
        let symbol = model.parameter(text, value, Attributes::default());
        let node = match (value, symbolic) {
            (_, true) => symbol.node(),
            (Some(value), false) => model.graph().constant(value).node(),
            (None, false) => {
                let problem = Problem::new(span, format!("parameter `{text}` has no value"));
                return Err(problem.hint("this notation has no values: give them on loading"));
            }
        };
        nodes.insert(text, node);
    }
    equations(source, syntax, ast, &model, &nodes)?;
    model
        .finish()
        .map_err(|error| Problem::new(syntax.head, error.to_string()))
}

/// Evaluates the right sides.
fn equations(
    source: &str,
    syntax: &ParsedModel<'_>,
    ast: &Ast,
    model: &Model,
    nodes: &HashMap<&str, Node>,
) -> Result<()> {
    let graph = model.graph();
    let names = &|name: &str| nodes.get(name).copied();
    elaborate::evaluated(source, ast, graph, names, |evaluator| {
        for &(name, role, right) in &syntax.equations {
            let text = name.text(source);
            let value = evaluator.scalar(right)?.real(graph);
            let expected = || Problem::new(ast.expression(right).span, "expected a number");
            let value = graph.expr(value.ok_or_else(expected)?);
            match role {
                Role::State => model.der(graph.symbol(text), value),
                _ => model.output(text, value, Attributes::default()),
            }
        }
        Ok(())
    })
}

/// Refuses values for what is no parameter, and values that are no numbers.
fn check_given(head: Span, names: &Names<'_>, options: &LoadOptions) -> Result<()> {
    let places: BTreeMap<&str, Span> = names.of(Role::Parameter).collect();
    for (name, value) in &options.parameters {
        let Some(place) = places.get(name.as_str()) else {
            let hint = did_you_mean(name, places.keys().copied());
            let message = format!("the model has no parameter `{name}`");
            return Err(Problem::new(head, message).maybe_hint(hint));
        };
        if !value.is_finite() {
            let message = format!("parameter `{name}` is given the value {value}");
            return Err(Problem::new(*place, message).hint("give a finite number"));
        }
    }
    Ok(())
}
