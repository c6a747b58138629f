//! The tube of a filter, for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Line, Table};
use lynkeus_expr::Interval;
use serde::Serialize;

use super::super::tube::outward;
use super::super::tube::told::{ends, entries, listed};
use super::{FilterTube, Followed};
use lynkeus_experiment::entries::{Named, Range, Verdict};
use lynkeus_experiment::words::number;
use lynkeus_structure::Standing;

impl FilterTube {
    /// The clause of the first line.
    pub(crate) fn clause(&self) -> String {
        let until = number(self.until);
        match self.verdict {
            Standing::Proved => {
                format!("the filter's error has bounds from these starts until {until} (proved)")
            }
            _ => format!(
                "whether the filter's error has bounds from these starts until {until} is undecided"
            ),
        }
    }

    /// The part of the answer about it.
    pub(crate) fn tell(&self, document: &mut Document) {
        let heading = format!("the filter's error until {}: ", number(self.until));
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
        if let Some(every) = self.every {
            let readings = self.readings.iter();
            let readings: Vec<String> = readings
                .map(|(name, size)| format!("±{} of {name}", number(*size)))
                .collect();
            document.item(format!(
                "a sample every {}, whatever the errors of its readings are within {}",
                number(every),
                readings.join(", ")
            ));
        }
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
        }
        document.notes(self.notes.iter().cloned());
    }

    fn table(&self, noisy: &Followed, document: &mut Document) {
        let exact = self
            .exact
            .as_ref()
            .filter(|exact| exact.reached >= noisy.reached);
        let cell =
            |ranges: &[Interval], i: usize| ranges.get(i).map_or_else(String::new, |r| outward(*r));
        let reached = number(noisy.reached);
        let mut head = vec![
            "state".to_owned(),
            format!("error until {reached}"),
            format!("error at {reached}"),
            format!("filter's own sd until {reached}"),
            format!("at {reached}"),
        ];
        head.extend(exact.map(|_| format!("error at {reached} without noise")));
        let row = |(i, (name, _)): (usize, &(String, Interval))| {
            let mut row = vec![
                name.clone(),
                cell(&noisy.error, i),
                cell(&noisy.error_end, i),
                cell(&noisy.deviation, i),
                cell(&noisy.deviation_end, i),
            ];
            row.extend(exact.map(|exact| cell(&exact.error_end, i)));
            row.into_iter().map(Into::into).collect::<Vec<_>>()
        };
        let rows = self.start.iter().enumerate().map(row);
        document.table(Table::new(head).with(rows));
    }
}

/// What is proved of an extended Kalman filter from a set of starts.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "FilterTube"))]
pub(crate) struct FilterEntry {
    /// whether the error has the bounds until the time asked for
    verdict: Verdict,
    /// when it starts
    from: f64,
    /// until when it is asked
    until: f64,
    /// the time from one sample to the next
    every: Option<f64>,
    /// ranges of plant states and unknown inputs at the start
    start: Named<Range>,
    /// where the estimate starts
    estimate: Named<f64>,
    /// bounds of the errors of readings, by output
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

/// The error and the filter's own standard deviations along a tube.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FollowedEntry {
    /// until when the ranges are proved
    reached: f64,
    /// ranges of estimate minus truth over all of the time
    error: Named<Range>,
    /// the same at the end of it
    error_end: Named<Range>,
    /// ranges of the filter's own standard deviations over all of the time
    deviation: Named<Range>,
    /// the same at the end of it
    deviation_end: Named<Range>,
    /// both from one time to the next
    rows: Vec<FilterRow>,
}

/// A part of it.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct FilterRow {
    /// from when
    from: f64,
    /// to when
    to: f64,
    /// ranges of estimate minus truth
    error: Named<Range>,
    /// ranges of the filter's own standard deviations
    deviation: Named<Range>,
}

impl From<&FilterTube> for FilterEntry {
    fn from(tube: &FilterTube) -> Self {
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
            rows: followed
                .rows
                .iter()
                .filter(|row| !row.2.is_empty())
                .map(|(from, to, ranges)| {
                    let (errors, deviations) = ranges.split_at(ranges.len() / 2);
                    FilterRow {
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
            readings: tube.readings.iter().cloned().collect(),
            inputs: entries(&tube.inputs),
            noisy: tube.noisy.as_ref().map(followed),
            exact: tube.exact.as_ref().map(followed),
            obstacle: tube.obstacle.clone(),
            notes: tube.notes.clone(),
        }
    }
}
