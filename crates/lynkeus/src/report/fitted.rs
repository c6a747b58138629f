//! What a log says of parameters and noises, where the study has `[fit]`.

use std::ops::ControlFlow;

use lynkeus_study::FitSettings;

use super::html::{element, words};
use crate::fit::{Fit, FitOptions, fit};
use crate::print::head::file_name;
use crate::{Answer, Error, Study, Table};
use lynkeus_experiment::prepare::share;

/// The share of the time that is left which a fit may take.
const SHARE: f64 = 0.5;

/// A fit to the page's log.
pub(super) struct Fitted(Result<Fit, Error>);

impl Fitted {
    /// None where the study has no `[fit]`. It may take half of the time that is left; ten seconds where that has no
    /// limit.
    pub fn new(
        study: &Study,
        log: &Table,
        watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
    ) -> Option<Self> {
        if study.fit == FitSettings::default() {
            return None;
        }
        let study = Study {
            budget: share(&study.budget, SHARE),
            ..study.clone()
        };
        let log = std::slice::from_ref(log);
        let mut fitted = fit(&study, log, FitOptions::default(), watch);
        if let Ok(fitted) = &mut fitted {
            // a page goes to others: no folder of this machine
            for log in &mut fitted.logs {
                *log = file_name(log);
            }
        }
        Some(Self(fitted))
    }

    /// The values with their errors, and the innovations drawn.
    pub fn html(&self) -> String {
        let fit = match &self.0 {
            Ok(fit) => fit,
            Err(error) => return element("p class=\"alarm\"", &words(error)),
        };
        let mut html = String::new();
        if let Some(refusal) = fit.refusal() {
            html += &element("p class=\"alarm\"", &words(&refusal));
        }
        html += &fit.document().to_html();
        let mut remarks = lynkeus_answer::Document::default();
        remarks.notes(fit.warnings.iter().chain(&fit.notes).cloned());
        html += &remarks.to_html();
        html += &element(
            "p",
            "The rest of this page has the study's own values; `lynkeus fit --write` puts these in their place.",
        );
        #[cfg(feature = "plot")]
        if let Ok(Some(svg)) = fit.svg() {
            html += &format!("<figure style=\"overflow-x: auto\">{svg}</figure>\n");
        }
        html
    }
}
