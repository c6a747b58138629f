//! How soon an estimate is right against how much noise it passes on, over the positions of the slider.

use std::ops::ControlFlow;

use lynkeus_answer::Document;
use lynkeus_answer::document::{self, Cell};
use lynkeus_observers::Design;
use serde::Serialize;

use super::html::{element, words};
use super::positions::Positions;
use crate::{Error, Series, Table};
use lynkeus_experiment::course::columns::Log;
use lynkeus_experiment::entries::Named;
use lynkeus_experiment::prepare::{Prepared, headers};
use lynkeus_experiment::tune::bench::Ground;
use lynkeus_experiment::tune::{self, Axis, Row, Sweep, axis, shortened};

/// Rows of a log that are judged: each is replayed twice for every position.
const ROWS: usize = 5_000;

/// What is drawn, in simulation and on a log.
const DRAWN: &[&str] = &[
    "mean_error",
    "mean_error_exact",
    "mean_error_noise",
    "held_out_error",
    "innovation",
];

/// The positions of the slider, judged.
#[derive(Debug)]
pub(super) struct Tradeoff {
    pub positions: Positions,
    /// a row for each of them, or why there are none
    sweep: Result<Sweep, Error>,
    is_filter: bool,
    /// of a simulation everything is known, of a log what it holds
    has_truth: bool,
    /// samples that are judged, where the log has more
    first: Option<usize>,
}

/// What is drawn of it.
#[derive(Debug, Serialize)]
pub(super) struct Drawn {
    label: String,
    values: Vec<Option<f64>>,
    own: Option<usize>,
    knee: Option<usize>,
    good: Option<[f64; 2]>,
    nearly: String,
    figures: Named<Vec<Option<f64>>>,
}

impl Tradeoff {
    /// Judges every position as `tune` judges values.
    ///
    /// # Errors
    /// The user ended it.
    pub fn new(
        prepared: &Prepared<'_>,
        design: &Design,
        positions: Positions,
        ground: Ground<'_>,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Result<Self, Error> {
        let mut is_ended = false;
        let watch = &mut |done| {
            let told = watch(done);
            is_ended |= told.is_break();
            told
        };
        let (axis, grid) = (positions.axis.clone(), positions.grid());
        let first = match ground {
            Ground::Log(table) => first(prepared, table),
            Ground::Simulation { .. } => Ok(None),
        };
        let sweep = first.and_then(|first| {
            let ground = first.as_ref().map_or(ground, Ground::Log);
            tune::along(prepared, design, axis, &grid, ground, watch)
        });
        Ok(Self {
            sweep: match sweep {
                Err(error) if is_ended => return Err(error),
                sweep => sweep,
            },
            positions,
            is_filter: design.observer.filter.is_some(),
            has_truth: matches!(ground, Ground::Simulation { .. }),
            first: match ground {
                Ground::Log(table) => Some(ROWS).filter(|most| table.rows() > *most),
                Ground::Simulation { .. } => None,
            },
        })
    }

    /// For the pictures; none where no position has a figure.
    pub fn drawn(&self) -> Option<Drawn> {
        let sweep = self.sweep.as_ref().ok()?;
        sweep.knee?;
        let measures = sweep.measures.iter().enumerate();
        let drawn = measures.filter(|(_, m)| DRAWN.contains(&m.name));
        let figures = drawn.filter(|(place, _)| has(sweep, *place));
        let column = |place| sweep.rows.iter().map(|row| row.figure(place)).collect();
        let values = sweep.rows.iter();
        Some(Drawn {
            label: swept(sweep),
            values: values.map(|row| row.values.first().copied()).collect(),
            own: self.own(),
            knee: sweep.knee,
            good: sweep.good().map(|good| [*good.start(), *good.end()]),
            nearly: sweep.nearly("the knee"),
            figures: figures
                .map(|(place, measure)| (measure.name.to_owned(), column(place)))
                .collect(),
        })
    }

    /// The row of the study's own position.
    fn own(&self) -> Option<usize> {
        self.positions.all.iter().position(|p| p.factor == 1.0)
    }

    /// What stands under the heading.
    pub fn html(&self) -> String {
        let sweep = match &self.sweep {
            Ok(sweep) => sweep,
            Err(error) => return element("p", &format!("It cannot be told: {}", words(error))),
        };
        let mut html = String::new();
        if let Some(knee) = sweep.chosen() {
            html += &element("p", &self.how_to_read());
            html += &element("p", &best(sweep, knee));
            html += "<div id=\"compromise\"></div>\n";
        }
        let mut document = Document::default();
        html += &document.table(self.table(sweep)).to_html();
        html += &element("p class=\"hint\"", self.definitions());
        let first = self
            .first
            .map(|first| format!("judged on the first {first} samples"));
        let beyond = sweep.at_an_end().map(|_| {
            "the knee is at an end of the slider: the best value may lie beyond".to_owned()
        });
        let mut notes = Document::default();
        notes.notes(sweep.notes.iter().cloned().chain(first).chain(beyond));
        html + &notes.to_html()
    }

