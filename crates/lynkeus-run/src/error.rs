//! What can go wrong, with where and what to do.

use lynkeus_expr::MissingInput;

use crate::{SnapshotFault, Trajectory};

/// What comes of work that may end in this crate's error.
pub(crate) type Result<T, E = Error> = std::result::Result<T, E>;

/// Why a system could not be built, simulated or replayed.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Error {
    /// An expression reads a symbol that is not time, a state or a signal.
    #[error(transparent)]
    MissingInput(#[from] MissingInput),

    /// A setting has an impossible value.
    #[error("{what}: expected {expected}, found {found}")]
    Setting {
        /// the setting
        what: String,
        /// what it must be
        expected: String,
        /// what it is
        found: String,
    },

    /// A signal that a system reads comes from nowhere.
    #[error("the {reader} reads '{name}', which nothing provides; there is: {available}")]
    Unconnected {
        /// the system that reads it
        reader: &'static str,
        /// name of the signal
        name: String,
        /// what is provided, comma-separated
        available: String,
    },

    /// A signal that a system reads could come from several places.
    #[error("the {reader} reads '{name}', which two columns are called; rename one")]
    Ambiguous {
        /// the system that reads it
        reader: &'static str,
        /// name of the signal
        name: String,
    },

    /// The right-hand side or an output is NaN or infinite.
    #[error("at t = {time}: {operation}; the state there is {state}")]
    NotFinite {
        /// when
        time: f64,
        /// the first operation that made it, with its value
        operation: String,
        /// names and values of the state
        state: String,
    },

    /// The error control asks for steps below the resolution of time.
    #[error(
        "the step at t = {time} fell to {step:e}: the solution ends or jumps there (finite escape, or a singular right-hand side); the state is {state}"
    )]
    StepUnderflow {
        /// when
        time: f64,
        /// the last step tried
        step: f64,
        /// names and values of the state
        state: String,
    },

    /// The integrator used up its steps.
    #[error(
        "{steps} steps took the integration only to t = {time}, on the way to {until}: {chatters}a gain is too high or a relay or a threshold of the state chatters; the state is {state}"
    )]
    StepBudget {
        /// time reached
        time: f64,
        /// time asked for
        until: f64,
        /// steps spent
        steps: usize,
        /// the surface on which the right-hand side jumps again and again, ending in "; ", or
        /// empty
        chatters: String,
        /// names and values of the state
        state: String,
    },

    /// A fixed step small enough for the fastest mode would need too many steps.
    #[error(
        "the fastest mode at t = {time} needs a step of {needed:e}, that is {substeps:.3e} steps from one sample to the next (limit {limit}); lower the gain or use the adaptive method"
    )]
    TooStiff {
        /// when
        time: f64,
        /// the step that is small enough
        needed: f64,
        /// how many of them one interval takes
        substeps: f64,
        /// how many are allowed
        limit: usize,
    },

    /// The integration cannot go on where a matrix of the observer is singular.
    #[error(
        "the observer comes to where {} is singular at t = {time} ({} = {value:.3e}, its flag is raised below {}) and cannot be integrated on: {}; the estimate is {state}",
        .margin.matrix, .margin.name, .margin.below, .margin.meaning
    )]
    Singular {
        /// when
        time: f64,
        /// what says how close the matrix is to singular
        margin: Box<Margin>,
        /// its value
        value: f64,
        /// names and values of the observer's state
        state: String,
    },

    /// An estimate left every bound.
    #[error("the estimate diverged: '{name}' is {value:e} at t = {time}{hint}")]
    Diverged {
        /// when
        time: f64,
        /// the state
        name: String,
        /// its value
        value: f64,
        /// what to try, starting with "; ", or empty
        hint: String,
    },

    /// The covariance of an estimate has grown beyond every number.
    #[error("the estimate diverged: 'standard deviation of {name}' is {value:e} at t = {time}")]
    DeviationDiverged {
        /// when
        time: f64,
        /// what is estimated
        name: String,
        /// its standard deviation
        value: f64,
    },

    /// Too many instants at which an expression of time jumps or has a kink.
    #[error(
        "`{expression}` switches more than {limit} times between t = {from} and t = {to}; make it slower, give its mean where the detail does not matter, or make the output step smaller"
    )]
    TooManySwitches {
        /// what switches
        expression: String,
        /// start of the interval
        from: f64,
        /// its end
        to: f64,
        /// how many are allowed
        limit: usize,
    },

    /// Instants at which an expression of time switches that could not be located.
    #[error(
        "when `{expression}` switches cannot be told near t = {time}: rounding errors hide which side it is on, or it switches ever faster; give it a margin, or write it so that it does not cancel"
    )]
    UnresolvedSwitches {
        /// what switches
        expression: String,
        /// about when
        time: f64,
    },

    /// Events of a clause that never end.
    #[error(
        "the `when` of line {line} does not come to an end at t = {time}: {how}; give it a state of rest (a variable that says that it is over), or a hysteresis"
    )]
    EndlessEvents {
        /// when
        time: f64,
        /// line of the text
        line: usize,
        /// in which way
        how: String,
    },

    /// An event that a deviation moves by any time.
    #[error(
        "the estimate only touches the threshold of the `when` of line {line} at t = {time}: whether and when that event is cannot be told from the state, and no covariance goes through it"
    )]
    Grazing {
        /// when
        time: f64,
        /// line of the text
        line: usize,
    },

    /// A sample from before where an estimator is.
    #[error(
        "the time {time} is before {reached}, where the estimator is: expected samples in the order of their times"
    )]
    TimeBefore {
        /// time of the last sample or prediction
        reached: f64,
        /// time of this sample
        time: f64,
    },

    /// A row that comes later than is waited for.
    #[error(
        "the time {time} is before {oldest}: expected a row that is no later than is waited for; it is not used"
    )]
    TooLate {
        /// time of the row, or of a sample in it
        time: f64,
        /// the earliest that still finds its place
        oldest: f64,
    },

    /// A time of a sample, or an input of the first one, that is no finite number.
    #[error("{signal}: expected a finite number, found {value}")]
    NoNumber {
        /// `t`, or the name of the input
        signal: String,
        /// what was given
        value: f64,
    },

    /// A snapshot that does not fit.
    #[error("the snapshot cannot be restored: {fault}")]
    Snapshot {
        /// why
        fault: SnapshotFault,
    },

    /// The caller asked to stop.
    #[error("stopped at t = {time}")]
    Cancelled {
        /// time reached
        time: f64,
    },
}

