//! Keys of a study, declared: name, type, default and meaning in one place, from which
//! messages, the tables of the documentation and the schema for editors come.

use crate::TuningError;

/// A key: everything that messages, documentation and editors say of it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct KeySpec {
    /// the key
    pub name: &'static str,
    /// what may stand there, in words
    pub kind: &'static str,
    /// the same for programs
    pub shape: Shape,
    /// what holds where it is absent
    pub default: &'static str,
    /// what it does
    pub meaning: &'static str,
}

/// What may stand under a key, as far as it does not depend on the plant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Shape {
    /// any finite number
    Number,
    /// a number > 0
    Positive,
    /// a number ≥ 0
    NotNegative,
    /// a number in (0, 1)
    Share,
    /// a number in [least, most]
    Between {
        /// the least
        least: f64,
        /// the most
        most: f64,
    },
    /// a whole number of at least this
    Whole(u32),
    /// true or false
    Flag,
    /// any text
    Text,
    /// one of these texts
    Word(&'static [&'static str]),
    /// a list
    List(&'static Shape),
    /// values of one shape under names of the plant
    Table(&'static Shape),
    /// values under keys of their own, in groups; those that are [`REQUIRED`] have to be there
    Section(&'static [&'static [KeySpec]]),
    /// one of several shapes
    Either(&'static [Shape]),
}

impl Shape {
    /// A number > 0, or one per chain or output.
    pub const POSITIVES: Self = Self::Either(&[Self::Positive, Self::List(&Self::Positive)]);
    /// A list of names.
    pub const NAMES: Self = Self::List(&Self::Text);
    /// A list of lists of numbers.
    pub const ROWS: Self = Self::List(&Self::List(&Self::Number));
}

/// The default of a key that has none.
pub const REQUIRED: &str = "required";

impl KeySpec {
    /// The error that `found` stands under this key.
    pub fn wrong(&self, found: impl ToString) -> TuningError {
        TuningError::new(self.name, self.kind, found)
    }

    /// The key as a row of a table of keys.
    #[must_use]
    pub fn row(&self) -> String {
        let Self {
            name,
            kind,
            default,
            meaning,
            ..
        } = self;
        format!("| `{name}` | {kind} | {default} | {meaning} |")
    }
}
