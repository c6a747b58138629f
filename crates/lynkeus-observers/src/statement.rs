//! What is stated of a plant or an observer, and what was found of it.
//!
//! A statement is known by its variant, never by its words: these are for people. Each paper
//! has an enum of its own, as has the certificate by linear matrix inequalities.

use derive_more::From;
use lynkeus_expr::{Interval, Spent};
use lynkeus_structure::{Finding, Misfit, Standing, Verdict, Witness};

use crate::block_triangular::{Lee, Said as SaidOfBlockTriangular};
use crate::drift_observable::{Germani, Said as SaidOfDriftObservable};
use crate::guarantee::{Inequality, Said as SaidOfGuarantee};
use crate::state_affine::{Ltaief, Said as SaidOfStateAffine};
use crate::triangular::{Hammouri, Said as SaidOfTriangular};
use crate::unknown_input::{Farza, Said as SaidOfUnknownInput};

/// What has to hold: a condition of a family or a hypothesis of a theorem.
#[derive(Clone, Debug, PartialEq, From)]
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
    #[from]
    Inequality(Inequality),
    /// the error of a Kalman filter decays: no theorem says so
    FilterConverges,
    /// of the family `triangular`
    #[from]
    Hammouri(Hammouri),
    /// of the family `block-triangular`
    #[from]
    Lee(Lee),
    /// of the family `state-affine`
    #[from]
    Ltaief(Ltaief),
    /// of the family `unknown-input`
    #[from]
    Farza(Farza),
    /// of the family `drift-observable`
    #[from]
    Germani(Germani),
}

/// What is said of a plant, a verdict, an observer or a certificate, as data: `lynkeus-words` has
/// the sentences.
#[derive(Clone, Debug, PartialEq, From)]
pub enum Reason {
    /// found in the structure of the plant
    #[from(lynkeus_structure::Reason, Misfit)]
    Structure(lynkeus_structure::Reason),
    /// a number that has to be at most a limit, and is or not
    AtMost {
        /// the number
        found: f64,
        /// what it is held against
        limit: f64,
    },
    /// a number that has to be at least another, and is or not
    AtLeast {
        /// the number
        found: f64,
        /// what it is held against
        least: f64,
    },
    /// a limit ended the work
    Spent(Spent),
    /// a limit ended an examination, so that the whole is undecided
    Ended(Spent),
    /// so many entries of ∂f/∂x have bounds
    Enclosed(usize),
    /// an entry of ∂f/∂x without bound
    Unbounded {
        /// the state whose equation it is of
        of: String,
        /// the state by which it is
        by: String,
        /// the entry
        slope: String,
        /// what keeps it from being bounded; none where that is not looked for
        undeclared: Option<Vec<String>>,
    },
    /// an equation jumps
    Switches {
        /// the state whose equation it is
        of: String,
        /// the operation
        with: String,
    },
    /// what would refute lies where an equation has no value
    WhereNothingIs {
        /// what was found there
        found: lynkeus_structure::Reason,
        /// the state whose equation it is
        of: String,
    },
    /// the declared ranges and deviations are
    Assumed,
    /// what acts on these has no bound
    ActsWithoutBound(Vec<String>),
    /// by the outputs on the box and the measurement errors
    ReadingsOnTheBox,
    /// outputs that leave what their sensors show: name, the reading's range, the sensor's
    BeyondSensors(Vec<(String, Interval, Interval)>),
    /// process noise leaves no bound for certain
    Moved {
        /// the states that it moves
        states: Vec<String>,
        /// whether the mean square has a bound
        in_mean_square: bool,
    },
    /// what the error would end within without process noise
    WithoutNoise {
        /// of the Euclidean norm
        norm: f64,
        /// by state; none where not known
        states: Vec<(String, f64)>,
    },
    /// the proof has a rate, and no bound in the end
    NoUltimateBound,
    /// what holds for every start of the estimate, by the prolongation
    EveryStart,
    /// what would hold so on the declared box, of which this one is a part
    PartOfTheBox,
    /// what holds while plant and estimate stay in the box
    InTheBox {
        /// the functions see the estimate limited to it
        clamp: bool,
    },
    /// a key of the study that makes an observer which the theorem does not cover
    AnotherObserver {
        /// the key
        key: &'static str,
    },
    /// the low-power form is not proved to be stable for these partials
    PartialsVary {
        /// of the chain of this output
        output: String,
    },
    /// a filter takes any plant: this one
    AnyPlant(&'static str),
    /// the gain of a filter depends on the run
    GainOfTheRun,
    /// of the certificate by linear matrix inequalities
    #[from]
    Guarantee(SaidOfGuarantee),
    /// of the family `triangular`
    #[from]
    Triangular(SaidOfTriangular),
    /// of the family `block-triangular`
    #[from]
    BlockTriangular(SaidOfBlockTriangular),
    /// of the family `state-affine`
    #[from]
    StateAffine(SaidOfStateAffine),
    /// of the family `unknown-input`
    #[from]
    UnknownInput(SaidOfUnknownInput),
    /// of the family `drift-observable`
    #[from]
    DriftObservable(SaidOfDriftObservable),
}

/// A statement with its verdict.
#[derive(Clone, Debug, PartialEq)]
pub struct Check {
    /// what has to hold
    pub statement: Statement,
    /// the verdict
    pub verdict: Verdict,
    /// what decides it
    pub reason: Reason,
    /// it can leave the whole undecided and refutes nothing, as where the observer itself watches it
    pub is_advisory: bool,
}

impl Check {
    /// What it makes of the whole.
    pub fn standing(&self) -> Standing {
        let most = match self.is_advisory {
            true => Standing::Undecided,
            false => Standing::Refuted,
        };
        self.verdict.standing().min(most)
    }

