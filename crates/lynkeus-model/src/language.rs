//! The languages that models are written in, told apart by the ends of file names.

use std::path::Path;

use crate::{Diagnostic, elaborate, ode_model};

/// A language of models.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Language {
    Modelica,
    OdeModel,
}

impl Language {
    /// The language of a file.
    pub(crate) fn of(file_name: &str) -> Self {
        let extension = Path::new(file_name).extension();
        match extension.is_some_and(|end| end.eq_ignore_ascii_case("jl")) {
            true => Self::OdeModel,
            false => Self::Modelica,
        }
    }
}

/// The names of the models of a text, in its order. The text is taken as an `@ODEmodel` text
/// where `file_name` ends in `.jl`, else as Modelica.
///
/// # Errors
/// The text cannot be read so far that its models are known.
///
/// ```
/// let text = "one = @ODEmodel(x'(t) = 1)  two = @ODEmodel(x'(t) = 2)";
/// assert_eq!(lynkeus_model::model_names(text, "models.jl")?, ["one", "two"]);
/// # Ok::<(), lynkeus_model::Diagnostic>(())
/// ```
pub fn model_names(source: &str, file_name: &str) -> Result<Vec<String>, Diagnostic> {
    let names = match Language::of(file_name) {
        Language::Modelica => elaborate::names(source),
        Language::OdeModel => ode_model::names(source, file_name),
    };
    names.map_err(|problem| Diagnostic::new(problem, file_name, source))
}
