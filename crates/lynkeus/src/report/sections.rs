//! What a page says, section by section.

use lynkeus_observers::{Examination, fit_word};
use lynkeus_words::{Words, counted, figures};

use super::data::ROWS;
use super::html::{Cell, Html, badge, words};
use super::proof;
use super::told::{Told, without_folder};
use crate::check::{Known, Report};
use crate::print::head::file_name;
use crate::words::{instant, number};
use crate::{Accuracy, Error, Knowledge, Settling};

impl Told<'_> {
    /// The whole page, but for its script.
    pub(super) fn tell(&self, page: &mut Html) {
        page.within("header", |html| self.head(html));
        page.within("main", |html| {
            html.within("section id=\"estimates\"", |html| self.estimates(html));
            html.within("section id=\"known\"", |html| self.known(html));
            html.within("section id=\"conditions\"", |html| self.conditions(html));
            html.within("section id=\"design\"", |html| self.design(html));
            html.within("section id=\"certificate\"", |html| {
                html.element("h2", "What is guaranteed");
                match &self.certified {
                    Ok(certified) => proof::certificate(html, certified),
                    Err(error) => failed(html, error),
                }
            });
            html.within("section id=\"notes\"", |html| self.notes(html));
        });
        page.element(
            "footer",
            &format!(
                "Made by lynkeus {} from {}. Pictures by uPlot.",
                env!("CARGO_PKG_VERSION"),
                file_name(&self.study.file)
            ),
        );
    }

    fn head(&self, html: &mut Html) {
        let outcome = &self.outcome;
        html.element("h1", &outcome.plant);
        if let Some(refusal) = outcome.refusal() {
            let words = format!("Do not trust these estimates: {}", words(&refusal));
            html.element("p class=\"alarm\" role=\"alert\"", &words);
        }
        let observer = &outcome.design.observer;
        let measured: Vec<String> = observer.measured.iter().map(|m| m.name.clone()).collect();
        let estimates = observer.estimates.iter();
        let mut estimated: Vec<_> = estimates
            .filter(|e| !measured.contains(&e.variable.name))
            .collect();
        // what is least expected first
        estimated.sort_by_key(|e| !e.unknown_input);
        let estimated: Vec<String> = estimated
            .into_iter()
            .map(|e| e.variable.name.clone())
            .collect();
        html.element(
            "p class=\"lead\"",
            &format!(
                "The {} observer estimates {} from {}.",
                outcome.design.examination.family,
                listed(&estimated),
                listed(&measured)
            ),
        );
        let verdict = match &self.certified {
            Ok(certified) => certified.conclusion(),
            Err(error) => format!("undecided: {}", error.message()),
        };
        let (word, rest) = verdict.split_once(": ").unwrap_or(("", &verdict));
        let rest = super::html::escaped(rest);
        let word = match word {
            "" => badge("undecided"),
            word => badge(word),
        };
        html.raw(&format!("<p>Convergence: {word} {rest}</p>"));
    }

    fn estimates(&self, html: &mut Html) {
        html.element("h2", "The estimates");
        let rows = self.outcome.time.len();
        html.element(
            "p",
            &format!("{} of {}.", counted(rows, "sample"), self.source),
        );
        if rows > ROWS {
            let words = format!("The pictures show the first {ROWS} of {rows} samples.");
            html.element("p", &words);
        }
        match &self.moving {
            Ok(_) => html.raw("<div id=\"controls\"></div>\n<p id=\"status\" role=\"status\"></p>"),
            Err(why) => {
                let why = words(why);
                html.element("p", &format!("The observer cannot run in this page: {why}. The pictures are what the command gives."));
            }
        }
        html.raw(
            "<noscript><p>The pictures need JavaScript.</p></noscript>\n<div id=\"charts\"></div>",
        );
        let rows = self.outcome.accuracies.iter().map(accuracy).collect();
        let head = [
            "quantity",
            "RMS error, last half",
            "largest error",
            "at time",
            "within 5 % of its range",
        ];
        html.table(&head, rows);
        // in the same section, so that the sliders stay in sight
        if let Some(tradeoff) = &self.tradeoff {
            html.within("section id=\"tradeoff\"", |html| tradeoff.tell(html));
        }
    }

    fn known(&self, html: &mut Html) {
        html.element("h2", "What can be known");
        let report = match &self.checked {
            Ok(report) => report,
            Err(error) => return failed(html, error),
        };
        let unit = report.time_unit.as_deref().unwrap_or("unit of time");
        let Some(first) = report.knowledge.first() else {
            return whole(html, report);
        };
        let is_same = |k: &&Knowledge| !std::ptr::eq(*k, first) && k.quantities == first.quantities;
        let (same, told): (Vec<_>, Vec<_>) = report.knowledge.iter().partition(is_same);
        let mut head = vec!["quantity".to_owned()];
        head.extend(told.iter().map(|k| k.words()));
        let line = |known: Option<&(String, Known)>| {
            known.map_or(Cell::from(""), |(_, known)| Cell::from(known.line(unit)))
        };
        let rows = first.quantities.iter().map(|(name, _)| {
            let of = |k: &&Knowledge| line(k.quantities.iter().find(|(n, _)| n == name));
            let mut row = vec![Cell::from(name.clone())];
            row.extend(told.iter().map(of));
            row
        });
        let head: Vec<&str> = head.iter().map(String::as_str).collect();
        html.table(&head, rows.collect());
        for same in same {
            html.element("p", &format!("It is {}.", same.words()));
        }
        whole(html, report);
    }

    fn conditions(&self, html: &mut Html) {
        html.element("h2", "Conditions of the observer");
        let own = &self.outcome.design.examination;
        examination(html, own);
        let Ok(report) = &self.checked else { return };
        let others = report.examinations.iter();
        for other in others.filter(|e| e.family != own.family) {
            let title = format!("{}: {}", other.family, fit_word(other.fit()));
            html.folded(&title, |html| examination(html, other));
        }
    }

    fn design(&self, html: &mut Html) {
        html.element("h2", "The design");
        let design = &self.outcome.design;
        let rows = design
            .parameters
            .iter()
            .map(|(name, value)| vec![Cell::from(name.as_str()), Cell::from(value.words())]);
        html.table(&["parameter", "value"], rows.collect());
        if let Ok(certified) = &self.certified {
            proof::correction(html, &certified.correction);
        }
        let rows = design.observer.states.iter().map(|(signal, start)| {
            vec![
                Cell::from(signal.name.clone()),
                Cell::Number(number(*start)),
            ]
        });
        let rows: Vec<Vec<Cell>> = rows.collect();
        let count = counted(rows.len(), "state");
        html.folded(&format!("{count} with their starts"), |html| {
            html.table(&["state", "start"], rows);
        });
    }

    fn notes(&self, html: &mut Html) {
        if self.notes.is_empty() && self.plant.warnings.is_empty() {
            return;
        }
        html.element("h2", "Notes");
        html.list(&self.notes);
        let warnings = self.plant.warnings.iter().map(without_folder);
        html.list(warnings.map(|warning| warning.one_line()));
    }
}