/// An output of a system that says how far a matrix is from singular: its reciprocal condition
/// number, which a run that cannot go on is judged by.
#[derive(Clone, Debug, PartialEq)]
pub struct Margin {
    /// its place among the outputs
    pub output: usize,
    /// what people call it
    pub name: String,
    /// what the matrix is called
    pub matrix: String,
    /// below this it is close to singular
    pub below: f64,
    /// what that means, and what to do
    pub meaning: String,
}

impl Error {
    /// When a run ended, where it could not go on.
    pub(crate) fn time(&self) -> Option<f64> {
        match self {
            Self::StepUnderflow { time, .. }
            | Self::StepBudget { time, .. }
            | Self::TooStiff { time, .. }
            | Self::Diverged { time, .. } => Some(*time),
            _ => None,
        }
    }

    /// The same of a switch that reads so.
    pub(crate) fn about(mut self, switch: &str) -> Self {
        if let Self::TooManySwitches { expression, .. }
        | Self::UnresolvedSwitches { expression, .. } = &mut self
        {
            switch.clone_into(expression);
        }
        self
    }

    pub(crate) fn setting(
        what: impl Into<String>,
        expected: impl Into<String>,
        found: impl ToString,
    ) -> Self {
        Self::Setting {
            what: what.into(),
            expected: expected.into(),
            found: found.to_string(),
        }
    }
}

/// A run that ended early: why, and the rows made before.
#[derive(Debug, Clone, PartialEq, thiserror::Error)]
#[error("{error}")]
pub struct Interrupted {
    /// why
    #[source]
    pub error: Error,
    /// the rows before the end
    pub partial: Trajectory,
}

/// How many states a message lists.
const LISTED: usize = 6;

/// All digits of a number, without three hundred zeros.
pub(crate) fn digits(value: f64) -> String {
    let size = value.abs();
    match value == 0.0 || !value.is_finite() || (1e-5..1e16).contains(&size) {
        true => format!("{value}"),
        false => format!("{value:e}"),
    }
}

/// "h1 = 0.2, h2 = 1.5, … (12 states)", non-finite entries first.
pub(crate) fn state_text(names: &[String], values: &[f64]) -> String {
    let mut order: Vec<usize> = (0..names.len().min(values.len())).collect();
    order.sort_by_key(|&i| values[i].is_finite());
    let listed = order.iter().take(LISTED);
    let listed = listed.map(|&i| format!("{} = {}", names[i], digits(values[i])));
    let listed: Vec<String> = listed.collect();
    let mut text = listed.join(", ");
    if order.len() > LISTED {
        text.push_str(&format!(", … ({} states)", order.len()));
    }
    if text.is_empty() {
        text.push_str("(no states)");
    }
    text
}
