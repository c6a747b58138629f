//! Work away from the interpreter: without its lock, ended by Ctrl-C and by a time limit.

use std::ops::ControlFlow;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::thread::{self, Builder};
use std::time::Duration;

use lynkeus::expr::Budget;
use lynkeus::{Error, Study};
use pyo3::exceptions::PyValueError;
use pyo3::prelude::*;

use crate::errors::exception;

/// Between two looks at the signals.
const LOOK: Duration = Duration::from_millis(50);

/// Models nest, and so do the calls that walk over them; as much as a main thread has.
const STACK: usize = 8 << 20;

/// What a call may take, and whom it tells.
#[derive(Default)]
pub struct Terms<'py> {
    /// in seconds
    pub time_limit: Option<f64>,
    /// called with the fraction done
    pub progress: Option<Bound<'py, PyAny>>,
}

/// What work is told its progress by.
pub type Watch<'a> = dyn FnMut(f64) -> ControlFlow<()> + 'a;

/// Does the work on a thread of its own while this one waits for signals and tells the progress.
///
/// # Errors
/// What the work ends with; `KeyboardInterrupt`, and what `progress` raises.
pub fn away<T: Send>(
    py: Python<'_>,
    study: &Study,
    terms: &Terms<'_>,
    work: impl FnOnce(&Study, &mut Watch<'_>) -> Result<T, Error> + Send,
) -> PyResult<T> {
    let stop = Arc::new(AtomicBool::new(false));
    let fraction = AtomicU64::new(0);
    let study = Study {
        budget: Budget::new(limit(terms.time_limit)?, None).stopped_by(Arc::clone(&stop)),
        ..study.clone()
    };
    let (study, stopped, told) = (&study, &stop, &fraction);
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
            let _ = sender.send(work(study, &mut watch));
        };
        let worker = Builder::new().stack_size(STACK).spawn_scoped(scope, run);
        worker.map_err(|e| exception(&Error::input(format!("no thread can be started: {e}"))))?;
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
                // a fault of ours, which its message on standard error tells
                Err(RecvTimeoutError::Disconnected) => {
                    return Err(exception(&Error::input(
                        "internal fault: the work panicked",
                    )));
                }
                Err(RecvTimeoutError::Timeout) => {
                    let seen = match raised {
                        None => look(py, terms, f64::from_bits(told.load(Ordering::Relaxed))),
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

fn look(py: Python<'_>, terms: &Terms<'_>, fraction: f64) -> PyResult<()> {
    py.check_signals()?;
    match &terms.progress {
        Some(progress) => progress.call1((fraction,)).map(|_| ()),
        None => Ok(()),
    }
}

fn limit(seconds: Option<f64>) -> PyResult<Option<Duration>> {
    let Some(seconds) = seconds else {
        return Ok(None);
    };
    match Duration::try_from_secs_f64(seconds) {
        Ok(limit) => Ok(Some(limit)),
        Err(_) => Err(PyValueError::new_err(format!(
            "time_limit: expected seconds >= 0, found {seconds}"
        ))),
    }
}