    /// Whether the statement is proved.
    pub fn is_proved(&self) -> bool {
        self.verdict == Verdict::Proved
    }

    /// The same as advice.
    pub(crate) fn advisory(self) -> Self {
        Self {
            is_advisory: true,
            ..self
        }
    }
}

/// That of a list of conditions: refuted if a required one is, undecided if one is not proved.
pub(crate) fn standing<'a>(checks: impl IntoIterator<Item = &'a Check>) -> Standing {
    Standing::of_all(checks.into_iter().map(Check::standing))
}

impl Statement {
    /// What was found of it.
    pub(crate) fn with(self, found: Finding) -> Check {
        self.found(found.verdict, found.reason)
    }

    /// The statement with its verdict.
    pub(crate) fn found(self, verdict: Verdict, reason: impl Into<Reason>) -> Check {
        Check {
            statement: self,
            verdict,
            reason: reason.into(),
            is_advisory: false,
        }
    }
}

pub(crate) fn proved(statement: impl Into<Statement>, reason: impl Into<Reason>) -> Check {
    statement.into().found(Verdict::Proved, reason)
}

/// A hypothesis that could not be established, or that a sufficient condition misses.
pub(crate) fn undecided(statement: impl Into<Statement>, reason: impl Into<Reason>) -> Check {
    statement.into().found(Verdict::open(), reason)
}

pub(crate) fn refuted(
    statement: impl Into<Statement>,
    witness: impl Into<Witness>,
    reason: impl Into<Reason>,
) -> Check {
    statement
        .into()
        .found(Verdict::Refuted(witness.into()), reason)
}

/// By a condition that is sufficient: that it fails refutes nothing.
pub(crate) fn sufficient(
    statement: impl Into<Statement>,
    holds: bool,
    reason: impl Into<Reason>,
) -> Check {
    let verdict = match holds {
        true => Verdict::Proved,
        false => Verdict::open(),
    };
    statement.into().found(verdict, reason)
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
        let failing = || refuted(Germani::UniformlyObservable, zero.clone(), Reason::Assumed);
        let holding = || proved(Germani::Regular, Reason::Assumed);
        for (checks, expected) in [
            (vec![], Standing::Proved),
            (vec![holding(), holding()], Standing::Proved),
            (vec![holding(), failing().advisory()], Standing::Undecided),
            (vec![failing(), holding()], Standing::Refuted),
            (
                vec![
                    undecided(Germani::Degree, Reason::Assumed),
                    failing().advisory(),
                ],
                Standing::Undecided,
            ),
            (vec![holding().advisory()], Standing::Proved),
        ] {
            assert_eq!(standing(&checks), expected, "{checks:?}");
        }
    }
}
