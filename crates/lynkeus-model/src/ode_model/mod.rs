//! Models in the notation of `@ODEmodel`, as StructuralIdentifiability.jl reads them.
//!
//! A file is a Julia script. [`script`] finds where its models begin; one of them is parsed into
//! the syntax tree that Modelica has as well, so that its expressions are evaluated by the same
//! rules. [`build`] says what its names are and makes the plant.

mod build;
mod parser;
mod script;

use std::path::Path;

use crate::diagnostic::{Problem, Result, Span};
use crate::names::choose;
use crate::syntax::check_length;
use crate::{LoadOptions, Plant};

/// The plant of a text.
pub(crate) fn plant(source: &str, file_name: &str, options: &LoadOptions) -> Result<Plant> {
    let models = models(source, file_name)?;
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
    let (equations, ast) = parser::parse(source, head)?;
    build::plant(source, chosen, head, &equations, ast, options)
}

/// The models of a text, in its order: their names, and where they begin. One that is assigned to
/// no variable is called as the file is.
pub(crate) fn models<'s>(source: &'s str, file_name: &'s str) -> Result<Vec<(&'s str, Span)>> {
    check_length(source)?;
    let stem = Path::new(file_name).file_stem();
    script::heads(
        source,
        stem.and_then(|stem| stem.to_str()).unwrap_or("model"),
    )
}
