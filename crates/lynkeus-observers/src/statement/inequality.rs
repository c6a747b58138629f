//! The statements of the certificate by linear matrix inequalities, with the words for them.

use std::fmt;

use super::Statement;

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
