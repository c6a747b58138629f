//! A syntax tree written out as a plant: names get sizes and values, loops and arrays become
//! scalar equations, and these are solved for the derivatives and the algebraic variables.

mod arithmetic;
mod array_functions;
mod arrays;
mod assemble;
mod attributes;
mod evaluate;
mod flatten;
mod functions;
mod order;
mod overrides;
mod parameters;
mod scope;
mod subscripts;
mod symbols;
mod tables;
mod value;

use lynkeus_expr::{Graph, Spent};

pub(crate) use evaluate::Evaluator;
pub(crate) use scope::{Mode, Named, Scope};
pub(crate) use value::{Scalar, Value};

use crate::choose::choose;
use crate::limits::{Budget, MAX_ELABORATED};
use crate::syntax::ast::{Ast, ModelSyntax};
use crate::syntax::{Problem, Result, Span, parse_file};
use crate::{LoadOptions, Plant};
use symbols::{Context, Symbols};

/// The budget of one text.
pub(crate) fn budget() -> Budget {
    Budget::new(
        MAX_ELABORATED,
        "scalar operations when loops and arrays are written out",
    )
}

/// The plant of a Modelica text.
pub(crate) fn plant(source: &str, options: &LoadOptions) -> Result<Plant> {
    let ast = parse_file(source)?;
    let model = choose_model(source, &ast, options)?;
    let graph = Graph::new();
    graph.set_budget(options.budget.clone());
    let budget = budget();
    let context = Context {
        source,
        ast: &ast,
        graph: &graph,
        budget: &budget,
        options,
    };
    let parts = graph.budgeted(options.budget.clone(), || {
        let symbols = Symbols::new(&context, model)?;
        let equations = flatten::flatten(&context, &symbols, model)?;
        assemble::parts(&context, &symbols, model, &equations)
    });
    let parts = parts.map_err(|spent| ended(model, spent))??;
    Ok(parts.with_graph(graph))
}

/// A limit ended the reading.
fn ended(model: &ModelSyntax, spent: Spent) -> Problem {
    Problem::new(model.name, format!("the model was not read: {spent}"))
}

/// The model that is asked for, or the only one.
fn choose_model<'a>(source: &str, ast: &'a Ast, options: &LoadOptions) -> Result<&'a ModelSyntax> {
    let none = || {
        Problem::new(Span::default(), "the text holds no model")
            .hint("a model reads `model Name … equation … end Name;`")
    };
    let name = |model: &ModelSyntax| (model.name.text(source), model.name);
    let models: Vec<(&str, Span)> = ast.models.iter().map(name).collect();
    let place = choose(&models, options.model.as_deref(), none)?;
    ast.models.get(place).ok_or_else(none)
}

/// The names of the models of a Modelica text.
pub(crate) fn names(source: &str) -> Result<Vec<String>> {
    let models = parse_file(source)?.models;
    let name = |model: &ModelSyntax| model.name.text(source).to_owned();
    Ok(models.iter().map(name).collect())
}
