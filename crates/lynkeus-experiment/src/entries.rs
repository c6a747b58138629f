//! What answers have in common for machines: views whose fields are the entries of their JSON. What is said of
//! a field is said of the entry, in `docs/answers.schema.json` and in Python.

use lynkeus_observers::Check;
use lynkeus_structure::{self as structure, Dimension, Standing};
use lynkeus_words::Words;
use serde::{Serialize, Serializer};

/// Entries by names of the plant, in order.
pub type Named<T> = indexmap::IndexMap<String, T>;

/// A range; an end that is not declared is null.
pub type Range = [Option<f64>; 2];

/// A number that machines can read.
pub fn finite(x: f64) -> Option<f64> {
    Some(x).filter(|x| x.is_finite())
}

/// The sides of a box by their names.
pub fn sides(sides: &[Dimension]) -> Named<Range> {
    let sides = sides.iter();
    let side = |s: &Dimension| (s.name.clone(), [s.min, s.max].map(finite));
    sides.map(side).collect()
}

/// Pairs as one object.
pub(crate) fn pairs<S: Serializer>(
    pairs: &[(impl Serialize, impl Serialize)],
    to: S,
) -> Result<S::Ok, S::Error> {
    to.collect_map(pairs.iter().map(|(name, value)| (name, value)))
}

/// What is proved.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[serde(rename_all = "snake_case")]
#[allow(missing_docs, reason = "comments would be descriptions in the schema")]
pub enum Verdict {
    Proved,
    Refuted,
    Undecided,
}

impl From<Standing> for Verdict {
    fn from(standing: Standing) -> Self {
        match standing {
            Standing::Proved => Self::Proved,
            Standing::Refuted => Self::Refuted,
            Standing::Undecided => Self::Undecided,
        }
    }
}

/// Whether a theorem holds on the box.
#[derive(Clone, Copy, Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
#[allow(missing_docs, reason = "comments would be descriptions in the schema")]
pub enum Fit {
    #[serde(rename = "fits")]
    Fitting,
    #[serde(rename = "undecided")]
    Undecided,
    #[serde(rename = "does not fit")]
    Unfit,
}

impl From<Standing> for Fit {
    fn from(standing: Standing) -> Self {
        match standing {
            Standing::Proved => Self::Fitting,
            Standing::Undecided => Self::Undecided,
            Standing::Refuted => Self::Unfit,
        }
    }
}

/// A point of the box.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Point {
    /// of what is in question there
    value: Option<f64>,
    /// the point, by state and input
    at: Named<Option<f64>>,
}

impl From<&structure::Point> for Point {
    fn from(point: &structure::Point) -> Self {
        let at = point.coordinates.iter();
        Self {
            value: finite(point.value),
            at: at.map(|c| (c.name.clone(), finite(c.value))).collect(),
        }
    }
}

/// A condition of a theorem.
#[derive(Debug, Serialize)]
#[cfg_attr(feature = "schema", derive(schemars::JsonSchema))]
pub struct Condition {
    /// the condition in words
    name: String,
    /// what is proved of it on the box
    verdict: Verdict,
    /// why
    detail: String,
    /// points that refute it, where it is refuted
    #[serde(skip_serializing_if = "Option::is_none")]
    witness: Option<Vec<Point>>,
    /// the part of the box on which it is undecided, where it is
    #[serde(skip_serializing_if = "Option::is_none", rename = "box")]
    place: Option<Named<Range>>,
}

impl From<&Check> for Condition {
    fn from(check: &Check) -> Self {
        let (witness, place) = match &check.verdict {
            structure::Verdict::Proved => (None, None),
            structure::Verdict::Refuted(witness) => {
                (Some(witness.points.iter().map(Point::from).collect()), None)
            }
            structure::Verdict::Undecided(place) => (None, Some(sides(place))),
        };
        Self {
            name: check.statement.words(),
            verdict: check.verdict.standing().into(),
            detail: check.reason.words(),
            witness,
            place,
        }
    }
}
