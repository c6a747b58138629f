//! What was told last, for those who look: pages, counters, listeners.

use std::collections::VecDeque;
use std::fmt::Write;
use std::sync::mpsc::{Receiver, SyncSender, TrySendError, sync_channel};
use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError};
use std::time::Instant;

use lynkeus::stream::Stream;
use lynkeus::table::exact;

use crate::asset::Line;
use crate::engine::Arrival;
use crate::json;
use crate::row::Stamp;

/// Lines that are kept for those who come later, of all assets together and of one.
const KEPT: usize = 60_000;
const OF_ONE: usize = 600;
/// Lines that a listener may be behind before it is left alone.
const BEHIND: usize = 4096;
/// Listeners at once.
pub(crate) const LISTENERS: usize = 32;

/// What was told last.
#[derive(Debug)]
pub struct Board {
    stream: Arc<Stream>,
    names: Vec<String>,
    inner: Mutex<Inner>,
    proved: OnceLock<String>,
    /// lines of an asset that are kept
    kept: usize,
}

#[derive(Debug, Default)]
struct Inner {
    assets: Vec<Latest>,
    listeners: Vec<Listener>,
    refused: u64,
}

/// An asset as it was last.
#[derive(Clone, Debug, Default)]
struct Latest {
    line: Option<Line>,
    /// the newest last
    lines: VecDeque<Shown>,
    /// as they came, the newest last
    rows: VecDeque<(Stamp, Vec<f64>)>,
    came: Option<Instant>,
    count: u64,
    revisions: u64,
}

/// A line for those who look.
#[derive(Clone, Debug)]
pub struct Shown {
    /// as JSON
    pub line: Arc<str>,
    /// its innovations by sensor, as JSON; none where nothing was judged
    pub innovations: Option<Arc<str>>,
}

/// What a listener hears of an asset.
#[derive(Debug)]
pub struct Heard {
    /// the lines that are kept, the newest last
    pub before: Vec<Shown>,
    /// each as it is told
    pub lines: Receiver<Shown>,
}

#[derive(Debug)]
struct Listener {
    asset: usize,
    lines: SyncSender<Shown>,
}

impl Board {
    /// Of these assets, before anything was told.
    #[must_use]
    pub fn new(stream: Arc<Stream>, names: Vec<String>) -> Self {
        let assets = vec![Latest::default(); names.len()];
        Self {
            kept: (KEPT / names.len().max(1)).clamp(1, OF_ONE),
            inner: Mutex::new(Inner {
                assets,
                ..Inner::default()
            }),
            proved: OnceLock::new(),
            names,
            stream,
        }
    }

    fn lock(&self) -> MutexGuard<'_, Inner> {
        self.inner.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// The names of the assets; one that is empty where there is only one.
    #[must_use]
    pub fn names(&self) -> &[String] {
        &self.names
    }

    /// The study.
    #[must_use]
    pub fn stream(&self) -> &Arc<Stream> {
        &self.stream
    }

    /// Takes a row and the lines that answer it.
    pub fn told(&self, row: &Arrival, lines: &[Line]) {
        let asset = row.asset;
        let name = self.names.get(asset).map_or("", String::as_str);
        let mut inner = self.lock();
        let Inner {
            assets, listeners, ..
        } = &mut *inner;
        let Some(latest) = assets.get_mut(asset) else {
            return;
        };
        latest.count += 1;
        latest.came = Some(Instant::now());
        if lines.iter().any(|line| !line.is_repeated) {
            latest.rows.push_back((row.stamp, row.values.clone()));
            if latest.rows.len() > self.kept {
                latest.rows.pop_front();
            }
        }
        for line in lines.iter().filter(|line| !line.is_repeated) {
            latest.revisions += u64::from(line.revision > 0);
            let mut text = String::new();
            json::write(line, name, &self.stream, &mut text);
            let text = Shown {
                line: Arc::from(text.trim_end()),
                innovations: json::innovations(line, &self.stream).map(Arc::from),
            };
            latest.lines.push_back(text.clone());
            if latest.lines.len() > self.kept {
                latest.lines.pop_front();
            }
            listeners.retain(|listener| {
                listener.asset != asset
                    || !matches!(
                        listener.lines.try_send(text.clone()),
                        Err(TrySendError::Full(_) | TrySendError::Disconnected(_))
                    )
            });
        }
        // the newest row is told last
        if let Some(line) = lines.last() {
            latest.line = Some(line.clone());
        }
    }

    /// The last rows of an asset, as they came.
    #[must_use]
    pub fn rows(&self, asset: usize) -> Vec<(Stamp, Vec<f64>)> {
        let inner = self.lock();
        let own = inner.assets.get(asset);
        own.map_or(vec![], |own| own.rows.iter().cloned().collect())
    }

