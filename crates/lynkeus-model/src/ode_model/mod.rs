//! Models in the notation of `@ODEmodel`, as StructuralIdentifiability.jl reads them.
//!
//! A file is a Julia script. [`lexer`] finds where its models begin; one of them is parsed into
//! the syntax tree that Modelica has as well, so that its expressions are evaluated by the same
//! rules. [`build`] says what its names are and makes the plant.

mod build;
mod lexer;
mod parser;

use std::path::Path;

use crate::diagnostic::{Problem, Result, Span};
use crate::names::choose;
use crate::syntax::check_length;
use crate::{LoadOptions, Plant};
use lexer::Head;

/// The plant of a text.
pub(crate) fn plant(source: &str, file_name: &str, options: &LoadOptions) -> Result<Plant> {
    let heads = heads(source)?;
    let stem = stem(file_name);
    let name = |head: &Head| head.name.map_or(stem, |name| name.text(source));
    let models: Vec<(&str, Span)> = heads.iter().map(|head| (name(head), head.place)).collect();
    let none = || {
        Problem::new(Span::default(), "the text holds no `@ODEmodel`")
            .hint("a model reads `name = @ODEmodel(x'(t) = …, y(t) = …)`")
    };
    let place = choose(&models, options.model.as_deref(), none)?;
    let (chosen, head) = *models.get(place).ok_or_else(none)?;
    let mut others = models.iter().skip(place + 1);
    if let Some((_, other)) = others.find(|(name, _)| *name == chosen) {
        let message = format!("two models are called `{chosen}`");
        let hint = "give each a name of its own: `name = @ODEmodel(…)`";
        return Err(Problem::new(*other, message).hint(hint));
    }
    let model = parser::parse(source, head)?;
    let roles = build::roles(source, &model)?;
    build::plant(source, chosen, &model, &roles, options)
}

/// The names of the models of a text.
pub(crate) fn names(source: &str, file_name: &str) -> Result<Vec<String>> {
    let name = |head: Head| head.name.map_or(stem(file_name), |name| name.text(source));
    let heads = heads(source)?.into_iter();
    Ok(heads.map(|head| name(head).to_owned()).collect())
}

fn heads(source: &str) -> Result<Vec<Head>> {
    check_length(source)?;
    lexer::heads(source)
}

/// What a model without a name is called.
fn stem(file_name: &str) -> &str {
    let stem = Path::new(file_name).file_stem();
    stem.and_then(|stem| stem.to_str()).unwrap_or("model")
}
