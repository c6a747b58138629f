//! What is stated of a plant or an observer, and what was found of it.
//!
//! A statement is known by its variant, never by its words: these are for people. Each paper
//! has an enum of its own, as has the certificate by linear matrix inequalities.

use std::fmt;

use lynkeus_structure::{Finding, Standing, Verdict, Witness, short};

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

/// What decides a verdict, as data: `lynkeus-words` has the sentences.
#[derive(Clone, Debug, PartialEq)]
pub enum Reason {
    /// a sentence that is not data yet
    Text(String),
    /// found in the structure of the plant
    Structure(lynkeus_structure::Reason),
}

impl Reason {
    /// The sentence.
    pub fn text(self) -> String {
        match self {
            Self::Text(text) => text,
            Self::Structure(reason) => reason.text(),
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
            Self::Ltaief(part) => part.fmt(f),
            Self::Farza(part) => part.fmt(f),
            Self::Germani(part) => part.fmt(f),
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

/// Of Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Ltaief {
    /// F_k hides no direction of the next block
    BlockShows {
        /// k, counted from 0
        factor: usize,
        /// the block, as declared
        states: Vec<String>,
    },
    /// bounds of C and F
    A1,
    /// bounds of the uncertainty
    A3,
    /// the excitation
    A4,
    /// θ is large enough
    Theta {
        /// of the study
        θ: f64,
    },
}

impl From<Ltaief> for Statement {
    fn from(part: Ltaief) -> Self {
        Self::Ltaief(part)
    }
}

impl fmt::Display for Ltaief {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::BlockShows { factor, states } => write!(
                f,
                "F_{factor} ξ ≠ 0 for every direction ξ of ({})",
                states.join(", ")
            ),
            Self::A1 => f.write_str("C(u) and F(u, x) are bounded on the box (A1)"),
            Self::A3 => {
                f.write_str("what acts on the plant unknown to the observer is bounded (A3)")
            }
            Self::A4 => f.write_str("persistent excitation (A4): S(t) ≥ λ_m I"),
            Self::Theta { θ } => write!(f, "θ = {} is large enough: μ_θ > 0", short(*θ)),
        }
    }
}

/// Of Farza, M'Saad, Liu and Targui.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Farza {
    /// rank of a layer in the next
    H1 {
        /// counted from 1
        layer: usize,
        /// states of the next layer
        rank: usize,
    },
    /// a layer tells the next
    H2 {
        /// counted from 1
        layer: usize,
    },
    /// the unknown inputs show in x₁¹
    H4i {
        /// number of unknown inputs
        rank: usize,
    },
    /// they and the next layer do together
    H4ii {
        /// states of the second layer and unknown inputs
        rank: usize,
    },
    /// the rest of the outputs tells the second layer
    Eleven {
        /// states of the second layer
        rank: usize,
    },
    /// a chain that ends early
    ShortenedChain {
        /// the last of the chain
        layer: usize,
        /// how many there are
        gains: usize,
    },
    /// what Λ₂⁺ leaves out does no harm
    LeftInverse,
    /// the proof meets Λ₂ there
    Regular,
    /// G₁¹, Λ₂ and Z
    Continuous,
    /// of the proof
    Constants,
    /// the unknown inputs are slow
    H5,
    /// the study gives θ
    ThetaGiven,
    /// θ₁ is large enough
    Theta1,
    /// θ₂ is large enough
    Theta2,
    /// by more than rounding
    Rate,
}

impl From<Farza> for Statement {
    fn from(part: Farza) -> Self {
        Self::Farza(part)
    }
}

