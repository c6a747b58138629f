//! Verdicts.

use std::fmt;

use crate::words::short;

/// Where a variable is.
#[derive(Clone, Debug, PartialEq)]
pub struct Coordinate {
    /// name of the variable
    pub name: String,
    /// its value
    pub value: f64,
}

impl From<(String, f64)> for Coordinate {
    fn from((name, value): (String, f64)) -> Self {
        Self { name, value }
    }
}

/// A point of the box and the value of the expression in question there.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// of every variable the expression depends on
    pub coordinates: Vec<Coordinate>,
    /// value of the expression at the point
    pub value: f64,
}

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

    /// The points in words.
    pub(crate) fn told(&self) -> String {
        let points: Vec<String> = self.points.iter().map(Point::to_string).collect();
        points.join(" and ")
    }
}

impl From<Point> for Witness {
    fn from(point: Point) -> Self {
        Self {
            points: vec![point],
        }
    }
}

/// A variable between two ends.
#[derive(Clone, Debug, PartialEq)]
pub struct Side {
    /// name of the variable
    pub name: String,
    /// smallest value
    pub min: f64,
    /// largest value
    pub max: f64,
}

/// A part of the box, by its sides; without sides where none says more than the whole box.
pub type Place = Vec<Side>;

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
    /// a sentence that is not data yet
    Text(String),
}

impl Reason {
    /// The sentence.
    pub fn text(self) -> String {
        match self {
            Self::Text(text) => text,
        }
    }
}

impl From<String> for Reason {
    fn from(text: String) -> Self {
        Self::Text(text)
    }
}

impl From<&str> for Reason {
    fn from(text: &str) -> Self {
        Self::Text(text.to_owned())
    }
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
    pub fn proved(reason: impl Into<Reason>) -> Self {
        Self {
            verdict: Verdict::Proved,
            reason: reason.into(),
        }
    }

    /// It is not known to hold; nor where it might fail.
    pub fn undecided(reason: impl Into<Reason>) -> Self {
        Self {
            verdict: Verdict::open(),
            reason: reason.into(),
        }
    }

    /// It fails.
    pub fn refuted(witness: impl Into<Witness>, reason: impl Into<Reason>) -> Self {
        Self {
            verdict: Verdict::Refuted(witness.into()),
            reason: reason.into(),
        }
    }

    /// By a condition that is sufficient, not necessary: that it fails refutes nothing.
    pub fn sufficient(holds: bool, reason: impl Into<Reason>) -> Self {
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

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", short(self.value))?;
        for (i, Coordinate { name, value }) in self.coordinates.iter().enumerate() {
            let word = if i == 0 { " at" } else { "," };
            write!(f, "{word} {name} = {}", short(*value))?;
        }
        Ok(())
    }
}

impl fmt::Display for Witness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "it is {}", self.told())
    }
}

impl fmt::Display for Side {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Side { name, min, max } = self;
        write!(f, "{name} in [{}, {}]", short(*min), short(*max))
    }
}

impl fmt::Display for Verdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Verdict::Proved => write!(f, "proved"),
            Verdict::Refuted(witness) => write!(f, "refuted: {witness}"),
            Verdict::Undecided(place) if place.is_empty() => write!(f, "undecided"),
            Verdict::Undecided(place) => {
                let sides: Vec<String> = place.iter().map(Side::to_string).collect();
                write!(f, "undecided on {}", sides.join(", "))
            }
        }
    }
}
