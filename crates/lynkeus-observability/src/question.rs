//! What is asked.

use lynkeus_expr::Budget;

/// What is known and what is asked.
#[derive(Clone, Debug, Default)]
pub struct Question {
    /// names of the measured outputs; empty for all
    pub measured: Vec<String>,
    /// names of the inputs that nobody measures
    pub unknown: Vec<String>,
    /// names of the inputs that are zero
    pub disturbances: Vec<String>,
    /// parameters are unknown constants
    pub parameters: bool,
    /// names of the states whose start values are known, beside those declared with
    /// `fixed = true`
    pub known_starts: Vec<String>,
    /// expressions to decide on, in states, parameters and inputs
    pub about: Vec<String>,
    /// when to stop
    pub budget: Budget,
}

/// A question that cannot be answered.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum QuestionError {
    /// nothing is measured
    #[error(
        "nothing is measured: the plant '{0}' has no output; declare one, e.g. 'output Real y = x;'"
    )]
    NothingMeasured(String),
    /// a name that the plant does not have
    #[error("the plant has no {kind} named '{name}'; it has {found}")]
    NoSuchName {
        /// what was looked for
        kind: &'static str,
        /// the name
        name: String,
        /// the names there are
        found: String,
    },
    /// an expression that cannot be read
    #[error("{0}")]
    Expression(String),
}
