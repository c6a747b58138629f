//! Models in the notation of `@ODEmodel`.

mod agreement;
mod grammar;
mod hostile;
mod refusals;

use std::collections::BTreeMap;

use lynkeus_model::{Diagnostic, LoadOptions, Plant};

/// Parameters stay symbols.
fn symbolic() -> LoadOptions {
    LoadOptions {
        symbolic_parameters: true,
        ..LoadOptions::default()
    }
}

/// Parameters have these values.
fn valued(parameters: &[(&str, f64)]) -> LoadOptions {
    let pairs = parameters
        .iter()
        .map(|&(name, value)| (name.to_owned(), value));
    LoadOptions {
        parameters: pairs.collect::<BTreeMap<_, _>>(),
        ..LoadOptions::default()
    }
}

/// The plant of a text that must be taken.
fn taken(text: &str) -> Plant {
    match Plant::from_ode_model(text, "test.jl", &symbolic()) {
        Ok(plant) => plant,
        Err(refused) => panic!("{refused}"),
    }
}

/// The refusal of a text that must not be taken.
fn refused(text: &str) -> Diagnostic {
    match Plant::from_ode_model(text, "test.jl", &symbolic()) {
        Ok(_) => panic!("taken: {text}"),
        Err(refused) => refused,
    }
}
