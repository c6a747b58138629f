//! The plant of a parsed model.

use std::collections::{BTreeMap, HashMap};

use lynkeus_expr::Node;

use super::parser::Model as Syntax;
use super::roles::Roles;
use crate::elaborate::{Evaluator, Mode, Named, Scalar, Scope, budget};
use crate::names::did_you_mean;
use crate::syntax::{Problem, Result, Span};
use crate::{Attributes, LoadOptions, Model, Plant};

/// Makes the plant.
pub(super) fn plant(
    source: &str,
    name: &str,
    syntax: &Syntax,
    roles: &Roles,
    options: &LoadOptions,
) -> Result<Plant> {
    check_given(source, syntax, roles, options)?;
    let model = Model::new(name);
    let mut names = Names {
        nodes: HashMap::new(),
        time: model.time().node(),
    };
    let states = syntax.equations.iter().filter(|e| e.is_derivative);
    for span in states.map(|equation| equation.name) {
        let text = span.text(source);
        let state = model.state(text, Attributes::default());
        names.nodes.insert(text, state.node());
    }
    for text in roles.inputs.iter().map(|span| span.text(source)) {
        let input = model.input(text, Attributes::default());
        names.nodes.insert(text, input.node());
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
        names.nodes.insert(text, node);
    }
    equations(source, syntax, &model, &names)?;
    model
        .finish()
        .map_err(|error| Problem::new(syntax.head, error.to_string()))
}

/// Evaluates the right sides.
fn equations(source: &str, syntax: &Syntax, model: &Model, names: &Names<'_>) -> Result<()> {
    let (graph, budget) = (model.graph(), budget());
    let mode = Mode::Continuous;
    let mut evaluator = Evaluator::new(source, &syntax.ast, graph, &budget, names, mode);
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
}

/// Refuses values for what is no parameter, and values that are no numbers.
fn check_given(source: &str, syntax: &Syntax, roles: &Roles, options: &LoadOptions) -> Result<()> {
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

/// What names mean on right sides.
struct Names<'s> {
    nodes: HashMap<&'s str, Node>,
    time: Node,
}

impl Scope for Names<'_> {
    fn named(&self, name: &str, _mode: Mode) -> Named<'_> {
        let time = || (name == "t").then_some(self.time);
        match self.nodes.get(name).copied().or_else(time) {
            Some(node) => Named::Scalar(Scalar::Real(node)),
            None => Named::Unknown,
        }
    }

    fn dims(&self, _name: &str) -> Option<&[usize]> {
        None
    }

    fn derivative(&self, _variable: Node) -> Option<Node> {
        None
    }

    fn names(&self) -> Vec<&str> {
        self.nodes.keys().copied().collect()
    }

    fn time(&self, _mode: Mode) -> Option<Node> {
        Some(self.time)
    }
}