impl fmt::Display for Farza {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::H1 { layer, rank } => write!(
                f,
                "(H1) rank ∂f{}/∂x{} = {rank}",
                superscript(*layer),
                superscript(layer + 1)
            ),
            Self::H2 { layer } => write!(
                f,
                "(H2) x{} ↦ f{} is one to one",
                superscript(layer + 1),
                superscript(*layer)
            ),
            Self::H4i { rank } => write!(f, "(H4) (i) rank G₁¹ = {}", rank),
            Self::H4ii { rank } => write!(f, "(H4) (ii) rank (∂f̃¹/∂x² G¹) = {}", rank),
            Self::Eleven { rank } => write!(f, "(11) rank ∂f̄₁²/∂x² = {}", rank),
            Self::ShortenedChain { layer, gains } => write!(
                f,
                "the chain that ends in layer {layer} is stable with the first {layer} of the gains of {gains}: Routh's numbers are positive"
            ),
            Self::LeftInverse => {
                f.write_str("Λ₂Λ₂⁺ = I, or it leaves whole chains: the step to (24)")
            }
            Self::Regular => {
                f.write_str("Λ₂ is regular for estimates that differ from the measured signals")
            }
            Self::Continuous => {
                f.write_str("what the proof differentiates has values on the box and does not jump")
            }
            Self::Constants => f.write_str("c1, c2, c4 and c5 are finite on the box"),
            Self::H5 => f.write_str("(H5) v' is bounded"),
            Self::ThetaGiven => f.write_str("θ1 ≥ θ1*"),
            Self::Theta1 => f.write_str("θ1 ≥ θ1* = c1 + (c2 + c5)²θ2²/(4(θ2 − c4))"),
            Self::Theta2 => f.write_str("θ2 ≥ θ2* = max(1, c4)"),
            Self::Rate => f.write_str("λ > 0"),
        }
    }
}

/// Of Germani and Manes.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Germani {
    /// Definition 2.2
    Degree,
    /// drift-observability
    Regular,
    /// the same for points far apart: Definition 2.1 asks for a diffeomorphism
    OneToOne,
    /// Φ̄ along the plant
    Continuous,
    /// what (3.1) asks of the input
    SmallInput,
    /// what (4.1) and (4.22) ask of the input
    UniformlyObservable,
    /// the same for bounded inputs
    RegularWithin,
    /// the remainder
    ContinuousRows,
    /// u, u', …
    InputDerivatives,
    /// hypothesis 1
    Inverse,
    /// hypothesis 2
    LastRows,
    /// there are gains
    Gains,
    /// hypothesis 4
    Riccati,
    /// the same with the input
    Input,
    /// the filter's inequality
    Filter,
}

impl From<Germani> for Statement {
    fn from(part: Germani) -> Self {
        Self::Germani(part)
    }
}

impl fmt::Display for Germani {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Degree => {
                f.write_str("the observation relative degree r is known (Definition 2.2)")
            }
            Self::Regular => f.write_str("Q(x) is regular on the box (drift-observable)"),
            Self::OneToOne => f.write_str(
                "the map to the outputs' derivatives is one-to-one on the box (Definition 2.1)",
            ),
            Self::Continuous => f.write_str(
                "the map to the outputs' derivatives has values on the box and does not jump",
            ),
            Self::SmallInput => f.write_str("r = n, or the input is small (Theorem 3.3)"),
            Self::UniformlyObservable => {
                f.write_str("Q̄(x, U) is regular on the box for every U (uniformly observable)")
            }
            Self::RegularWithin => {
                f.write_str("Q̄(x, U) is regular on the box for U within its bounds")
            }
            Self::ContinuousRows => {
                f.write_str("the last rows have values on the box and do not jump")
            }
            Self::InputDerivatives => f.write_str("the derivatives of the inputs are bounded"),
            Self::Inverse => f.write_str(
                "the map from x to the output's derivatives has a Lipschitz inverse on the box",
            ),
            Self::LastRows => f.write_str("the last rows are Lipschitz in these coordinates"),
            Self::Gains => f.write_str("K and P solve the Riccati inequality"),
            Self::Riccati => f.write_str("γ ≤ γ*: K and some P > 0 solve the Riccati inequality"),
            Self::Input => f.write_str("|u| ≤ u_M"),
            Self::Filter => f.write_str("K2 and P_a solve (4.27)"),
        }
    }
}

/// ¹, ², …
fn superscript(k: usize) -> String {
    let digit = |c: char| match c {
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        '4' => '⁴',
        '5' => '⁵',
        '6' => '⁶',
        '7' => '⁷',
        '8' => '⁸',
        '9' => '⁹',
        _ => '⁰',
    };
    k.to_string().chars().map(digit).collect()
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
