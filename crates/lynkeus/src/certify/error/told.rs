//! The tube of an error, for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Line, Table};
use lynkeus_expr::Interval;
use serde::Serialize;

use super::super::tube::outward;
use super::super::tube::told::{ends, entries, listed};
use super::{ErrorTube, Followed};
use lynkeus_experiment::entries::{Named, Range, Verdict};
use lynkeus_experiment::words::number;
use lynkeus_structure::Standing;

impl ErrorTube {
    /// Whose error it is.
    fn whose(&self) -> &'static str {
        match self.is_filter {
            true => "the filter's",
            false => "the observer's",
        }
    }

    /// The clause of the first line.
    pub(crate) fn clause(&self) -> String {
        let (whose, until) = (self.whose(), number(self.until));
        match self.verdict {
            Standing::Proved => {
                format!("{whose} error has bounds from these starts until {until} (proved)")
            }
            _ => format!(
                "whether {whose} error has bounds from these starts until {until} is undecided"
            ),
        }
    }

    /// The part of the answer about it.
    pub(crate) fn tell(&self, document: &mut Document) {
        let heading = format!("{} error until {}: ", self.whose(), number(self.until));
        document.heading(Line::from(heading).decided(self.verdict.word()));
        if !self.start.is_empty() {
            let estimate = self.estimate.iter();
            let estimate: Vec<String> = estimate
                .map(|(name, value)| format!("{name} = {}", number(*value)))
                .collect();
            document.item(format!(
                "the plant from {} at {}, the estimate from {}",
                listed(&self.start),
                number(self.from),
                estimate.join(", ")
            ));
        }
        document.items(self.sensors());
        if !self.inputs.is_empty() {
            document.item(format!("however these vary: {}", listed(&self.inputs)));
        }
        document.items(self.obstacle.iter().map(String::as_str));
        if let Some(noisy) = self
            .noisy
            .as_ref()
            .filter(|noisy| noisy.reached > self.from)
        {
            self.table(noisy, document);
            let monitors = self.monitors.iter().zip(&noisy.monitors);
            let known = monitors.filter(|(_, range)| range.lo() > 0.0);
            document.items(known.map(|(name, range)| {
                format!("{name} at least {} all the time", number(range.lo()))
            }));
        }
        document.notes(self.notes.iter().cloned());
    }

    fn is_noisy(&self) -> bool {
        self.readings.iter().any(|r| r.bound > 0.0)
    }

    /// How the sensors report.
    fn sensors(&self) -> Option<String> {
        let noisy = self.readings.iter().filter(|r| r.bound > 0.0);
        let noisy: Vec<String> = noisy
            .map(|r| match r.is_relative {
                true => format!("±{} % of {}", number(100.0 * r.bound), r.output),
                false => format!("±{} of {}", number(r.bound), r.output),
            })
            .collect();
        let (when, whose) = match self.every {
            _ if self.noisy.is_none() => return None,
            Some(every) => {
                let held = match (self.is_filter, self.is_predicted) {
                    (true, _) => "",
                    (false, true) => ", predicted between them",
                    (false, false) => ", held between them",
                };
                (format!("a sample every {}{held}", number(every)), "its")
            }
            None => ("sensors that are read continuously".to_owned(), "their"),
        };
        Some(match noisy.is_empty() {
            true => when,
            false => format!(
                "{when}, whatever the errors of {whose} readings are within {}",
                noisy.join(", ")
            ),
        })
    }

    fn table(&self, noisy: &Followed, document: &mut Document) {
        let exact = self
            .exact
            .as_ref()
            .filter(|exact| exact.reached >= noisy.reached && self.is_noisy());
        let reached = number(noisy.reached);
        let mut columns = vec![
            (format!("error until {reached}"), &noisy.error),
            (format!("error at {reached}"), &noisy.error_end),
        ];
        if self.is_filter {
            columns.extend([
                (format!("filter's own sd until {reached}"), &noisy.deviation),
                (format!("at {reached}"), &noisy.deviation_end),
            ]);
        }
        columns.extend(exact.map(|exact| {
            (
                format!("error at {reached} without noise"),
                &exact.error_end,
            )
        }));
        let cell =
            |ranges: &[Interval], i: usize| ranges.get(i).map_or_else(String::new, |r| outward(*r));
        let row = |(i, (name, _)): (usize, &(String, Interval))| {
            let cells = columns.iter().map(|(_, ranges)| cell(ranges, i));
            let row = std::iter::once(name.clone()).chain(cells);
            row.map(Into::into).collect::<Vec<_>>()
        };
        let head: Vec<String> = std::iter::once("state".to_owned())
            .chain(columns.iter().map(|(name, _)| name.clone()))
            .collect();
        let rows = self.start.iter().enumerate().map(row);
        document.table(Table::new(head).with(rows));
    }
}

