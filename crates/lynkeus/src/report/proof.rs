//! The certificate and what it certifies, as tables.

use lynkeus_observers::{Certificate, Check, UltimateBound};
use lynkeus_structure::Verdict;
use lynkeus_words::Words;

use super::html::{Cell, Html, badge, escaped};
use crate::words::number;
use crate::{CertifyReport, Correction};

/// Verdict, rate, bounds, box and hypotheses, by every way that was gone.
pub(super) fn certificate(html: &mut Html, report: &CertifyReport) {
    one(html, report, &report.certificate);
    if let Some(theorem) = &report.theorem {
        one(html, report, theorem);
    }
    let strays = report.strays.words(false);
    let strays = strays.map(|words| format!("the certificate is for the box only, and {words}"));
    html.list(report.assumed.iter().chain(&strays));
}

fn one(html: &mut Html, report: &CertifyReport, certificate: &Certificate) {
    let basis = escaped(certificate.basis);
    let word = badge(report.word(certificate));
    html.raw(&format!("<h3>{basis}: {word}</h3>"));
    let guaranteed = [
        ("the error decays at, or faster", certificate.rate),
        ("at first it may grow by the factor", certificate.overshoot),
        (
            "in the end it is within (Euclidean norm)",
            certificate.ultimate_bound,
        ),
        (
            "in the end it is in mean square (the root of E e²) within",
            certificate.mean_square.as_ref().map(|found| found.norm),
        ),
    ];
    let guaranteed = guaranteed
        .into_iter()
        .filter_map(|(what, value)| Some(vec![Cell::from(what), Cell::Number(number(value?))]));
    html.table(&["guarantee", "value"], guaranteed.collect());
    let bounds = |each: &[UltimateBound]| -> Vec<Vec<Cell>> {
        let row =
            |b: &UltimateBound| vec![Cell::from(b.name.as_str()), Cell::Number(number(b.value))];
        each.iter().map(row).collect()
    };
    html.table(
        &["quantity", "error in the end within"],
        bounds(&certificate.ultimate),
    );
    if let Some(found) = &certificate.mean_square {
        html.table(
            &["quantity", "in the end in mean square within"],
            bounds(&found.states),
        );
    }
    conditions(html, &certificate.hypotheses);
    let constants = certificate.constants.iter().map(|c| {
        vec![
            Cell::from(c.name.as_str()),
            Cell::Number(number(c.value)),
            Cell::from(c.words()),
        ]
    });
    html.table(&["constant", "value", "meaning"], constants.collect());
    html.folded("The box on which this holds", |html| {
        let sides = certificate.region.iter().map(|side| {
            vec![
                Cell::from(side.name.as_str()),
                Cell::Number(number(side.min)),
                Cell::Number(number(side.max)),
            ]
        });
        html.table(&["quantity", "from", "to"], sides.collect());
    });
    html.list(report.notes_of(certificate));
}

/// How the measurements enter.
pub(super) fn correction(html: &mut Html, correction: &Correction) {
    match correction {
        Correction::Gain(entries) => {
            let rows = entries.iter().map(|e| {
                vec![
                    Cell::from(e.output.as_str()),
                    Cell::from(e.state.as_str()),
                    Cell::Number(number(e.value)),
                ]
            });
            html.table(&["gain of", "on", "value"], rows.collect());
        }
        Correction::Varying(entries) => {
            let rows = entries.iter().map(|e| {
                vec![
                    Cell::from(e.output.as_str()),
                    Cell::from(e.state.as_str()),
                    Cell::Number(e.at_start.map_or("?".to_owned(), number)),
                    Cell::from(e.expression.as_str()),
                ]
            });
            let head = [
                "a unit of",
                "adds to the derivative of",
                "at the start",
                "everywhere",
            ];
            html.folded("How the measurements correct the estimate", |html| {
                html.table(&head, rows.collect());
            });
        }
    }
}

/// Conditions with their verdicts.
pub(super) fn conditions<'a>(html: &mut Html, checks: impl IntoIterator<Item = &'a Check>) {
    let row = |check: &Check| {
        let mut detail = check.reason.words();
        if let Verdict::Refuted(_) = check.verdict {
            detail = format!("{detail}; {}", check.verdict.words());
        }
        vec![
            Cell::Verdict(check.verdict.word()),
            Cell::from(check.statement.words()),
            Cell::from(detail),
        ]
    };
    let rows = checks.into_iter().map(row).collect();
    html.table(&["verdict", "condition", "what was found"], rows);
}
