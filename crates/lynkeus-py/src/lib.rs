//! The compiled half of the Python package: studies, answers, estimators and logs as Python
//! classes without comfort. What users see is `python/lynkeus`, built on these.
//!
//! Work is done without the interpreter's lock, on a thread of its own (`away`); errors become
//! the exceptions of `lynkeus.errors` (`errors`).

mod answer;
mod arrow;
mod away;
mod errors;
mod estimator;
mod functions;
mod likelihood;
mod log;
mod sections;
mod study;

/// Runs a command line as the program `lynkeus` does; its exit code.
#[pyo3::pyfunction]
fn command(py: pyo3::Python<'_>, arguments: Vec<std::ffi::OsString>) -> u8 {
    let words = std::iter::once("lynkeus".into()).chain(arguments);
    py.detach(|| lynkeus_cli::run(words) as u8)
}

/// The module `lynkeus._lynkeus`.
#[pyo3::pymodule]
mod _lynkeus {
    #[pymodule_export]
    use crate::answer::Answer;
    #[pymodule_export]
    const MEMORY: f64 = crate::away::MEMORY;
    #[pymodule_export]
    #[allow(non_upper_case_globals, reason = "the name that Python gives it")]
    const __version__: &str = env!("CARGO_PKG_VERSION");
    #[pymodule_export]
    use crate::command;
    #[pymodule_export]
    use crate::estimator::Estimator;
    #[pymodule_export]
    use crate::functions::{Functions, families};
    #[pymodule_export]
    use crate::likelihood::Likelihood;
    #[pymodule_export]
    use crate::log::Log;
    #[pymodule_export]
    use crate::study::{Study, model_names, schema};
}
