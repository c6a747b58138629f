//! Signals that ask the program to end.
//!
//! A signal raises the flag of [`interrupt`], which computations look at; a run that does not end
//! by itself soon after is ended here. Either way no temporary file stays, and the program dies by the signal,
//! so that a shell sees what happened.

use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Arc, LazyLock, Mutex};
use std::thread;
use std::time::Duration;

use lynkeus::interrupt;
use signal_hook::{consts, flag, low_level};

use super::ending::Ending;

/// How long a run may take to end by itself.
const GRACE: Duration = Duration::from_millis(500);

/// How often the guard looks.
const LOOK: Duration = Duration::from_millis(40);

/// The signals that end a program.
#[cfg(unix)]
const ENDING: &[i32] = &[
    consts::SIGINT,
    consts::SIGTERM,
    consts::SIGHUP,
    consts::SIGQUIT,
    consts::SIGALRM,
    consts::SIGVTALRM,
    consts::SIGPROF,
    consts::SIGUSR1,
    consts::SIGUSR2,
    consts::SIGXCPU,
];
#[cfg(not(unix))]
const ENDING: &[i32] = &[consts::SIGINT, consts::SIGTERM];

/// The signal that came last; 0 for none.
static RECEIVED: LazyLock<Arc<AtomicUsize>> = LazyLock::new(Arc::default);

/// Every temporary file of this run. Names are never used twice, so one that became a result or is gone may stay here.
static TEMPORARY: Mutex<Vec<PathBuf>> = Mutex::new(Vec::new());

/// A file that must not outlive the program.
pub(super) fn is_temporary(path: &Path) {
    if let Ok(mut files) = TEMPORARY.lock() {
        files.push(path.to_owned());
    }
}

/// Watches for signals from here on. Without a thread to watch they keep their usual effect.
pub(super) fn watch() {
    let guard = thread::Builder::new().name("signals".to_owned());
    if guard.spawn(guard_run).is_err() {
        return;
    }
    for &signal in ENDING {
        if is_kept_ignored(signal) {
            continue;
        }
        let number = usize::try_from(signal).unwrap_or_default();
        // a signal that cannot be caught here keeps its usual effect
        let _ = flag::register_usize(signal, Arc::clone(&RECEIVED), number);
        let _ = flag::register(signal, interrupt::flag());
    }
    // writing beyond the limit of file sizes is then an error like any other
    #[cfg(unix)]
    let _ = flag::register(consts::SIGXFSZ, Arc::default());
}

/// A program under `nohup` does not hear of its terminal's end.
fn is_kept_ignored(signal: i32) -> bool {
    #[cfg(target_os = "linux")]
    if signal == consts::SIGHUP {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let mask = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let mask = mask.and_then(|hex| u64::from_str_radix(hex.trim(), 16).ok());
        return mask.is_some_and(|mask| mask >> (signal - 1) & 1 == 1);
    }
    let _ = signal;
    false
}

/// Waits for a signal and ends a run that does not end by itself.
fn guard_run() {
    while received().is_none() {
        thread::sleep(LOOK);
    }
    thread::sleep(GRACE);
    if let Ok(files) = TEMPORARY.lock() {
        for file in files.iter() {
            // most of them are results by now
            let _ = std::fs::remove_file(file);
        }
    }
    end();
}

fn received() -> Option<i32> {
    i32::try_from(RECEIVED.load(Ordering::Relaxed))
        .ok()
        .filter(|signal| *signal != 0)
}

/// Ends the program as the signal would have, if there was one; else nothing happens.
pub(super) fn end() -> Ending {
    let Some(signal) = received() else {
        return Ending::Input;
    };
    let name = low_level::signal_name(signal).unwrap_or("a signal");
    let done = match super::progress::done_so_far() {
        Some(done) => format!(" after {done}; no file was written"),
        None => String::new(),
    };
    super::output::say(&format!("interrupted by {name}{done}"));
    // where this fails the exit code says the same
    let _ = low_level::emulate_default_handler(signal);
    let code = u8::try_from(128 + signal).unwrap_or(u8::MAX);
    std::process::exit(i32::from(code))
}