/// Names that are told one by one.
const NAMED: usize = 8;

/// Names, the first of them where they are many.
fn listed(names: &[String]) -> String {
    match names.len() {
        0 => "nothing".to_owned(),
        count if count <= NAMED => names.join(", "),
        count => format!("{} and {} more", names[..NAMED].join(", "), count - NAMED),
    }
}

/// The report for people as it stands.
fn whole(html: &mut Html, report: &Report) {
    html.folded("All that `lynkeus check` says", |html| {
        html.element("pre", &report.to_string());
    });
}

fn failed(html: &mut Html, error: &Error) {
    html.element("p class=\"alarm\"", &words(error));
}

fn accuracy(accuracy: &Accuracy) -> Vec<Cell> {
    let error = |e: f64| Cell::Number(figures(e, 3));
    vec![
        Cell::from(accuracy.quantity.as_str()),
        accuracy.rms.map_or(Cell::from("not known"), error),
        error(accuracy.peak),
        Cell::Number(instant(accuracy.peak_at)),
        match accuracy.settling {
            Settling::From(t) => Cell::from(format!("from {} on", instant(t))),
            Settling::Never => Cell::from("not at the end"),
            Settling::NoRange => Cell::from("no range declared"),
        },
    ]
}

fn examination(html: &mut Html, examination: &Examination) {
    html.raw(&format!(
        "<p>{}: {} {}</p>",
        super::html::escaped(examination.family.name()),
        badge(fit_word(examination.fit())),
        super::html::escaped(&examination.summary.words())
    ));
    proof::conditions(html, examination.conditions());
}
