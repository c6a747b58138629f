//! What the family states and says, as data.

use lynkeus_structure::output_map::Degree;
use lynkeus_structure::{Finding, Reason, Standing};

/// What is stated: conditions of the family and hypotheses of the theorem.
#[derive(Clone, Debug, PartialEq)]
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
    /// in place of the last three: one P for the Jacobians as they come together
    OneFunction,
}

/// What is said of a plant, a verdict, an observer or a certificate of the family.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// the state from derivatives of the outputs
    Form {
        /// which observer
        variant: &'static str,
        /// these derivatives
        map: Vec<String>,
        /// the inputs and derivatives of inputs that they read
        inputs: Vec<String>,
        /// how many derivatives of each output count
        indices: Vec<usize>,
        /// the choices that were not taken, with what is known of each
        others: Others,
    },
    /// with u = 0 the outputs and their derivatives do not determine the state
    Blind {
        /// combinations of states that they determine
        rank: usize,
        /// states
        of: usize,
        /// states that no output feels, whatever the inputs
        hidden: Vec<String>,
    },
    /// the relative degree of outputs in each input
    Degrees {
        /// by the output's name
        found: Vec<(String, Degree)>,
        /// the zeros before r are proved
        are_proved: bool,
    },
    /// inputs that (3.1) takes no account of
    InputsNotCounted,
    /// whether Q̄ is regular for the inputs
    Inputs {
        /// what was found
        reason: Reason,
        /// of the derivatives that it reads, by their names
        bounds: Vec<(String, f64)>,
        /// whatever the inputs are
        is_proved: bool,
    },
    /// the inputs whose derivatives have no bounds; none, and they are assumed
    InputDerivatives(Vec<String>),
    /// what the proof meets and the observer passes
    OnlyOfTheProof(Finding),
    /// Lipschitz constants of the map and of its inverse
    Map {
        /// γ_Φ
        map: f64,
        /// γ_Φ⁻¹
        inverse: f64,
    },
    /// no inverse for means of the Jacobian; what has no bound
    NoInverse(Vec<String>),
    /// the Lipschitz constant of the last rows
    LastRows(f64),
    /// it has no bound; nor have these
    NoLastRows(Vec<String>),
    /// γ has no bound
    NoLipschitzConstant,
    /// the study has no poles
    NoPoles,
    /// no P for the poles
    NoP,
    /// V falls on the whole box
    Falls {
        /// at this rate
        rate: f64,
        /// examined part by part, so many
        parts: usize,
    },
    /// no P_a for those of the filter
    NoFilterP,
    /// how many derivatives of each of several outputs are used
    Indices(Vec<(String, usize)>),
    /// derivatives of inputs that (4.1) needs exactly
    ExactDerivatives(Vec<String>),
    /// (3.1) where inputs appear early
    SmallInputsOnly,
    /// the box of a proof; whether the filter's estimates are in it
    Box {
        /// for (4.22)
        with_filter: bool,
    },
    /// unknown inputs without bounds of their rates
    TakenAsConstant(Vec<String>),
    /// where the correction is withdrawn
    Withdrawn,
}

/// Indices that were not chosen, with what is known of them.
pub type Others = Vec<(Vec<usize>, Known)>;

/// What is known of indices that were not chosen.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Known {
    /// every condition was looked at
    Examined(Standing),
    /// det Q has both signs at points of the box
    Singular,
    /// nothing
    Open,
}
