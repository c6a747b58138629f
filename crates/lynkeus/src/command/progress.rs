//! A progress bar for anything that takes longer than a second.

use std::io::IsTerminal;
use std::ops::ControlFlow;
use std::sync::mpsc::{Receiver, Sender, channel};
use std::thread::JoinHandle;
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};

const STEPS: u64 = 1000;

/// A bar on standard error, if that is a terminal; it appears after a second.
pub(super) struct Progress {
    what: &'static str,
    wanted: bool,
    since: Instant,
    bar: Option<ProgressBar>,
}

impl Progress {
    pub(super) fn new(what: &'static str, quiet: bool) -> Self {
        Self {
            what,
            wanted: !quiet && std::io::stderr().is_terminal(),
            since: Instant::now(),
            bar: None,
        }
    }

    /// What a run calls with the fraction done.
    pub(super) fn watch(&mut self) -> impl FnMut(f64) -> ControlFlow<()> + '_ {
        |fraction| {
            self.show(fraction);
            ControlFlow::Continue(())
        }
    }

    fn show(&mut self, fraction: f64) {
        if !self.wanted || self.since.elapsed() < Duration::from_secs(1) {
            return;
        }
        let bar = self.bar.get_or_insert_with(|| {
            let bar = ProgressBar::new(STEPS).with_message(self.what);
            let style = ProgressStyle::with_template("{msg} [{bar:40}] {percent} % {eta}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        });
        bar.set_position((fraction * STEPS as f64) as u64);
    }

    pub(super) fn finish(self) {
        if let Some(bar) = self.bar {
            bar.finish_and_clear();
        }
    }
}

/// A sign of life, while something without known fractions takes longer than a second.
pub(super) struct Alive {
    done: Sender<()>,
    thread: Option<JoinHandle<()>>,
}

impl Alive {
    pub(super) fn new(what: &'static str) -> Self {
        let (done, wait) = channel();
        let watch = move || {
            let over = |wait: &Receiver<()>| wait.recv_timeout(Duration::from_secs(1)).is_ok();
            if !std::io::stderr().is_terminal() || over(&wait) {
                return;
            }
            let bar = ProgressBar::new_spinner().with_message(what);
            bar.enable_steady_tick(Duration::from_millis(120));
            // until the sender says so or is gone
            let _ = wait.recv();
            bar.finish_and_clear();
        };
        Self {
            done,
            thread: Some(std::thread::spawn(watch)),
        }
    }
}

impl Drop for Alive {
    fn drop(&mut self) {
        // the thread may have ended by itself
        let _ = self.done.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
