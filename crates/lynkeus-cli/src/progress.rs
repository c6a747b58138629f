//! A progress bar for anything that takes longer than a second; where standard error is no
//! terminal, a line every ten seconds.

use std::io::{IsTerminal, Write};
use std::ops::ControlFlow;
use std::sync::Mutex;
use std::sync::mpsc::{Receiver, RecvTimeoutError, Sender, channel};
use std::thread::{Builder, JoinHandle};
use std::time::{Duration, Instant};

use indicatif::{ProgressBar, ProgressStyle};
use lynkeus::interrupt::interrupted;

/// Steps of a bar, and how often a run looks at the clock.
const STEPS: u64 = 1000;

/// What is being done, for somebody who interrupts it.
static DOING: Mutex<Option<Doing>> = Mutex::new(None);

struct Doing {
    what: &'static str,
    since: Instant,
    /// done of the whole, where that is known
    fraction: Option<f64>,
}

/// Notes what begins, or none once it has ended.
fn doing(what: Option<&'static str>) {
    let doing = what.map(|what| Doing {
        what,
        since: Instant::now(),
        fraction: None,
    });
    // a thread that panicked takes only these words with it
    if let Ok(mut now) = DOING.lock() {
        *now = doing;
    }
}

/// What an interrupt interrupts, and how far it is.
pub(super) fn done_so_far() -> Option<String> {
    let now = DOING.try_lock().ok()?;
    let Doing {
        what,
        since,
        fraction,
    } = now.as_ref()?;
    let seconds = since.elapsed().as_secs_f64();
    let far = fraction.map(|f| format!(", {:.0} % done", (100.0 * f).floor()));
    Some(format!(
        "{what} for {seconds:.1} s{}",
        far.unwrap_or_default()
    ))
}
/// Between two lines where there is no bar.
const LINES: Duration = Duration::from_secs(10);

/// A bar on standard error, if that is a terminal: it appears after a second. Else lines.
pub(super) struct Progress {
    what: &'static str,
    wanted: bool,
    terminal: bool,
    since: Instant,
    /// the fraction at the last look at the clock
    seen: f64,
    /// of the last line
    told: Instant,
    bar: Option<ProgressBar>,
}

impl Progress {
    pub(super) fn new(what: &'static str, quiet: bool) -> Self {
        doing(Some(what));
        Self {
            what,
            wanted: !quiet,
            terminal: std::io::stderr().is_terminal(),
            since: Instant::now(),
            seen: f64::NEG_INFINITY,
            told: Instant::now(),
            bar: None,
        }
    }

    /// What a run calls with the fraction done; it ends the run when the user asks to stop.
    pub(super) fn watch(&mut self) -> impl FnMut(f64) -> ControlFlow<()> + '_ {
        |fraction| {
            self.show(fraction);
            match interrupted() {
                true => ControlFlow::Break(()),
                false => ControlFlow::Continue(()),
            }
        }
    }

    fn show(&mut self, fraction: f64) {
        // a row of a log takes less than a look at the clock
        if (fraction - self.seen).abs() * (STEPS as f64) < 1.0 {
            return;
        }
        self.seen = fraction;
        if let Some(doing) = DOING.lock().ok().as_mut().and_then(|now| now.as_mut()) {
            doing.fraction = Some(fraction);
        }
        if !self.wanted || self.since.elapsed() < Duration::from_secs(1) {
            return;
        }
        if !self.terminal {
            if self.told.elapsed() >= LINES {
                self.told = Instant::now();
                let percent = (100.0 * fraction).floor();
                let left = self.since.elapsed().as_secs_f64() * (1.0 / fraction - 1.0);
                line(&format!(
                    "{}: {percent} %, about {left:.0} s left",
                    self.what
                ));
            }
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
        doing(None);
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
    /// Without a thread to spare there is no sign.
    pub(super) fn new(what: &'static str) -> Self {
        doing(Some(what));
        let (done, wait) = channel();
        let terminal = std::io::stderr().is_terminal();
        let watch = move || match terminal {
            true => spin(what, &wait),
            false => tell(what, &wait),
        };
        let thread = Builder::new().name("progress".to_owned());
        Self {
            done,
            thread: thread.spawn(watch).ok(),
        }
    }
}

/// Whether the sender said so, or is gone, within that time.
fn over(wait: &Receiver<()>, time: Duration) -> bool {
    wait.recv_timeout(time) != Err(RecvTimeoutError::Timeout)
}

/// Until the sender says so or is gone.
fn spin(what: &'static str, wait: &Receiver<()>) {
    if over(wait, Duration::from_secs(1)) {
        return;
    }
    let bar = ProgressBar::new_spinner().with_message(what);
    while !over(wait, Duration::from_millis(120)) {
        bar.tick();
    }
    bar.finish_and_clear();
}

fn tell(what: &str, wait: &Receiver<()>) {
    let since = Instant::now();
    while !over(wait, LINES) {
        line(&format!("{what}: {} s so far", since.elapsed().as_secs()));
    }
}

/// A line on standard error; nobody listening is no error.
fn line(text: &str) {
    let _ = writeln!(std::io::stderr(), "{text}");
}

impl Drop for Alive {
    fn drop(&mut self) {
        if !interrupted() {
            doing(None);
        }
        // the thread may have ended by itself
        let _ = self.done.send(());
        if let Some(thread) = self.thread.take() {
            let _ = thread.join();
        }
    }
}
