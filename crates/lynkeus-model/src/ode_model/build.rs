//! What the names of a parsed model are (states, outputs, inputs, parameters), and its plant.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::Node;

use super::parser::Equations;
use crate::diagnostic::{Problem, Result, Span};
use crate::limits::{Budget, MAX_SCALARS};
use crate::names::did_you_mean;
use crate::syntax::ODE_MODEL;
use crate::syntax::ast::{Ast, Expression, Kind};
use crate::{LoadOptions, Model, Plant, elaborate};

/// Whether the name is that of a function of numbers.
fn is_elementary(name: &str) -> bool {
    ODE_MODEL.functions.contains(&name)
}

/// What a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    State,
    Output,
    Input,
    Parameter,
}

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
    /// Says what every name is. Functions of time become names in the tree.
    fn new(source: &'s str, equations: &Equations, ast: &mut Ast) -> Result<Self> {
        let mut names = Self {
            source,
            found: vec![],
            places: HashMap::new(),
            budget: Budget::new(MAX_SCALARS, "variables and parameters"),
        };
        for &(left, _) in equations {
            names.define(ast.expression(left))?;
        }
        for &(_, right) in equations {
            for id in ast.ids(right) {
                names.mention(&mut ast.expressions[id.0 as usize])?;
            }
        }
        Ok(names)
    }

    /// The name that an expression is, without its primes; and how many these are.
    fn primed(&self, expression: &Expression) -> (Span, usize) {
        let text = expression.span.text(self.source);
        let length = text.find(|character| !(ODE_MODEL.continues_name)(character));
        let start = expression.span.start as usize;
        let name = Span::new(start, start + length.unwrap_or(text.len()));
        (name, text.matches('\'').count())
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

    /// A left side.
    fn define(&mut self, left: &Expression) -> Result<()> {
        let (name, primes) = self.primed(left);
        let text = name.text(self.source);
        if text == "t" || is_elementary(text) {
            let problem = Problem::new(name, format!("`{text}` cannot be the name of a variable"));
            return Err(problem.hint("choose another name"));
        }
        if primes > 1 {
            let message = "derivatives of higher order are not supported";
            let hint = format!("add a state for the velocity: `{text}'(t) = v(t)` and `v'(t) = …`");
            return Err(Problem::new(left.span, message).hint(hint));
        }
        let role = if primes == 0 {
            Role::Output
        } else {
            Role::State
        };
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

    /// A part of a right side.
    fn mention(&mut self, part: &mut Expression) -> Result<()> {
        let role = match &part.kind {
            Kind::Name => Role::Parameter,
            Kind::Call(call) if is_elementary(call.function.text(self.source)) => return Ok(()),
            Kind::Call(_) => Role::Input,
            _ => return Ok(()),
        };
        let (name, primes) = self.primed(part);
        let text = name.text(self.source);
        if primes > 0 {
            let message = "a derivative on a right side is not supported";
            let hint = format!("write what `{text}'(t)` is equal to, from its own equation");
            return Err(Problem::new(part.span, message).hint(hint));
        }
        part.kind = Kind::Name;
        match self.known(text) {
            None if text == "t" && role == Role::Parameter => Ok(()),
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
    head: Span,
    equations: &Equations,
    mut ast: Ast,
    options: &LoadOptions,
) -> Result<Plant> {
    let names = Names::new(source, equations, &mut ast)?;
    check_given(head, &names, options)?;
    let model = Model::new(name);
    let mut nodes: HashMap<&str, Node> = HashMap::from([("t", model.time().node())]);
    for (text, _) in names.of(Role::State) {
        nodes.insert(text, model.state(text, |_| ()).node());
    }
    for (text, _) in names.of(Role::Input) {
        nodes.insert(text, model.input(text, |_| ()).node());
    }
    for (text, span) in names.of(Role::Parameter) {
        let value = options.parameters.get(text).copied();
        let symbolic =
            options.symbolic_parameters && (value.is_none() || !options.numbers.contains(text));
        let symbol = model.parameter(text, value, |_| ());
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
    equate(&names, equations, &ast, &model, &nodes)?;
    model
        .finish()
        .map_err(|error| Problem::new(head, error.to_string()))
}

/// Evaluates the right sides.
fn equate(
    names: &Names<'_>,
    equations: &Equations,
    ast: &Ast,
    model: &Model,
    nodes: &HashMap<&str, Node>,
) -> Result<()> {
    let graph = model.graph();
    let known = &|name: &str| nodes.get(name).copied();
    elaborate::evaluated(names.source, ast, graph, known, |evaluator| {
        // what stands on the left sides was found first, in their order
        for (&(name, role), &(_, right)) in names.found.iter().zip(equations) {
            let text = name.text(names.source);
            let value = evaluator.scalar(right)?.real(graph);
            let expected = || Problem::new(ast.expression(right).span, "expected a number");
            let value = graph.expr(value.ok_or_else(expected)?);
            match role {
                Role::State => model.der(graph.symbol(text), value),
                _ => model.output(text, value, |_| ()),
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
