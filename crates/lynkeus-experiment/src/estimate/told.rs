//! A run in tables, for people.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Line, Table};
#[cfg(feature = "plot")]
use lynkeus_plot::Figure;
use lynkeus_words::figures;
use serde_json::Value;

use crate::course::corrections::Corrections;
use crate::judge::Innovations;
use crate::words::{instant, number};
use crate::{Accuracy, Answer, Error, Origin, Outcome, Quantity, Series, Settling};

/// Rows of a table that a text shows.
const LISTED: usize = 12;

crate::displayed!(Outcome);

impl Answer for Outcome {
    fn document(&self) -> Document {
        let family = self.design.examination.family;
        let title = format!(
            "{}: {family} observer, {} rows; ",
            self.plant,
            self.time.len()
        );
        let title = Line::from(title);
        let mut document = Document::new(match self.refusal() {
            None => title.decided("credible"),
            Some(refusal) => title.decided("not credible").and(format!(": {refusal}")),
        });
        document.part().table(self.errors());
        document.part().table(self.readings());
        let doubts = self.doubts.iter().map(|doubt| {
            let cells = [doubt.level.word(), &doubt.name, &doubt.text];
            cells.map(Cell::from).to_vec()
        });
        document
            .part()
            .table(Table::new(["doubt", "of", "why"]).with(doubts));
        document
    }

    fn entries(&self) -> Value {
        Self::entries(self)
    }

    fn columns(&self) -> Vec<(String, Series)> {
        Self::columns(self)
    }

    #[cfg(feature = "plot")]
    fn svg(&self) -> Result<Option<String>, Error> {
        self.figure()?.to_svg().map(Some)
    }

    #[cfg(feature = "plot")]
    fn panels(&self) -> Result<Option<Figure>, Error> {
        self.figure().map(Some)
    }

    fn corrections(&self) -> Option<&Corrections> {
        self.corrections.as_ref()
    }

    fn origin(&self) -> Option<Origin> {
        self.origin
    }

    fn refusal(&self) -> Option<Error> {
        Self::refusal(self)
    }

    fn warnings(&self) -> &[String] {
        &self.warnings
    }

    fn notes(&self) -> &[String] {
        &self.notes
    }

    fn log(&self) -> Result<Vec<(String, Series)>, Error> {
        Self::log(self)
    }
}

impl Outcome {
    /// What is estimated, and how far it is from what is known to be true; unknown inputs first.
    pub fn errors(&self) -> Table {
        let mut estimated: Vec<&Quantity> = self.quantities.iter().collect();
        estimated.retain(|q| q.estimate.is_some());
        estimated.sort_by_key(|q| (!q.unknown_input, q.measured.is_some()));
        let titles = [
            "quantity",
            "unit",
            "last value",
            "RMS error, last half",
            "largest error",
            "at time",
            "within 5 % of its range",
        ];
        let rows = estimated.into_iter().map(|quantity| {
            let last = quantity.estimate.as_ref().and_then(Series::last);
            let unit = quantity.unit.clone().unwrap_or_default();
            let known = [
                quantity.name.as_str().into(),
                unit.into(),
                Cell::number(last, number),
            ];
            let own = self.accuracies.iter().find(|a| a.quantity == quantity.name);
            known.into_iter().chain(accuracy(own)).collect()
        });
        Table::new(titles)
            .with(rows)
            .dense()
            .at_most(LISTED, "more")
    }

    /// How the readings went together with what was expected of them.
    fn readings(&self) -> Table {
        let titles = [
            "sensor",
            "taken",
            "missing",
            "rejected",
            "consistency (1 is as declared)",
        ];
        let count = |count: usize| Cell::Number(count.to_string());
        let row = |sensor: &Innovations| {
            let health = &sensor.all;
            vec![
                sensor.output.as_str().into(),
                count(health.taken),
                count(health.missing),
                count(health.rejected),
                Cell::number(sensor.late.consistency(), number),
            ]
        };
        let rows = self.innovations.iter().map(row);
        Table::new(titles).with(rows).at_most(LISTED, "more")
    }
}

fn accuracy(accuracy: Option<&Accuracy>) -> [Cell; 4] {
    let error = |e: f64| figures(e, 3);
    [
        Cell::number(accuracy.and_then(|a| a.rms), error),
        Cell::number(accuracy.map(|a| a.peak), error),
        Cell::number(accuracy.map(|a| a.peak_at), instant),
        match accuracy.map(|a| a.settling) {
            None => Cell::Missing,
            Some(Settling::From(t)) => Cell::from(format!("from {} on", instant(t))),
            Some(Settling::Never) => Cell::from("not at the end"),
            Some(Settling::NoRange) => Cell::from("no range declared"),
        },
    ]
}
