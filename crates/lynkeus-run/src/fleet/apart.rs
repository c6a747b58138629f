//! Why filters do not run side by side.

use std::fmt;

use crate::Error;

/// How many filters stand side by side here, at most.
pub(super) fn width() -> usize {
    lynkeus_native::widest().max(4)
}

/// Why filters do not run side by side.
#[derive(Clone, Debug, PartialEq)]
#[non_exhaustive]
pub enum Apart {
    /// there are none, or more than [`Fleet::width`](crate::Fleet::width)
    Count(usize),
    /// an observer that is no extended Kalman filter
    Kind,
    /// steps that are found along the way
    Step,
    /// inputs on a line between samples
    Line,
    /// a smoother needs the way of each
    History,
    /// states or readings are angles or rotations
    Manifold,
    /// readings of inputs have errors, or noises of sensors something in common
    Drawn,
    /// corrections are iterated
    Iterated,
    /// only covariances are asked for
    Foreseen,
    /// the plant or a sensor jumps with time
    Instants,
    /// a sensor of that name without noise
    Noiseless(String),
    /// the step or the correction is too many operations
    Large,
    /// they are of different plants, or differ in more than numbers
    Different,
    /// one of them cannot be
    Fault(Error),
}

impl fmt::Display for Apart {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Count(count) => {
                let most = width();
                write!(f, "1 to {most} filters run side by side, not {count}")
            }
            Self::Kind => f.write_str("only extended Kalman filters run side by side"),
            Self::Step => f.write_str("the steps follow from the system"),
            Self::Line => f.write_str("inputs are on a line between samples"),
            Self::History => f.write_str("a smoother needs the way of each"),
            Self::Manifold => f.write_str("states or readings are angles or rotations"),
            Self::Drawn => f.write_str(
                "readings of inputs have errors, or noises of sensors have something in common",
            ),
            Self::Iterated => f.write_str("corrections are iterated"),
            Self::Foreseen => f.write_str("only covariances are asked for"),
            Self::Instants => f.write_str("the plant or a sensor jumps with time"),
            Self::Noiseless(name) => write!(f, "sensor {name} has no noise"),
            Self::Large => f.write_str("a step or a correction is too many operations"),
            Self::Different => f.write_str("they differ in more than numbers"),
            Self::Fault(error) => error.fmt(f),
        }
    }
}

impl std::error::Error for Apart {}
