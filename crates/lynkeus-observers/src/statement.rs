//! What is stated of a plant or an observer, and what was found of it.
//!
//! A statement is known by its variant, never by its words: these are for people. Each paper
//! has an enum of its own, as has the certificate by linear matrix inequalities.

use std::fmt;

use lynkeus_structure::{Finding, Standing, Verdict, Witness, short};

use crate::drift_observable::Germani;
use crate::state_affine::Ltaief;
use crate::unknown_input::Farza;
use crate::{drift_observable, state_affine, unknown_input};

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

/// What is said of a plant, a verdict, an observer or a certificate, as data: `lynkeus-words` has
/// the sentences.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// a sentence that is not data yet
    Text(String),
    /// found in the structure of the plant
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
    /// of the family `state-affine`
    StateAffine(state_affine::Said),
    /// of the family `unknown-input`
    UnknownInput(unknown_input::Said),
    /// of the family `drift-observable`
    DriftObservable(drift_observable::Said),
}

impl Reason {
    /// The sentence.
    pub fn text(self) -> String {
        match self {
            Self::Text(text) => text,
            Self::Structure(reason) => reason.text(),
            said => format!("{said:?}"),
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

impl From<lynkeus_structure::Reason> for Reason {
    fn from(reason: lynkeus_structure::Reason) -> Self {
        Self::Structure(reason)
    }
}

impl From<state_affine::Said> for Reason {
    fn from(said: state_affine::Said) -> Self {
        Self::StateAffine(said)
    }
}

impl From<unknown_input::Said> for Reason {
    fn from(said: unknown_input::Said) -> Self {
        Self::UnknownInput(said)
    }
}

impl From<drift_observable::Said> for Reason {
    fn from(said: drift_observable::Said) -> Self {
        Self::DriftObservable(said)
    }
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
        self.found(found.verdict, found.reason)
    }

    /// The statement with its verdict.
    pub(crate) fn found(self, verdict: Verdict, reason: impl Into<Reason>) -> Check {
        Check {
            statement: self,
            verdict,
            reason: reason.into(),
            weight: Weight::Required,
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
            Self::Ltaief(part) => write!(f, "{part:?}"),
            Self::Farza(part) => write!(f, "{part:?}"),
            Self::Germani(part) => write!(f, "{part:?}"),
        }
    }
}

/// Of Hammouri, Targui and Armanet.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Hammouri {
    /// the theorem is about this observer
    Observer,
    /// no division by partials that vary
    ConstantGain,
    /// what Lemma 1 starts from
    PartialsAreBounded,
    /// (17) for one chain
    Lemma1 {
        /// the chain
        states: Vec<String>,
        /// 2r
        ρ: f64,
    },
    /// of the exponents
    Window,
    /// θ is large enough
    Theta {
        /// of the study
        θ: f64,
    },
    /// where the chains have a θ each
    Comparison,
    /// where the S given does not stabilise the chains by itself
    Damped,
}

impl From<Hammouri> for Statement {
    fn from(part: Hammouri) -> Self {
        Self::Hammouri(part)
    }
}

impl fmt::Display for Hammouri {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Observer => {
                f.write_str("the observer is (9) with a constant gain from a tridiagonal S")
            }
            Self::ConstantGain => f.write_str("the gain is constant"),
            Self::PartialsAreBounded => {
                f.write_str("Lemma 1: every partial along the chains lies in some [α1, α2], α1 > 0")
            }
            Self::Lemma1 { states, ρ } => write!(
                f,
                "Lemma 1 for ({}): A(a)ᵀS + SA(a) − ρCᵀC < 0 for every a in its bounds, ρ = 2r = {}",
                states.join(" → "),
                short(*ρ)
            ),
            Self::Window => f.write_str("δ2/δ1 lies in the window of Theorem 2"),
            Self::Theta { θ } => write!(f, "θ = {} is at least θ0", short(*θ)),
            Self::Comparison => {
                f.write_str("the comparison matrix is negative definite at the study's θ")
            }
            Self::Damped => {
                f.write_str("the error decays where it is small, in the middle of the box")
            }
        }
    }
}

/// Of Lee, Yee and Park.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Lee {
    /// the theorem is about these observers
    Observer,
    /// K stabilises a chain of integrators
    Stable {
        /// the chain
        states: Vec<String>,
    },
    /// K stabilises a chain whose partials are not 1
    StableAlong {
        /// the chain
        states: Vec<String>,
    },
    /// what moves M is bounded
    Assumption1,
    /// the first inequality
    Lyapunov {
        /// the chain
        states: Vec<String>,
    },
    /// the second inequality
    Theta {
        /// by block
        θ: Vec<f64>,
    },
}

impl From<Lee> for Statement {
    fn from(part: Lee) -> Self {
        Self::Lee(part)
    }
}

impl fmt::Display for Lee {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Observer => f.write_str("the observer is (7) or (3) with a constant θ"),
            Self::Stable { states } => write!(f, "A − KC is stable for ({})", states.join(" → ")),
            Self::StableAlong { states } => write!(
                f,
                "A(a) − KC is stable for every partial a along ({})",
                states.join(" → ")
            ),
            Self::Assumption1 => {
                f.write_str("M R M⁻¹ and Ṁ M⁻¹ have bounds on the box (Assumption 1)")
            }
            Self::Lyapunov { states } => {
                write!(f, "(A − KC)ᵀP + P(A − KC) < 0 for ({})", states.join(" → "))
            }
            Self::Theta { θ } => write!(
                f,
                "θ = ({}) is large enough",
                θ.iter().map(|&θ| short(θ)).collect::<Vec<_>>().join(", ")
            ),
        }
    }
}

impl From<Ltaief> for Statement {
    fn from(part: Ltaief) -> Self {
        Self::Ltaief(part)
    }
}

impl From<Farza> for Statement {
    fn from(part: Farza) -> Self {
        Self::Farza(part)
    }
}

impl From<Germani> for Statement {
    fn from(part: Germani) -> Self {
        Self::Germani(part)
    }
}

/// Of the certificate by linear matrix inequalities.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
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

impl From<Inequality> for Statement {
    fn from(part: Inequality) -> Self {
        Self::Inequality(part)
    }
}

impl fmt::Display for Inequality {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StatesAreTheEstimate => f.write_str("the observer's states are the estimate"),
            Self::SlopesAreBounded => {
                f.write_str("every slope of a nonlinear term is bounded on the box")
            }
            Self::OneLyapunovFunction => {
                f.write_str("one Lyapunov function eᵀPe for the whole box")
            }
            Self::SmallErrorsDecay => {
                f.write_str("small errors decay wherever the plant stays in the box")
            }
        }
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
