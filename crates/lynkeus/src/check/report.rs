//! What `check` is asked, and its answer.

use lynkeus_expr::Spent;
use lynkeus_model::Diagnostic;
use lynkeus_observability::Answer;
use lynkeus_observers::Examination;

use super::{Knowledge, Next, Uniform};
use lynkeus_experiment::prepare::choice::Choice;
use lynkeus_experiment::prepare::declared::Account;

/// What to ask beside "which states, by which observer".
#[derive(Clone, Debug, Default)]
pub struct CheckOptions {
    /// take the parameters as unknown constants, and ask for them too
    pub parameters: bool,
    /// expressions in states, parameters and inputs to decide on
    pub about: Vec<String>,
}

/// The answer of `lynkeus check`.
#[derive(Clone, Debug)]
pub struct Report {
    /// name of the plant
    pub plant: String,
    /// names of its states
    pub states: Vec<String>,
    /// measured outputs
    pub measured: Vec<String>,
    /// inputs that nobody measures
    pub unknown: Vec<String>,
    /// what each family finds; none where parameters are unknown
    pub examinations: Vec<Examination>,
    /// the family to use
    pub recommended: Option<&'static str>,
    /// the same with why, and with what the study leaves out
    pub choice: Option<Choice>,
    /// what can be known of each quantity, for each assumption on unknown inputs; none where
    /// parameters have no value or are asked for
    pub knowledge: Vec<Knowledge>,
    /// what to type next; none where no observer was asked for
    pub next: Option<Next>,
    /// the unit of time
    pub time_unit: Option<String>,
    /// what can be known at all
    pub answer: Answer,
    /// for what inputs and where states can be told apart; none for many states, or where
    /// they cannot at all
    pub uniform: Option<Uniform>,
    /// parameters are unknown constants
    pub parameters: bool,
    /// what the model says that does not fit together, such as units
    pub warnings: Vec<Diagnostic>,
    /// which of the study's declarations the families' conditions count
    pub declared: Account,
    /// what ended the search for the places where states cannot be told apart
    pub(super) ended: Option<Spent>,
}
