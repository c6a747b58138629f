//! What the certificate by linear matrix inequalities states and says, as data.

use lynkeus_expr::Spent;
use lynkeus_structure::Point;
use lynkeus_structure::slopes::Slope;

/// What is stated.
#[derive(Clone, Debug, PartialEq)]
pub enum Inequality {
    /// the error system is one in x̂ − x
    StatesAreTheEstimate,
    /// the box gives the error system ranges
    SlopesAreBounded,
    /// the inequality
    OneLyapunovFunction,
    /// what a point of rest refutes
    SmallErrorsDecay,
}

/// What is said of an error system, a proof or a gain.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// the observer's states are others
    OtherStates {
        /// how many it has
        states: usize,
        /// how many are to be estimated
        estimated: usize,
    },
    /// so many slopes are enclosed
    SlopesEnclosed(usize),
    /// the slope of a term has no bound
    Unbounded {
        /// the term
        term: String,
        /// variables without declared ends that it depends on
        undeclared: Vec<String>,
    },
    /// the inequality holds at a rate
    Holds {
        /// the rate
        rate: f64,
        /// for so many slopes
        slopes: usize,
    },
    /// it holds at a rate of the slopes together, as they are at each point of the box
    HoldsTogether {
        /// the rate
        rate: f64,
        /// parts into which the box was divided to see it
        parts: usize,
    },
    /// it cannot hold: the error's Jacobian is not stable at this point, with this largest real part
    Unstable(Point),
    /// no P was found for so many slopes
    NotFound {
        /// their number
        slopes: usize,
    },
    /// no proof, but every Jacobian examined is stable
    StableEverywhere {
        /// the decay of the slowest mode
        slowest: f64,
    },
    /// it holds for this share of every slope's range
    HoldsForShare(f64),
    /// a limit ended the search for a faster rate
    FasterSought(Spent),
    /// what acts has no bound
    NoUltimateBound,
    /// where an estimate that starts near the plant stays
    StaysNear,
    /// this output is no state times a number, plus what does not move
    ShowsNoState(String),
    /// no interval between samples was found for which a proof exists
    NoInterval,
    /// a limit ended the search for the longest interval
    LongerSought(Spent),
    /// the error obeys the same unstable e' = A e everywhere
    GrowsEverywhere,
    /// the plant can rest where the error grows
    Repelling,
    /// there is no gain, for the slope of a term has no bound
    NoGainUnbounded {
        /// the term
        term: String,
        /// variables without declared ends that it depends on
        undeclared: Vec<String>,
    },
    /// a rate needs larger gains than the limit
    BeyondLimit {
        /// the rate
        rate: f64,
        /// the limit
        limit: f64,
        /// the smallest largest entry found
        least: f64,
    },
    /// no gain is proved to reach a rate
    NotReached {
        /// the rate
        rate: f64,
        /// what stands in the way
        obstacle: Obstacle,
    },
}

/// What stands in the way of a rate.
#[derive(Clone, Debug, PartialEq)]
pub enum Obstacle {
    /// the time was too short to find out
    TakesLonger,
    /// the linearisation in the middle of the box
    Middle,
    /// the ranges of the slopes
    Ranges {
        /// with this share of every range there is a gain
        share: f64,
        /// the slope that blocks it alone
        alone: Option<Slope>,
    },
}
