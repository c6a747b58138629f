//! What is stated of a plant or an observer, and what was found of it.
//!
//! A statement is known by its variant, never by its words: these are for people.

mod inequality;
mod papers;

use std::fmt;

use lynkeus_structure::{Finding, Standing, Verdict, Witness};

pub use inequality::Inequality;
pub use papers::{Farza, Germani, Hammouri, Lee, Ltaief};

/// What has to hold: a condition of a family or a hypothesis of a theorem.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Statement {
    /// f and h have values on the box and do not jump: asked of every plant
    PlantIsRegular,
    /// what a certificate counts has bounds: asked where anything acts
    WhatActs,
    /// no reading is beyond what its sensor can show
    ReadingsAreShown,
    /// the work came to its end: asked where a limit ended it
    Finished,
    /// a partial derivative along a chain keeps its sign
    PartialKeepsSign {
        /// the state whose equation it is of
        of: String,
        /// the state by which it is
        by: String,
    },
    /// the slope of an output in the state that it shows keeps its sign
    OutputKeepsSign {
        /// the output
        output: String,
        /// the state
        state: String,
    },
    /// ∂f/∂x is bounded on the box
    Lipschitz,
    /// every ∂f/∂x that a proof meets is bounded on the box
    SlopesOfTheProof,
    /// of the certificate by linear matrix inequalities
    Inequality(Inequality),
    /// the error of a Kalman filter decays: no theorem says so
    FilterConverges,
    /// of the family `triangular`
    Hammouri(Hammouri),
    /// of the family `block-triangular`
    Lee(Lee),
    /// of the family `state-affine`
    Ltaief(Ltaief),
    /// of the family `unknown-input`
    Farza(Farza),
    /// of the family `drift-observable`
    Germani(Germani),
}

/// A statement with its verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// what has to hold
    pub statement: Statement,
    /// the verdict
    pub verdict: Verdict,
    /// what was found, in words
    pub detail: String,
    /// what it weighs
    pub weight: Weight,
}

/// What a condition weighs.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Weight {
    /// where it is refuted the whole is
    Required,
    /// it can leave the whole undecided and refuses nothing, as where the observer itself
    /// watches it
    Advisory,
}

impl Check {
    /// What it makes of the whole.
    pub fn standing(&self) -> Standing {
        match self.weight {
            Weight::Required => self.verdict.standing(),
            Weight::Advisory => self.verdict.standing().min(Standing::Undecided),
        }
    }

    /// Whether the statement is proved.
    pub fn is_proved(&self) -> bool {
        self.verdict == Verdict::Proved
    }

    /// The same as [`Weight::Advisory`].
    pub(crate) fn advisory(self) -> Self {
        let weight = Weight::Advisory;
        Self { weight, ..self }
    }
}

/// That of a list of conditions: refuted if a required one is, undecided if one is not proved.
pub(crate) fn standing<'a>(checks: impl IntoIterator<Item = &'a Check>) -> Standing {
    Standing::of_all(checks.into_iter().map(Check::standing))
}

impl Statement {
    /// What was found of it.
    pub(crate) fn with(self, found: Finding) -> Check {
        Check {
            statement: self,
            verdict: found.verdict,
            detail: found.detail,
            weight: Weight::Required,
        }
    }
}

pub(crate) fn proved(statement: impl Into<Statement>, detail: impl Into<String>) -> Check {
    statement.into().with(Finding::proved(detail))
}

/// A hypothesis that could not be established, or that a sufficient condition misses.
pub(crate) fn undecided(statement: impl Into<Statement>, detail: impl Into<String>) -> Check {
    statement.into().with(Finding::undecided(detail))
}

pub(crate) fn refuted(
    statement: impl Into<Statement>,
    witness: impl Into<Witness>,
    detail: impl Into<String>,
) -> Check {
    statement.into().with(Finding::refuted(witness, detail))
}

/// By a condition that is sufficient: that it fails refutes nothing.
pub(crate) fn sufficient(
    statement: impl Into<Statement>,
    holds: bool,
    detail: impl Into<String>,
) -> Check {
    statement.into().with(Finding::sufficient(holds, detail))
}

impl fmt::Display for Statement {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PlantIsRegular => {
                f.write_str("f and h have values on the whole box and do not jump")
            }
            Self::WhatActs => f.write_str("disturbances and measurement errors are bounded"),
            Self::ReadingsAreShown => f.write_str("no reading is beyond its sensor's range"),
            Self::Finished => f.write_str("everything was examined"),
            Self::PartialKeepsSign { of, by } => write!(f, "∂f({of})/∂{by} keeps its sign"),
            Self::OutputKeepsSign { output, state } => {
                write!(f, "∂{output}/∂{state} keeps its sign")
            }
            Self::Lipschitz => f.write_str("∂f/∂x is bounded on the box"),
            Self::SlopesOfTheProof => {
                f.write_str("every ∂f/∂x of the proof has a bound on the box")
            }
            Self::FilterConverges => f.write_str("the filter's error decays"),
            Self::Inequality(part) => part.fmt(f),
            Self::Hammouri(part) => part.fmt(f),
            Self::Lee(part) => part.fmt(f),
            Self::Ltaief(part) => part.fmt(f),
            Self::Farza(part) => part.fmt(f),
            Self::Germani(part) => part.fmt(f),
        }
    }
}

impl fmt::Display for Check {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}: {} ({})", self.statement, self.verdict, self.detail)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_structure::Point;

    /// Whatever is said of an advisory condition, it refutes nothing.
    #[test]
    fn an_advisory_condition_leaves_the_whole_undecided() {
        let zero = Point {
            coordinates: vec![],
            value: 0.0,
        };
        let failing = || refuted(Germani::UniformlyObservable, zero.clone(), "");
        let holding = || proved(Germani::Regular, "");
        for (checks, expected) in [
            (vec![], Standing::Proved),
            (vec![holding(), holding()], Standing::Proved),
            (vec![holding(), failing().advisory()], Standing::Undecided),
            (vec![failing(), holding()], Standing::Refuted),
            (
                vec![undecided(Germani::Degree, ""), failing().advisory()],
                Standing::Undecided,
            ),
            (vec![holding().advisory()], Standing::Proved),
        ] {
            assert_eq!(standing(&checks), expected, "{checks:?}");
        }
    }
}
