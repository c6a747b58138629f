//! What the names of a model are: states, outputs, inputs, parameters.

use std::collections::HashMap;

use super::expressions::is_elementary;
use super::parser::{Equation, Mention, Model};
use crate::limits::{Budget, MAX_SCALARS};
use crate::syntax::{Problem, Result, Span};

/// What a name is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Role {
    State,
    Output,
    Input,
    Parameter,
}

/// The names that no equation defines, where they first stand.
#[derive(Debug, Default)]
pub(super) struct Roles {
    pub inputs: Vec<Span>,
    pub parameters: Vec<Span>,
}

/// Says what every name is.
pub(super) fn assign(source: &str, model: &Model) -> Result<Roles> {
    let mut names = Names {
        source,
        known: HashMap::new(),
        budget: Budget::new(MAX_SCALARS, "variables and parameters"),
    };
    for equation in &model.equations {
        names.define(equation)?;
    }
    let mut roles = Roles::default();
    for mention in &model.mentions {
        match names.mention(*mention)? {
            Some(Role::Input) => roles.inputs.push(mention.name),
            Some(_) => roles.parameters.push(mention.name),
            None => {}
        }
    }
    Ok(roles)
}

/// Every name so far, with its role and where it first stands.
struct Names<'s> {
    source: &'s str,
    known: HashMap<&'s str, (Role, Span)>,
    budget: Budget,
}

impl<'s> Names<'s> {
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

    /// The role of a name on a right side, where it is new.
    fn mention(&mut self, mention: Mention) -> Result<Option<Role>> {
        let Mention { name, is_function } = mention;
        let text = name.text(self.source);
        let role = match is_function {
            true => Role::Input,
            false => Role::Parameter,
        };
        match self.known.get(text).copied() {
            None if text == "t" => Err(Problem::new(name, "`t` is the time, not a function of it")),
            None => self.insert(name, role).map(|()| Some(role)),
            Some((Role::Output, _)) => Err(self.output_on_the_right(name)),
            Some((known, place)) if is_function == (known == Role::Parameter) => {
                Err(self.with_and_without_time(name, place))
            }
            Some(_) => Ok(None),
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