    /// What is proved of the observer, as HTML.
    pub fn is_proved(&self, text: String) {
        // it is found once
        let _ = self.proved.set(text);
    }

    /// The same, once it is known.
    #[must_use]
    pub fn proved(&self) -> Option<&str> {
        self.proved.get().map(String::as_str)
    }

    /// A row, or a line that was none, was refused.
    pub fn refused(&self) {
        self.lock().refused += 1;
    }

    /// The lines of an asset that are kept, and those from here on; none where too many listen.
    #[must_use]
    pub fn listen(&self, asset: usize) -> Option<Heard> {
        let mut inner = self.lock();
        if inner.listeners.len() >= LISTENERS {
            return None;
        }
        let before = inner.assets.get(asset)?.lines.iter().cloned().collect();
        let (lines, receiver) = sync_channel(BEHIND);
        inner.listeners.push(Listener { asset, lines });
        Some(Heard {
            before,
            lines: receiver,
        })
    }

    /// The last line of each asset, or of one of them, as a JSON object.
    #[must_use]
    pub fn estimates(&self, only: Option<usize>) -> String {
        let inner = self.lock();
        let all = self.names.iter().zip(&inner.assets).enumerate();
        let lines = all.filter(|(place, _)| only.is_none_or(|only| only == *place));
        let lines = lines.filter_map(|(_, (name, latest))| {
            let line = &latest.lines.back()?.line;
            Some(format!("{}:{line}", serde_json::Value::from(name.as_str())))
        });
        let lines: Vec<String> = lines.collect();
        format!("{{{}}}\n", lines.join(","))
    }

    /// Counters and estimates in the text format of Prometheus.
    #[must_use]
    pub fn metrics(&self) -> String {
        let inner = self.lock();
        let mut to = String::new();
        let assets = || self.names.iter().zip(&inner.assets);
        let label = |name: &str| match name.is_empty() {
            true => String::new(),
            false => format!("asset=\"{}\"", escaped(name)),
        };
        let mut family = |name: &str, kind: &str, help: &str, samples: Vec<(String, String)>| {
            // a string takes what is written
            let _ = write!(
                to,
                "# HELP lynkeus_{name} {help}\n# TYPE lynkeus_{name} {kind}\n"
            );
            for (labels, value) in samples {
                let labels = if labels.is_empty() {
                    labels
                } else {
                    format!("{{{labels}}}")
                };
                let _ = writeln!(to, "lynkeus_{name}{labels} {value}");
            }
        };
        let of_each = |value: &dyn Fn(&Latest) -> Option<String>| -> Vec<(String, String)> {
            let each = assets().filter_map(|(name, latest)| Some((label(name), value(latest)?)));
            each.collect()
        };
        family(
            "rows_total",
            "counter",
            "Rows that were answered.",
            of_each(&|l| Some(l.count.to_string())),
        );
        family(
            "revisions_total",
            "counter",
            "Corrections of what was told before.",
            of_each(&|l| Some(l.revisions.to_string())),
        );
        family(
            "refused_total",
            "counter",
            "Lines that could not be used.",
            vec![(String::new(), inner.refused.to_string())],
        );
        let age = |l: &Latest| {
            l.came
                .map(|came| format!("{:.3}", came.elapsed().as_secs_f64()))
        };
        family(
            "last_row_age_seconds",
            "gauge",
            "Time since the last row came.",
            of_each(&age),
        );
        let credible = |l: &Latest| {
            l.line
                .as_ref()
                .map(|line| u8::from(line.is_credible).to_string())
        };
        family(
            "credible",
            "gauge",
            "1 where nothing speaks against the estimate.",
            of_each(&credible),
        );
        for (name, help, is_deviation) in [
            ("estimate", "The last estimate.", false),
            ("estimate_sd", "Its standard deviation.", true),
        ] {
            let mut samples = vec![];
            for (asset, latest) in assets() {
                let Some(line) = &latest.line else { continue };
                let values = if is_deviation {
                    &line.deviations
                } else {
                    &line.estimate
                };
                for (told, x) in self.stream.estimates.iter().zip(values) {
                    let own = format!("quantity=\"{}\"", escaped(&told.name));
                    let labels = [label(asset), own].into_iter().filter(|l| !l.is_empty());
                    let labels: Vec<String> = labels.collect();
                    samples.push((labels.join(","), exact(*x)));
                }
            }
            family(name, "gauge", help, samples);
        }
        to
    }
}

/// A value of a label.
fn escaped(text: &str) -> String {
    text.replace('\\', "\\\\")
        .replace('"', "\\\"")
        .replace('\n', "\\n")
}
