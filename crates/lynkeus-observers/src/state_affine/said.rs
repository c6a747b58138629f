//! What the family states and says, as data.

/// What is stated: conditions of the family and hypotheses of the theorem.
#[derive(Clone, Debug, PartialEq)]
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

/// What is said of a plant, a verdict, an observer or a certificate of the family.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// a plant in blocks
    Form {
        /// names of the states, block by block
        blocks: Vec<Vec<String>>,
        /// which inputs suffice depends on their excitation
        depends_on_inputs: bool,
    },
    /// an uncertainty acts in front of the last block
    OutsideLast {
        /// on these states
        states: Vec<String>,
        /// the last block
        last: Vec<String>,
    },
    /// every entry of C and F has a bound
    Enclosed,
    /// one has none
    NoBound {
        /// the entry
        entry: String,
        /// what it needs bounds of
        undeclared: Vec<String>,
    },
    /// the drift is bounded as it is assumed
    Drift {
        /// unknown inputs that it takes as constant
        constant: Vec<String>,
    },
    /// a state without a bound of its drift
    NoDrift(String),
    /// λ_m of a plant whose C and F are numbers
    Excited {
        /// the bound
        λ: f64,
        /// times θ: the time from which it holds
        from: f64,
    },
    /// A4 is watched
    Watched {
        /// below this the monitor raises its flag
        alarm: f64,
        /// no block hides a direction at any instant
        always_shown: bool,
    },
    /// μ_θ at the study's θ
    Rate {
        /// what it is
        μ: f64,
        /// from where on it is positive
        θ0: Option<f64>,
        /// λ_m does not fall as θ grows
        is_lasting: bool,
        /// it is positive
        is_proved: bool,
    },
}
