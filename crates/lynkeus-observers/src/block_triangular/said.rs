//! What the family states and says, as data.

/// Which observer of the paper.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Correction {
    /// (7)
    Lee,
    /// (3)
    Classical,
}

/// What is stated: conditions of the family and hypotheses of the theorem of Lee, Yee and Park.
#[derive(Clone, Debug, PartialEq)]
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

/// What is said of a plant, a verdict, an observer or a certificate of the family.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// observer (7) has no low-power form
    OnlyClassical,
    /// the chains
    Form {
        /// their states, in the order of the blocks
        chains: Vec<Vec<String>>,
        /// which observer
        correction: Correction,
        /// the partials along the chains are 1
        ones: bool,
        /// they are numbers
        numbers: bool,
        /// how many orders of these chains the equations allow
        orders: usize,
    },
    /// a partial is not known to keep one sign
    SignUnknown,
    /// the eigenvalues of A − KC
    Eigenvalues(Vec<(f64, f64)>),
    /// they are not all stable
    Unstable {
        /// the eigenvalues
        eigenvalues: Vec<(f64, f64)>,
        /// the K of the chain that would do, where the one given is made for partials that are 1
        divided: Option<Vec<f64>>,
    },
    /// one Lyapunov function for all of the partials' bounds
    OneLyapunovFunction,
    /// there is none found
    NoLyapunovFunction {
        /// the eigenvalues in the middle of the bounds
        eigenvalues: Vec<(f64, f64)>,
    },
    /// θ breaks the rule of Lemma 2
    BreaksRule {
        /// θ of the later chain
        later: f64,
        /// of the chain before it
        before: f64,
        /// and its number of states
        count: usize,
        /// what the later one needs to be
        needed: f64,
    },
    /// M R M⁻¹ or Ṁ M⁻¹ has no bound
    NoBounds,
    /// the first inequality holds with this μ
    Decays(f64),
    /// it does not
    NoDecay,
    /// the second inequality holds
    NegativeDefinite,
    /// it does not, but from this θ on
    Threshold(Option<f64>),
    /// that M moves with the correction
    MovingM,
}
