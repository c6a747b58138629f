//! A tube, for people and machines.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Line, Table};
use lynkeus_expr::Interval;
use lynkeus_structure::Standing;
use serde::Serialize;

use super::seen::outward;
use super::{Row, Tube, Witness};
use lynkeus_experiment::entries::{Named, Range, Verdict, finite};
use lynkeus_experiment::words::number;

pub(crate) fn listed(ranges: &[(String, Interval)]) -> String {
    let range = |(name, range): &(String, Interval)| match range.is_point() {
        true => format!("{name} = {}", number(range.lo())),
        false => format!("{name} in {}", outward(*range)),
    };
    ranges.iter().map(range).collect::<Vec<_>>().join(", ")
}

impl Tube {
    /// The clause of the first line.
    pub(crate) fn clause(&self) -> String {
        let until = number(self.until);
        match self.verdict {
            Standing::Proved => {
                format!("the plant stays in the box from these starts until {until} (proved)")
            }
            Standing::Refuted => "the plant leaves the box from some of these starts".to_owned(),
            Standing::Undecided => format!(
                "whether the plant stays in the box from these starts until {until} is undecided"
            ),
        }
    }

    /// The part of the answer about it.
    pub(crate) fn tell(&self, document: &mut Document) {
        let heading = format!("the plant stays in the box until {}: ", number(self.until));
        document.heading(Line::from(heading).decided(self.verdict.word()));
        document.item(format!(
            "from {} at {}",
            listed(&self.start),
            number(self.from)
        ));
        if !self.constants.is_empty() {
            document.item(format!("with constant {}", listed(&self.constants)));
        }
        if !self.inputs.is_empty() {
            document.item(format!("however these vary: {}", listed(&self.inputs)));
        }
        if let Some(witness) = &self.witness {
            let at = witness.at.iter().map(|(name, x)| format!("{name} = {x:?}"));
            document.item(format!(
                "with {} it is outside of it for certain at {}: {} in {}",
                at.collect::<Vec<_>>().join(", "),
                number(witness.time),
                witness.state,
                outward(
                    Interval::new(witness.value[0], witness.value[1]).unwrap_or(Interval::UNKNOWN)
                )
            ));
        }
        document.items(self.obstacle.iter().map(String::as_str));
        if self.reached > self.from {
            let rows = self
                .range
                .iter()
                .zip(&self.end)
                .map(|((name, all), (_, end))| {
                    vec![
                        name.as_str().into(),
                        outward(*all).into(),
                        outward(*end).into(),
                    ]
                });
            let (all, end) = (
                format!("until {}", number(self.reached)),
                format!("at {}", number(self.reached)),
            );
            document.table(Table::plain(["state", all.as_str(), end.as_str()]).with(rows));
        }
        document.notes(self.notes.iter().cloned());
    }
}

/// What is proved of the plant's way from a set of starts.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema), schemars(rename = "Tube"))]
pub(crate) struct TubeEntry {
    /// whether it stays in the box until the time asked for
    verdict: Verdict,
    /// when it starts
    from: f64,
    /// until when it is asked
    until: f64,
    /// until when the ranges are proved
    reached: f64,
    /// ranges of the states at the start
    start: Named<Range>,
    /// ranges of unknown inputs that stay constant
    constants: Named<Range>,
    /// ranges of inputs that may vary as they like
    inputs: Named<Range>,
    /// ranges of the states over all of the time that is reached
    range: Named<Range>,
    /// ranges of the states at the end of it
    end: Named<Range>,
    /// where the states are from one time to the next
    rows: Vec<TubeRow>,
    /// why it is not proved
    obstacle: Option<String>,
    /// a run that leaves the box for certain
    witness: Option<Witness>,
    /// what it leaves aside
    notes: Vec<String>,
}

/// A part of a tube.
#[derive(Debug, Serialize)]
#[cfg_attr(test, derive(schemars::JsonSchema))]
struct TubeRow {
    /// from when
    from: f64,
    /// to when
    to: f64,
    /// ranges of the states
    range: Named<Range>,
}

pub(crate) fn ends(range: Interval) -> Range {
    [range.lo(), range.hi()].map(finite)
}

pub(crate) fn entries(ranges: &[(String, Interval)]) -> Named<Range> {
    ranges
        .iter()
        .map(|(name, range)| (name.clone(), ends(*range)))
        .collect()
}

impl From<&Tube> for TubeEntry {
    fn from(tube: &Tube) -> Self {
        let row = |(from, to, ranges): &Row| {
            let names = tube.start.iter().map(|(name, _)| name.clone());
            TubeRow {
                from: *from,
                to: *to,
                range: names.zip(ranges.iter().map(|r| ends(*r))).collect(),
            }
        };
        let seen = tube.rows.iter().filter(|row| !row.2.is_empty());
        Self {
            verdict: tube.verdict.into(),
            from: tube.from,
            until: tube.until,
            reached: tube.reached,
            start: entries(&tube.start),
            constants: entries(&tube.constants),
            inputs: entries(&tube.inputs),
            range: entries(&tube.range),
            end: entries(&tube.end),
            rows: seen.map(row).collect(),
            obstacle: tube.obstacle.clone(),
            witness: tube.witness.clone(),
            notes: tube.notes.clone(),
        }
    }
}
