//! What the family states and says, as data.

use lynkeus_structure::{Finding, Standing};

/// What is stated: conditions of the family and hypotheses of the theorem.
#[derive(Clone, Debug, PartialEq)]
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

/// What is said of a plant, a verdict, an observer or a certificate of the family.
#[derive(Clone, Debug, PartialEq)]
pub enum Said {
    /// a plant in layers with its partition
    Form {
        /// names of the states, layer by layer
        layers: Vec<Vec<String>>,
        /// the unknown inputs
        unknown: Vec<String>,
        /// x₁¹
        first: Vec<String>,
        /// x₂¹
        second: Vec<String>,
    },
    /// no partition meets (H4)
    NoPartition {
        /// names of the states, layer by layer
        layers: Vec<Vec<String>>,
        /// partitions tried; 0 where there are too many
        tried: usize,
        /// x₁¹ of the one that went furthest, with what it fails
        closest: Option<(Vec<String>, Farza)>,
    },
    /// (ii) by two other conditions
    FollowsFromIAndEleven,
    /// the poles of chains that end early
    Shortened(Standing),
    /// the blocks of Λ₂, for what the proof covers
    Blocks {
        /// their sizes compared
        shape: Shape,
        /// of each
        sizes: Vec<usize>,
        /// Λ₂ changes with X²
        bends: bool,
        /// a partition with which they are square, where the proof covers these not
        partition: Option<Vec<String>>,
    },
    /// Λ₂ block by block
    FullColumnRank,
    /// a block of Λ₂ that may be singular, counted from 1
    Block(usize, Finding),
    /// the constants of (24) are finite
    Constants,
    /// they are not: what has no bound; nothing where an inverse has none
    NoConstants {
        /// what has no bound
        open: Vec<String>,
        /// Λ₂ has a left inverse only
        left: bool,
    },
    /// the bound of |v'|
    Slow {
        /// the bound
        ε: f64,
        /// no process noise moves them either
        are_constant: bool,
    },
    /// no θ is given; what the proof asks for, where it gives any
    NoTheta(Option<[f64; 2]>),
    /// c₄ has no bound
    NoC4,
    /// λ by no more than rounding
    Rate(f64),
    /// where Λ₂ is taken
    Tilde,
    /// noise where the proof does not follow it
    NoiseInSignals,
    /// disturbances or errors without bounds
    NoUltimateBound,
    /// θ from the proof, with c₁, c₂, c₄ and c₅
    Thetas([f64; 2], [f64; 4]),
}

/// Sizes of the blocks: p − m₁, n₂, …, n_q.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Shape {
    /// p − m₁ = n₂ = … = n_q
    Square,
    /// p − m₁ > n₂ = … = n_q
    Tall,
    /// further layers have fewer states
    Narrowing,
}