    fn how_to_read(&self) -> String {
        let faster = if self.is_filter {
            "With more process noise a filter trusts its readings more: it"
        } else {
            "A faster observer"
        };
        let read = if self.is_filter && !self.has_truth {
            "A log has no truth: each position is judged by how likely it holds the readings, and beside that by how well it foretells samples that it is not shown. At the knee the likelihood is greatest."
        } else if self.has_truth {
            "Each point is a position of the slider: the further down, the nearer to the truth it would be without noise; the further left, the less noise it passes on. At the knee the error that is left with both is least."
        } else {
            "A log has no truth: each position is judged by how well it foretells samples that it is not shown. At the knee that error is least."
        };
        format!("{faster} follows sooner and passes on more noise. {read}")
    }

    fn definitions(&self) -> &'static str {
        match (self.has_truth, self.is_filter) {
            (true, false) => {
                "Errors are mean magnitudes over quantities and time, as shares of each quantity's range, in the study's simulation with noise, without it, and their difference: the figures of lynkeus tune."
            }
            (true, true) => {
                "Errors are mean magnitudes over quantities and time, as shares of each quantity's range, on samples of the study's simulation with noise, without it, and their difference: the figures of lynkeus tune."
            }
            (false, false) => {
                "Errors are root mean squares, as shares of each reading's range: the figures of lynkeus tune --log."
            }
            (false, true) => {
                "Errors are root mean squares, as shares of each reading's range; the likelihood is that of all readings: the figures of lynkeus tune --log."
            }
        }
    }

    /// A row for every position.
    fn table(&self, sweep: &Sweep) -> document::Table {
        let titles = sweep.measures.iter().map(|measure| {
            let unit = sweep.time_unit.as_ref().filter(|_| measure.is_time);
            match unit {
                Some(unit) => format!("{} ({unit})", measure.title),
                None => measure.title.to_owned(),
            }
        });
        let titles = std::iter::once(swept(sweep))
            .chain(titles)
            .chain([String::new()]);
        let rows = sweep.rows.iter().enumerate().map(|(place, row)| {
            let values = row.values.iter().map(|x| Cell::Number(axis::shown(*x)));
            let figures = sweep.measures.iter().zip(&row.figures);
            let figures = figures.map(|(measure, x)| Cell::number(*x, |x| measure.shown(x)));
            let remark = Cell::from(self.remark(sweep, place, row));
            values.chain(figures).chain([remark]).collect()
        });
        document::Table::new(titles).with(rows).dense()
    }

    fn remark(&self, sweep: &Sweep, place: usize, row: &Row) -> String {
        let study = (self.own() == Some(place)).then(|| "the study".to_owned());
        let knee = (sweep.knee == Some(place)).then(|| "the knee".to_owned());
        let words = [study, knee, row.failure.as_deref().map(shortened)];
        words.into_iter().flatten().collect::<Vec<_>>().join(", ")
    }
}

/// The first rows of a log that has more than are judged, as far as the study reads them.
fn first(prepared: &Prepared<'_>, table: &Table) -> Result<Option<Table>, Error> {
    let log = Log::read(prepared, table)?;
    // late readings would be moved twice
    if log.samples.time.len() <= ROWS || log.is_late() {
        return Ok(None);
    }
    let settings = &prepared.study().estimate;
    let augmented = prepared.augmented();
    let outputs = augmented.outputs.iter().map(|o| o.variable.name.as_str());
    let names = outputs.chain(augmented.inputs.iter().map(|u| u.name.as_str()));
    let headers = names.map(|name| headers::header(settings, name).to_owned());
    let part = |values: &Series| values.part(0, ROWS);
    let signals = headers.zip(log.samples.columns().map(part));
    let time = (log.time.clone(), part(&log.samples.time));
    Table::from_columns(std::iter::once(time).chain(signals).collect()).map(Some)
}

/// Whether any row has this figure.
fn has(sweep: &Sweep, measure: usize) -> bool {
    sweep.rows.iter().any(|row| row.figure(measure).is_some())
}

/// What the values are of.
fn swept(sweep: &Sweep) -> String {
    let label = sweep.axes.first().map(Axis::label).unwrap_or_default();
    label.replace("theta", "\u{3b8}").replace('_', " ")
}

/// Where the knee is, and what is nearly as good.
fn best(sweep: &Sweep, knee: &Row) -> String {
    let is_factor = sweep.axes.first().is_some_and(|axis| axis.is_factor);
    let sign = if is_factor { "" } else { "= " };
    let at = knee.values.first().copied().map(axis::shown);
    let decides = sweep.measures.get(sweep.objective);
    let title = decides.map_or("", |measure| measure.title);
    let least = decides.zip(knee.figure(sweep.objective));
    let least = least.map_or(String::new(), |(measure, x)| measure.shown(x));
    let good = sweep.good().filter(|good| good.start() < good.end());
    let good = good.map(|good| {
        let (low, high) = (axis::shown(*good.start()), axis::shown(*good.end()));
        format!("; from {low} to {high} it is {}", sweep.nearly("that"))
    });
    format!(
        "The knee is at {} {sign}{} ({title}: {least}){}.",
        swept(sweep),
        at.unwrap_or_default(),
        good.unwrap_or_default()
    )
}
