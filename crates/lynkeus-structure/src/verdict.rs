//! Verdicts.

use crate::{Misfit, Place, Point};

/// Points that refute a condition.
#[derive(Clone, Debug, PartialEq)]
pub struct Witness {
    /// two points where the signs differ, behind the zero between them where there is one; or a
    /// zero alone
    pub points: Vec<Point>,
}

impl Witness {
    /// The point where the expression vanishes; none where it changes its sign by a jump, or
    /// between the members of a set.
    pub fn zero(&self) -> Option<&Point> {
        match self.points.len() {
            2 => None,
            _ => self.points.first(),
        }
    }
}

impl From<Point> for Witness {
    fn from(point: Point) -> Self {
        Self {
            points: vec![point],
        }
    }
}

/// The verdict on a statement about the whole box.
#[derive(Clone, Debug, PartialEq)]
pub enum Verdict {
    /// holds everywhere on the box, by interval arithmetic
    Proved,
    /// fails at the witness
    Refuted(Witness),
    /// neither, within the budget; the part of the box that is left
    Undecided(Place),
}

impl Verdict {
    /// Neither proved nor refuted, no part of the box more than another.
    pub fn open() -> Self {
        Verdict::Undecided(vec![])
    }

    /// The verdict without what led to it.
    pub fn standing(&self) -> Standing {
        match self {
            Verdict::Proved => Standing::Proved,
            Verdict::Refuted(_) => Standing::Refuted,
            Verdict::Undecided(_) => Standing::Undecided,
        }
    }

    /// One word: `proved`, `refuted` or `undecided`.
    pub fn word(&self) -> &'static str {
        self.standing().word()
    }
}

/// A verdict without witness or place, the better the smaller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Standing {
    /// holds everywhere
    Proved,
    /// neither
    Undecided,
    /// fails somewhere
    Refuted,
}

impl Standing {
    /// That of "each of these": refuted if one is, else undecided if one is, else proved.
    pub fn of_all(parts: impl IntoIterator<Item = Standing>) -> Self {
        parts.into_iter().max().unwrap_or(Standing::Proved)
    }

    /// One word: `proved`, `refuted` or `undecided`.
    pub fn word(self) -> &'static str {
        match self {
            Standing::Proved => "proved",
            Standing::Refuted => "refuted",
            Standing::Undecided => "undecided",
        }
    }
}

/// What decides a verdict, as data: `lynkeus-words` has the sentences.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// every operation has a value everywhere on the box, and none jumps
    Regular,
    /// an operation has no value on a part of the box, or may have none
    NoValue {
        /// as a person would write it
        operation: String,
        /// the part
        place: Place,
        /// it certainly has none there
        certain: bool,
    },
    /// an operation jumps on a part of the box, or may jump
    Jumps {
        /// as a person would write it
        operation: String,
        /// the part
        place: Place,
    },
    /// a delay of the plant is held by a few states, which is not all of it
    Delayed {
        /// as it stands in the model
        delay: String,
        /// how many states
        states: usize,
    },
    /// the state jumps at events
    StateJumps {
        /// line of the first `when`
        line: usize,
    },
    /// the values of an expression lie in a range
    Lies {
        /// as a person would write it
        expression: String,
        /// its least value
        low: f64,
        /// its greatest value
        high: f64,
        /// the range does not decide, and is the best there is
        open: bool,
        /// variables without a declared end that keep it wide
        undeclared: Vec<String>,
    },
    /// this expression can vanish or change its sign
    Vanishes(String),
    /// the sign changes as said, but no zero is between
    ByJump(Box<Reason>),
    /// this keeps the mean value theorem from applying
    NoMeanValue(Box<Reason>),
    /// rows of a Jacobian, taken at different points, can be dependent
    RowsApart,
    /// a matrix of so many rows and columns has too many minors
    ManyMinors(usize, usize),
    /// every minor of full size of a matrix of so many rows and columns is zero
    ZeroMinors(usize, usize),
    /// a determinant is zero by the zeros of the matrix
    ZeroDeterminant,
    /// a determinant vanishes or changes its sign
    DeterminantVanishes,
    /// the size of a determinant lies in a range
    Determinant {
        /// its least value
        low: f64,
        /// its greatest value
        high: f64,
        /// the range does not decide, and is the best there is
        open: bool,
    },
    /// the ranges of its entries keep a matrix regular on each of so many parts of the box
    RegularParts(usize),
    /// so many parts of the box do not decide for a matrix of so many rows
    OpenParts(usize, usize),
    /// F_k of the form that is affine block by block
    Factor {
        /// k
        k: usize,
        /// of so many rows and columns
        size: (usize, usize),
        /// what it shows of the states behind it
        shows: Shown,
    },
    /// state by state, along slopes that keep their sign
    StateByState,
    /// the ranges of a map and its Jacobian tell all points apart, on so many pairs of parts of the box
    PairsApart(usize),
    /// two points have the same values: exactly, or to twelve digits
    Alike(bool),
    /// whether the outputs distinguish points far apart is not decided
    FarApart,
    /// what breaks a form
    Misfit(Box<Misfit>),
}

impl From<Misfit> for Reason {
    fn from(misfit: Misfit) -> Self {
        Self::Misfit(Box::new(misfit))
    }
}

/// What a factor of the form that is affine block by block shows of the states behind it.
#[derive(Clone, Debug, PartialEq)]
pub enum Shown {
    /// constant, with independent columns
    Always,
    /// constant, and hides a direction
    Never,
    /// constant, and rounding keeps from telling
    Unknown,
    /// it has less rank than columns, and its entries move
    WhileMoving,
    /// the determinant of FᵀF vanishes or changes its sign there
    NotAt(Witness),
    /// what decides it of the determinant of FᵀF
    Gram(Box<Reason>),
}

/// What was found of a statement. Which statement, whoever asked knows.
#[derive(Clone, Debug, PartialEq)]
pub struct Finding {
    /// the verdict
    pub verdict: Verdict,
    /// what decides it
    pub reason: Reason,
}

impl Finding {
    /// It holds.
    pub fn proved(reason: Reason) -> Self {
        Self {
            verdict: Verdict::Proved,
            reason,
        }
    }

    /// It is not known to hold; nor where it might fail.
    pub fn undecided(reason: Reason) -> Self {
        Self {
            verdict: Verdict::open(),
            reason,
        }
    }

    /// It fails.
    pub fn refuted(witness: impl Into<Witness>, reason: Reason) -> Self {
        Self {
            verdict: Verdict::Refuted(witness.into()),
            reason,
        }
    }

    /// By a condition that is sufficient, not necessary: that it fails refutes nothing.
    pub fn sufficient(holds: bool, reason: Reason) -> Self {
        if holds {
            Self::proved(reason)
        } else {
            Self::undecided(reason)
        }
    }

    /// Whether the statement is proved.
    pub fn is_proved(&self) -> bool {
        self.verdict == Verdict::Proved
    }
}
