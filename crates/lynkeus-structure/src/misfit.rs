//! Why a plant does not have a form.

/// What breaks a form, as data: `lynkeus-words` has the sentences. Equations and states by their names.
#[derive(Clone, Debug, PartialEq)]
pub enum Misfit {
    /// the output is not a state times a factor, where a chain has to start at a measured state
    NoState {
        /// the output
        output: String,
        /// as a person would write it
        expression: String,
    },
    /// two outputs measure this state
    MeasuredTwice(String),
    /// no equation in the chain depends on the others
    ChainEnds {
        /// states of the chain
        chain: Vec<String>,
        /// the others
        left: Vec<String>,
    },
    /// the last equation of the chain depends on several new states at once
    ChainBreaks {
        /// states of the chain
        chain: Vec<String>,
        /// the new states
        new: Vec<String>,
    },
    /// no cut into chains covers every state, for these reasons, one per output
    NoCut(Vec<Misfit>),
    /// no assignment has the chains asked for; the first few that the equations allow
    OtherChains(Vec<Vec<Vec<String>>>),
    /// no arrangement into blocks has the chains asked for; the first few that the equations allow
    OtherBlocks(Vec<Vec<Vec<String>>>),
    /// no chain starts at a measured state
    NoChain,
    /// no chain reaches these states
    OutOfReach(Vec<String>),
    /// an equation of a block depends on several new states at once
    BlockBreaks {
        /// whose equation it is
        of: String,
        /// the new states
        new: Vec<String>,
    },
    /// this of the best attempt; not every order of the outputs was tried
    OrdersLeft(Box<Misfit>),
    /// no input is unknown
    NothingUnknown,
    /// this unknown input is measured
    UnknownMeasured(String),
    /// there are too few measured outputs
    FewOutputs {
        /// as many as there are
        count: usize,
        /// as many as are needed
        needed: usize,
        /// the unknown inputs
        unknown: Vec<String>,
        /// the states that the measured equations reveal
        revealed: Vec<String>,
    },
    /// an equation is not affine in an unknown input
    Unaffine {
        /// whose equation it is
        of: String,
        /// the unknown input
        input: String,
    },
    /// the factor of an unknown input depends on states that are not measured
    HiddenFactor {
        /// whose equation it is
        of: String,
        /// the unknown input
        input: String,
        /// the states
        reads: Vec<String>,
    },
    /// a layer has more states than the one before
    LayerGrows {
        /// the states of the one before
        layer: Vec<String>,
        /// its states
        next: Vec<String>,
    },
    /// no equation on the way from the measured states reads these
    NotRead(Vec<String>),
    /// no equation on the way from the outputs depends on these
    NoWay(Vec<String>),
    /// an output or an equation is not affine in the next block's states
    NotAffine {
        /// the output, or whose equation it is
        of: String,
        /// it is an output
        is_output: bool,
        /// the states
        states: Vec<String>,
        /// the state by which its derivative varies; none where it switches
        by: Option<String>,
        /// that derivative, or what it switches with
        expression: String,
    },
    /// an equation is not affine in a known input
    InputNotAffine {
        /// whose equation it is
        of: String,
        /// the input
        input: String,
    },
    /// an output reads a known input
    OutputReadsInput {
        /// the output
        output: String,
        /// the input
        input: String,
    },
}
