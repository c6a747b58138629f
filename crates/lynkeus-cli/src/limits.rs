//! `--time-limit` and `--memory-limit`.

use std::time::Duration;

use cap::Cap;
use clap::Args;

use lynkeus::expr::{Budget, Memory};
use lynkeus::{Study, interrupt};

use super::ending::Ending;

/// The time of `design` and `certify` where none is given.
const PROOF: Duration = Duration::from_secs(60);

/// Counts what is in use, for the limit of memory: here, and in the Python package, which has this command inside.
#[global_allocator]
static ALLOCATOR: Cap<std::alloc::System> = Cap::new(std::alloc::System, usize::MAX);

/// Bytes that are in use.
pub fn allocated() -> usize {
    ALLOCATOR.allocated()
}

/// When a command stops: it reports what is done by then.
#[derive(Debug, Args)]
pub(super) struct Limits {
    /// Stop after this time and report what is done (default for `design` and `certify`: a minute)
    #[arg(long, value_name = "SECONDS", value_parser = seconds)]
    time_limit: Option<Duration>,
    /// Stop before using more memory and report what is done
    #[arg(long, value_name = "MIB", default_value_t = 2048)]
    memory_limit: usize,
}

impl Limits {
    /// The budget of the command, from now on.
    pub(super) fn budget(&self) -> Budget {
        let memory = Memory {
            limit: self.memory_limit.saturating_mul(1 << 20),
            used: allocated,
            before: 0,
        };
        Budget::new(self.time_limit, Some(memory)).stopped_by(interrupt::flag())
    }

    /// The same; without a limit of time, that of a proof.
    pub(super) fn for_a_proof(self) -> Budget {
        let time_limit = self.time_limit.or(Some(PROOF));
        Self { time_limit, ..self }.budget()
    }
}

/// The exit code of a command that a limit may have ended.
pub(super) fn code(study: &Study, code: Ending) -> Ending {
    match study.budget.marked() {
        Some(_) => Ending::Limit,
        None => code,
    }
}

fn seconds(text: &str) -> Result<Duration, String> {
    let seconds: f64 = text.parse().map_err(|_| "not a number".to_owned())?;
    Duration::try_from_secs_f64(seconds).map_err(|_| "not a time".to_owned())
}
