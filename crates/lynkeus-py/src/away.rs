//! Work away from the interpreter: without its lock, ended by Ctrl-C and by limits.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::{self, Builder};
use std::time::Duration;

use lynkeus::Error;
use lynkeus::expr::{Budget, Memory};
use lynkeus_cli::allocated;
use pyo3::exceptions::PyRuntimeError;
use pyo3::prelude::*;

use crate::errors::exception;

/// Between two looks at the signals.
const LOOK: Duration = Duration::from_millis(50);

/// Models nest, and so do the calls that walk over them; as much as a main thread has.
const STACK: usize = 8 << 20;

/// MiB that a call may take where nothing else is said, as many as the command's.
pub const MEMORY: f64 = 2048.0;

/// What a call may take, and whom it tells: `lynkeus._progress.Terms`.
#[derive(FromPyObject)]
pub struct Terms<'py> {
    /// called with the fraction done
    progress: Option<Bound<'py, PyAny>>,
    /// in seconds
    time_limit: Option<f64>,
    /// in MiB
    memory_limit: f64,
}

impl Default for Terms<'_> {
    fn default() -> Self {
        Self {
            progress: None,
            time_limit: None,
            memory_limit: MEMORY,
        }
    }
}

impl<'py> Terms<'py> {
    /// From now on; what others have in memory by now does not count.
    fn budget(&self) -> PyResult<Budget> {
        let time = match self.time_limit {
            Some(seconds) if seconds.is_nan() || seconds < 0.0 => {
                return Err(refused("time_limit: expected seconds >= 0", seconds));
            }
            // a limit beyond all time is none
            seconds => seconds.and_then(|seconds| Duration::try_from_secs_f64(seconds).ok()),
        };
        if self.memory_limit.is_nan() || self.memory_limit < 0.0 {
            let expected = "memory_limit: expected MiB >= 0";
            return Err(refused(expected, self.memory_limit));
        }
        let memory = Memory {
            // a limit beyond all memory is none
            limit: (self.memory_limit * f64::from(1 << 20)) as usize,
            used: allocated,
            before: allocated(),
        };
        Ok(Budget::new(time, Some(memory)))
    }

    /// Whether Ctrl-C was pressed, and tells the progress.
    fn look(&self, py: Python<'_>, fraction: f64) -> PyResult<()> {
        py.check_signals()?;
        match &self.progress {
            Some(progress) => progress.call1((fraction,)).map(|_| ()),
            None => Ok(()),
        }
    }
}

fn refused(expected: &str, found: f64) -> PyErr {
    exception(&Error::input(format!("{expected}, found {found}")))
}

/// What work is told its progress by.
pub type Watch<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Does the work on a thread of its own while this one waits for signals and tells the progress.
///
/// # Errors
/// What the work ends with; `KeyboardInterrupt`, and what `progress` raises.
pub fn away<T: Send>(
    py: Python<'_>,
    terms: &Terms<'_>,
    work: impl FnOnce(Budget, &mut Watch<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let fraction = AtomicU64::new(0);
    let budget = terms.budget()?.stopped_by(Arc::clone(&stop));
    let (stopped, told) = (&stop, &fraction);
    thread::scope(|scope| {
        let (sender, mut receiver) = channel();
        let run = move || {
            let mut watch = |done: f64| {
                told.store(done.to_bits(), Ordering::Relaxed);
                match stopped.load(Ordering::Relaxed) {
                    true => ControlFlow::Break(()),
                    false => ControlFlow::Continue(()),
                }
            };
            // the receiver only goes away with the scope
            let _ = sender.send(work(budget, &mut watch));
        };
        let worker = Builder::new().stack_size(STACK).spawn_scoped(scope, run);
        let worker = worker
            .map_err(|e| exception(&Error::input(format!("no thread can be started: {e}"))))?;
        let mut raised = None;
        loop {
            let found;
            (receiver, found) = py.detach(move || {
                let found = receiver.recv_timeout(LOOK);
                (receiver, found)
            });
            match found {
                Ok(result) => {
                    return match raised {
                        Some(error) => Err(error),
                        None => result.map_err(|error| exception(&error)),
                    };
                }
                Err(RecvTimeoutError::Disconnected) => {
                    // else the scope panics as well
                    let _ = worker.join();
                    return Err(PyRuntimeError::new_err(
                        "internal fault: the work panicked, as standard error tells",
                    ));
                }
                Err(RecvTimeoutError::Timeout) => {
                    let seen = match raised {
                        None => terms.look(py, f64::from_bits(told.load(Ordering::Relaxed))),
                        Some(_) => Ok(()),
                    };
                    if let Err(error) = seen {
                        stop.store(true, Ordering::Relaxed);
                        raised = Some(error);
                    }
                }
            }
        }
    })
}