/// What is proved of the error of an observer or of an extended Kalman filter from a set of starts.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "ErrorTube"))]
pub(crate) struct ErrorEntry {
    /// whether the error has the bounds until the time asked for
    verdict: Verdict,
    /// when it starts
    from: f64,
    /// until when it is asked
    until: f64,
    /// the time from one sample to the next; null where sensors are read continuously
    every: Option<f64>,
    /// ranges of plant states and unknown inputs at the start
    start: Named<Range>,
    /// where the estimate starts
    estimate: Named<f64>,
    /// bounds of the errors of readings, by output; of relative noise as a share of what is shown
    readings: Named<f64>,
    /// ranges of inputs that may vary as they like
    inputs: Named<Range>,
    /// with these errors of readings
    noisy: Option<FollowedEntry>,
    /// with readings without noise: what the start and disturbances leave
    exact: Option<FollowedEntry>,
    /// why it is not proved
    obstacle: Option<String>,
    /// what it leaves aside
    notes: Vec<String>,
}

/// The error, and a filter's own standard deviations, along a tube.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FollowedEntry {
    /// until when the ranges are proved
    reached: f64,
    /// ranges of estimate minus truth over all of the time
    error: Named<Range>,
    /// the same at the end of it
    error_end: Named<Range>,
    /// ranges of a filter's own standard deviations over all of the time; empty for other observers
    deviation: Named<Range>,
    /// the same at the end of it
    deviation_end: Named<Range>,
    /// ranges of the observer's monitors over all of the time, where they have bounds
    monitors: Named<Range>,
    /// errors and deviations from one time to the next
    rows: Vec<ErrorRow>,
}

/// A part of it.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct ErrorRow {
    /// from when
    from: f64,
    /// to when
    to: f64,
    /// ranges of estimate minus truth
    error: Named<Range>,
    /// ranges of a filter's own standard deviations
    deviation: Named<Range>,
}

impl From<&ErrorTube> for ErrorEntry {
    fn from(tube: &ErrorTube) -> Self {
        let named = |ranges: &[Interval]| -> Named<Range> {
            let names = tube.start.iter().map(|(name, _)| name.clone());
            names.zip(ranges.iter().map(|r| ends(*r))).collect()
        };
        let followed = |followed: &Followed| FollowedEntry {
            reached: followed.reached,
            error: named(&followed.error),
            error_end: named(&followed.error_end),
            deviation: named(&followed.deviation),
            deviation_end: named(&followed.deviation_end),
            monitors: tube
                .monitors
                .iter()
                .zip(&followed.monitors)
                .filter(|(_, range)| range.is_bounded())
                .map(|(name, range)| (name.clone(), ends(*range)))
                .collect(),
            rows: followed
                .rows
                .iter()
                .filter(|row| !row.2.is_empty())
                .map(|(from, to, ranges)| {
                    let (errors, others) = ranges.split_at(followed.error.len().min(ranges.len()));
                    let count = followed.deviation.len().min(others.len());
                    let deviations = &others[..count];
                    ErrorRow {
                        from: *from,
                        to: *to,
                        error: named(errors),
                        deviation: named(deviations),
                    }
                })
                .collect(),
        };
        Self {
            verdict: tube.verdict.into(),
            from: tube.from,
            until: tube.until,
            every: tube.every,
            start: entries(&tube.start),
            estimate: tube.estimate.iter().cloned().collect(),
            readings: tube
                .readings
                .iter()
                .map(|r| (r.output.clone(), r.bound))
                .collect(),
            inputs: entries(&tube.inputs),
            noisy: tube.noisy.as_ref().map(followed),
            exact: tube.exact.as_ref().map(followed),
            obstacle: tube.obstacle.clone(),
            notes: tube.notes.clone(),
        }
    }
}
