//! What the family states and says, as data.

use lynkeus_gain::lemma1;

/// What is stated: conditions of the family and hypotheses of the theorems of Hammouri, Targui and
/// Armanet.
#[derive(Clone, Debug, PartialEq)]
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

/// What is said of a plant, a verdict, an observer or a certificate of the family.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// the chain that the study names cannot lead
    CannotLead,
    /// the chains
    Form {
        /// their states
        chains: Vec<Vec<String>>,
        /// how many assignments the equations allow
        choices: usize,
        /// how many chains can lead
        leads: usize,
        /// the output whose chain does
        leading: String,
        /// chains that the S given does not stabilise, in a plant that is damped by itself
        loose: Vec<Loose>,
    },
    /// chains that the S given does not stabilise
    Loose {
        /// the chains
        chains: Vec<Loose>,
        /// of so many states, and more than so many are too many to look into the plant's damping
        too_many: Option<(usize, usize)>,
    },
    /// δ₂/δ₁ is outside of the window
    OutsideWindow {
        /// its lower end
        low: f64,
        /// its upper end
        high: f64,
        /// the ratio
        ratio: f64,
    },
    /// the ratio of the exponents in its window, or not
    Ratio {
        /// the ratio
        ratio: f64,
        /// the lower end
        low: f64,
        /// the upper end
        high: f64,
        /// whether it is in the window
        inside: bool,
    },
    /// the partials at the estimate divide the gain
    GainVaries,
    /// a partial without bounds
    NoBounds {
        /// the partial
        partial: String,
        /// variables without declared ends that the partials depend on
        undeclared: Vec<String>,
    },
    /// how many partials have bounds, where not all do
    BoundsKnown {
        /// so many
        known: usize,
        /// of so many
        all: usize,
    },
    /// what a refuted Lemma 1 means
    LemmaRefuted,
    /// (17) cannot be evaluated
    NoKernel(lemma1::Error),
    /// (17) holds
    LemmaHolds {
        /// with this η
        η: f64,
        /// for every ρ above this
        least: f64,
    },
    /// (17) holds by less than rounding errors
    LemmaBarely,
    /// (17) holds for larger ρ only
    LemmaAbove {
        /// than this
        least: f64,
    },
    /// (17) holds for no ρ, in a direction that the sensor does not see
    LemmaBreaks {
        /// the direction, by state
        direction: Vec<(String, f64)>,
        /// the eigenvalue there
        eigenvalue: f64,
        /// whether its sign is certain
        certain: bool,
    },
    /// the threshold of θ
    Threshold {
        /// it, where it was found
        θ0: Option<f64>,
        /// whether the inequality holds at the study's θ
        holds: bool,
    },
    /// whether the comparison matrix is negative definite where the chains have a θ each
    AtTheseThetas {
        /// it is
        holds: bool,
    },
}

/// A chain that its gain does not stabilise by itself.
#[derive(Clone, Debug, PartialEq)]
pub struct Loose {
    /// its states; of a long one the first and the last
    pub states: Vec<String>,
    /// it is unstable, or only not proved to be stable
    pub is_unstable: bool,
    /// in the middle of the partials' bounds, where they were computed
    pub eigenvalues: Option<Vec<(f64, f64)>>,
}
