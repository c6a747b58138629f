//! How commands end.

use std::process::ExitCode;

use lynkeus::{Error, ErrorKind};

/// How a command ended, as its exit code says it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Ending {
    /// It did what was asked.
    Done = 0,
    /// The answer is no.
    No = 1,
    /// The input cannot be used.
    Input = 2,
    /// A limit of time or memory ended it.
    Limit = 3,
}

impl Ending {
    /// That of a command with this error.
    pub(super) fn of(error: &Error) -> Self {
        match error.kind() {
            ErrorKind::Refused => Self::No,
            ErrorKind::Ended => Self::Limit,
            _ => Self::Input,
        }
    }
}

impl From<Ending> for ExitCode {
    fn from(ending: Ending) -> Self {
        Self::from(ending as u8)
    }
}
