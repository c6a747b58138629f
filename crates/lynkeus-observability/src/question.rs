//! What is asked, and the answer.

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

/// Whether a quantity can be known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Verdict {
    /// locally: near a generic point no other value gives the same outputs
    Observable,
    /// other values give the same outputs
    Unobservable,
    /// a limit struck, or the model has no series here
    Undecided,
}

impl Verdict {
    /// One word: `observable`, `unobservable` or `undecided`.
    pub fn word(self) -> &'static str {
        match self {
            Verdict::Observable => "observable",
            Verdict::Unobservable => "unobservable",
            Verdict::Undecided => "undecided",
        }
    }
}

/// What a quantity is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Quantity {
    /// the state at the start
    State,
    /// a constant of the model
    Parameter,
    /// an input that nobody measures, at the start
    UnknownInput,
}

/// Quantities that can change together without a trace in the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Symmetry {
    /// names of the quantities that it moves
    pub moves: Vec<String>,
    /// in how many independent ways they can change
    pub directions: usize,
    /// how, where that is simple
    pub kind: Option<Kind>,
    /// combinations that are known nevertheless, as Modelica expressions
    pub invariants: Vec<String>,
}

/// How quantities change together.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    /// each is multiplied by a power of one number
    Scaling,
    /// to each a multiple of one number is added
    Shift,
}

/// How it was decided, or what limits it: `lynkeus-words` has the sentences.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    /// in exact arithmetic at a random point
    Exact,
    /// the same, functions of these names being taken as generic
    Generic(Vec<&'static str>),
    /// the model makes choices: in the branch at its own values
    OwnBranch,
    /// the model makes choices: branch by branch
    Branches {
        /// in how many
        count: usize,
        /// whether some of them were found at other times only
        later: bool,
        /// whether these are all that were found
        all: bool,
    },
    /// these choices are the same on the whole declared box
    Settled(Vec<String>),
    /// what no branch tells of these may show when the branch changes, or from what several branches tell
    WithinBranches(Vec<String>),
    /// what the flow hides of these may show when an event comes
    BetweenEvents(Vec<String>),
    /// start values are given, and so many derivatives do not decide everything
    Derivatives(usize),
    /// the limit of that name struck after so many derivatives
    Struck(&'static str, usize),
    /// the limit of that name struck at once
    StruckAtOnce(&'static str),
    /// the series is not defined at any point tried
    Singular,
    /// the model contains an algebraic loop, this one
    Loop(String),
    /// the model reads the condition estimate of a linear system
    ConditionEstimate,
    /// the model reads a symbol of this name without a value
    NoValue(String),
    /// the model contains an expression that is not defined at the reference point
    NotDefined(String),
    /// the model contains a linear system that is singular
    SingularSystem,
    /// the model takes a linear system as a value
    System,
    /// the model contains a number that has no image in the field
    Number(f64),
}

/// A quantity that the outputs tell in some branches of the model only.
#[derive(Clone, Debug, PartialEq)]
pub struct Partial {
    /// its name
    pub name: String,
    /// the share of the box in branches where they do not, at the time told below, estimated at points spread over it
    pub share: f64,
    /// one of these points: what the choices read, by name; `time` is one
    pub at: Vec<(String, f64)>,
}

/// A quantity or an expression that was asked about.
#[derive(Clone, Debug, PartialEq)]
pub struct Asked {
    /// its name, or the expression as written
    pub name: String,
    /// the verdict
    pub verdict: Verdict,
}

/// What can be known.
#[derive(Clone, Debug)]
pub struct Answer {
    /// every quantity with what it is and the verdict
    pub quantities: Vec<(Asked, Quantity)>,
    /// the expressions asked about
    pub about: Vec<Asked>,
    /// what is observable in some of the model's branches only
    pub partial: Vec<Partial>,
    /// what hides the unobservable quantities
    pub symmetries: Vec<Symmetry>,
    /// derivatives of the outputs that were used
    pub order: usize,
    /// rank of the sensitivities, of as many as there are unknowns
    pub rank: usize,
    /// number of unknowns, derivatives of unknown inputs included
    pub unknowns: usize,
    /// how it was decided, and what limits it
    pub notes: Vec<Note>,
}

impl Answer {
    /// The verdict on a quantity.
    pub fn verdict(&self, name: &str) -> Option<Verdict> {
        let mut quantities = self.quantities.iter();
        quantities
            .find(|(q, _)| q.name == name)
            .map(|(q, _)| q.verdict)
    }

    /// Every quantity, then every expression asked about.
    pub fn asked(&self) -> impl Iterator<Item = &Asked> {
        let quantities = self.quantities.iter().map(|(asked, _)| asked);
        quantities.chain(&self.about)
    }

    /// The same, to be changed.
    pub(crate) fn asked_mut(&mut self) -> impl Iterator<Item = &mut Asked> {
        let quantities = self.quantities.iter_mut().map(|(asked, _)| asked);
        quantities.chain(&mut self.about)
    }

    /// Whether every quantity is observable.
    pub fn is_complete(&self) -> bool {
        self.quantities
            .iter()
            .all(|(q, _)| q.verdict == Verdict::Observable)
    }
}
