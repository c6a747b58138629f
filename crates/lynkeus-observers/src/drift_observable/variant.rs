//! The three observers of the paper.

use lynkeus_expr::Node;

use crate::{Tuning, TuningError};

/// Which of the three observers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
    /// (3.1)
    Bounded,
    /// (4.1)
    Theoretical,
    /// (4.22)
    Practical,
}

impl Variant {
    const ALL: [Self; 3] = [Self::Bounded, Self::Theoretical, Self::Practical];

    pub fn word(self) -> &'static str {
        match self {
            Self::Bounded => "bounded",
            Self::Theoretical => "theoretical",
            Self::Practical => "practical",
        }
    }

    /// The least demanding one that takes account of the inputs: with r = n the
    /// three coincide, with r = n − 1 no derivative is needed (Remark 4.2).
    pub fn suited(U: &[Vec<Node>]) -> Self {
        match U.iter().map(Vec::len).max().unwrap_or(0) {
            0 => Self::Bounded,
            1 => Self::Theoretical,
            _ => Self::Practical,
        }
    }

    /// The one that stands under a key.
    pub fn read(tuning: &Tuning, key: &str) -> Result<Option<Self>, TuningError> {
        let words = Self::ALL.map(Self::word);
        let word = tuning.choice(key, &words)?;
        Ok(word.and_then(|word| Self::ALL.into_iter().find(|v| v.word() == word)))
    }
}
