//! What a page says, section by section.

use lynkeus_answer::Document;
use lynkeus_answer::document::{Cell, Line, Table};
use lynkeus_words::counted;

use super::data::ROWS;
use super::html::{element, section, words};
use super::told::{Told, without_folder};
use crate::check::tell_examination;
use crate::print::head::file_name;
use crate::{Answer, Error, design};
use lynkeus_experiment::words::number;

impl Told<'_> {
    /// The whole page, but for its script.
    pub(super) fn tell(&self) -> String {
        let certificate = match &self.certified {
            Ok(certified) => certified.document().to_html(),
            Err(error) => failed(error),
        };
        let sections = [
            section("estimates", "The estimates", &self.estimates()),
            section("known", "What can be known", &self.known()),
            section(
                "conditions",
                "Conditions of the observer",
                &self.conditions(),
            ),
            section("design", "The design", &self.design()),
            section("certificate", "What is guaranteed", &certificate),
            self.fitted.as_ref().map_or_else(String::new, |fitted| {
                section("fit", "What the log says of the values", &fitted.html())
            }),
            self.remarks(),
        ];
        let version = env!("CARGO_PKG_VERSION");
        let study = file_name(&self.study.file);
        let made = format!("Made by lynkeus {version} from {study}. Pictures by uPlot.");
        format!(
            "<header>\n{}</header>\n<main>\n{}</main>\n{}",
            self.head(),
            sections.concat(),
            element("footer", &made)
        )
    }

    fn head(&self) -> String {
        let outcome = &self.outcome;
        let mut head = element("h1", &outcome.plant);
        if let Some(refusal) = outcome.refusal() {
            let words = format!("Do not trust these estimates: {}", words(&refusal));
            head += &element("p class=\"alarm\" role=\"alert\"", &words);
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
        head += &element(
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
            Err(error) => Line::verdict("undecided").and(format!(": {}", error.message())),
        };
        let verdict = Line::from("Convergence: ").then(verdict);
        format!("{head}<p>{}</p>\n", verdict.to_html())
    }

    fn estimates(&self) -> String {
        let rows = self.outcome.time.len();
        let mut html = element(
            "p",
            &format!("{} of {}.", counted(rows, "sample"), self.source),
        );
        if rows > ROWS {
            let words = format!("The pictures show the first {ROWS} of {rows} samples.");
            html += &element("p", &words);
        }
        html += &match &self.moving {
            Ok(_) => {
                "<div id=\"controls\"></div>\n<p id=\"status\" role=\"status\"></p>\n".to_owned()
            }
            Err(why) => element(
                "p",
                &format!(
                    "The observer cannot run in this page: {}. The pictures are what the command gives.",
                    words(why)
                ),
            ),
        };
        html += "<noscript><p>The pictures need JavaScript.</p></noscript>\n<div id=\"charts\"></div>\n";
        let mut errors = Document::default();
        errors.table(self.outcome.errors());
        html += &errors.to_html();
        // in the same section, so that the sliders stay in sight
        if let Some(tradeoff) = &self.tradeoff {
            html += &section("tradeoff", "The trade-off", &tradeoff.html());
        }
        html
    }

    fn known(&self) -> String {
        let report = match &self.checked {
            Ok(report) => report,
            Err(error) => return failed(error),
        };
        let mut known = Document::default();
        report.tell_known(&mut known);
        format!(
            "{}<details>{}{}</details>\n",
            known.to_html(),
            element("summary", "All that `lynkeus check` says"),
            report.document().to_html()
        )
    }

    fn conditions(&self) -> String {
        let own = &self.outcome.design.examination;
        let mut document = Document::default();
        tell_examination(&mut document, own, false);
        let examinations = self.checked.iter().flat_map(|report| &report.examinations);
        let others = examinations.filter(|e| e.family != own.family);
        others.for_each(|other| tell_examination(&mut document, other, true));
        document.to_html()
    }

    fn design(&self) -> String {
        let own = &self.outcome.design;
        let mut document = Document::default();
        design::tell_parameters(&mut document, own);
        if let Ok(certified) = &self.certified {
            certified.correction.tell(&mut document);
        }
        let states = own.observer.states.iter();
        let rows = states
            .map(|(signal, start)| vec![signal.name.as_str().into(), Cell::Number(number(*start))]);
        let count = counted(own.observer.states.len(), "state");
        document.folded(format!("{count} with their starts"));
        document.table(Table::new(["state", "start"]).with(rows));
        document.to_html()
    }

    fn remarks(&self) -> String {
        let warnings = self.plant.warnings.iter().map(without_folder);
        let warnings = warnings.map(|warning| warning.one_line());
        let mut document = Document::default();
        document.notes(self.notes.iter().cloned().chain(warnings));
        match document.to_html() {
            notes if notes.is_empty() => notes,
            notes => section("notes", "Notes", &notes),
        }
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

fn failed(error: &Error) -> String {
    element("p class=\"alarm\"", &words(error))
}
