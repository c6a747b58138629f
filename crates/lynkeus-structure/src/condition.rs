//! Verdicts.

use std::fmt;

use crate::words::short;

/// A point of the box and the value of the expression in question there.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    /// (name, value) of every variable the expression depends on
    pub coordinates: Vec<(String, f64)>,
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
}

/// The verdict on a condition over the whole box.
#[derive(Clone, Debug, PartialEq)]
pub enum Condition {
    /// holds everywhere on the box, by interval arithmetic
    Proved,
    /// fails at the witness
    Refuted(Witness),
    /// neither, within the budget; the part of the box that is left
    Undecided(Vec<(String, f64, f64)>),
}

impl Condition {
    /// One word: `proved`, `refuted` or `undecided`.
    pub fn word(&self) -> &'static str {
        match self {
            Condition::Proved => "proved",
            Condition::Refuted(_) => "refuted",
            Condition::Undecided(_) => "undecided",
        }
    }
}

/// A named condition with its verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// what has to hold, e.g. `∂f(lower)/∂upper keeps its sign`
    pub name: String,
    /// the verdict
    pub verdict: Condition,
    /// what was found, in words
    pub detail: String,
}

impl fmt::Display for Point {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", short(self.value))?;
        for (i, (name, value)) in self.coordinates.iter().enumerate() {
            let word = if i == 0 { " at" } else { "," };
            write!(f, "{word} {name} = {}", short(*value))?;
        }
        Ok(())
    }
}

impl fmt::Display for Witness {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let points: Vec<String> = self.points.iter().map(Point::to_string).collect();
        write!(f, "it is {}", points.join(" and "))
    }
}

impl fmt::Display for Condition {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Condition::Proved => write!(f, "proved"),
            Condition::Refuted(witness) => write!(f, "refuted: {witness}"),
            Condition::Undecided(remaining) => {
                let sides: Vec<String> = remaining
                    .iter()
                    .map(|(name, low, high)| {
                        format!("{name} in [{}, {}]", short(*low), short(*high))
                    })
                    .collect();
                match sides.is_empty() {
                    true => write!(f, "undecided"),
                    false => write!(f, "undecided on {}", sides.join(", ")),
                }
            }
        }
    }
}
