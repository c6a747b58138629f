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
mod value;

use lynkeus_expr::Graph;

pub(crate) use evaluate::Evaluator;
pub(crate) use scope::{Mode, Named, Scope};
pub(crate) use value::{Scalar, Value};

use crate::limits::{Budget, MAX_ELABORATED};
use crate::names::did_you_mean;
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
    let model = choose(source, &ast, options)?;
    let graph = Graph::new();
    let budget = budget();
    let context = Context {
        source,
        ast: &ast,
        graph: &graph,
        budget: &budget,
        options,
    };
    let symbols = Symbols::new(&context, model)?;
    let equations = flatten::flatten(&context, &symbols, model)?;
    let parts = assemble::parts(&context, &symbols, model, &equations)?;
    Ok(parts.with_graph(graph))
}

/// The model that is asked for, or the only one.
fn choose<'a>(source: &str, ast: &'a Ast, options: &LoadOptions) -> Result<&'a ModelSyntax> {
    let name = |model: &ModelSyntax| model.name.text(source).to_owned();
    let names: Vec<String> = ast.models.iter().map(name).collect();
    let listed = || {
        let shown: Vec<&str> = names.iter().take(12).map(String::as_str).collect();
        let more = if names.len() > 12 { ", …" } else { "" };
        format!("its models are {}{more}", shown.join(", "))
    };
    let Some(wanted) = &options.model else {
        return match ast.models.as_slice() {
            [model] => Ok(model),
            [] => Err(Problem::new(Span::default(), "the text holds no model")
                .hint("a model reads `model Name … equation … end Name;`")),
            [_, second, ..] => Err(Problem::new(
                second.name,
                format!(
                    "the text holds {} models; say which one to take",
                    names.len()
                ),
            )
            .hint(listed())),
        };
    };
    let found = ast
        .models
        .iter()
        .find(|model| model.name.text(source) == wanted);
    found.ok_or_else(|| {
        let place = ast
            .models
            .first()
            .map(|model| model.name)
            .unwrap_or_default();
        let hint = did_you_mean(wanted, names.iter().map(String::as_str)).unwrap_or_else(listed);
        Problem::new(place, format!("the text holds no model `{wanted}`")).hint(hint)
    })
}

/// Line of a span, from 1.
pub(crate) fn line_of(source: &str, span: Span) -> usize {
    let before = source.as_bytes().iter().take(span.start as usize);
    1 + before.filter(|&&byte| byte == b'\n').count()
}
