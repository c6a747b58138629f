//! A study as one page: what can be known, the design, its certificate, and estimates that move.
//!
//! The page holds the samples and the estimator itself, as JavaScript from the same printer as the
//! export's, once for every position of a slider.

mod data;
mod fitted;
mod html;
mod knob;
mod positions;
mod run;
mod sections;
mod told;
mod tradeoff;

use std::ops::ControlFlow;

use lynkeus_export::curly::c::prefix;

use crate::print::{device::causal, head::file_name};
use crate::{CheckOptions, Error, Study, Table, certify, check};
use fitted::Fitted;
use knob::Knob;
use lynkeus_experiment::course::columns::Log;
use lynkeus_experiment::course::fixed_steps;
use lynkeus_experiment::course::sampling::Sampling;
use lynkeus_experiment::estimated;
use lynkeus_experiment::prepare;
use lynkeus_experiment::prepare::Prepared;
use lynkeus_experiment::tune::bench::Ground;
use positions::Positions;
use told::{Told, without_folder};
use tradeoff::Tradeoff;

/// A report.
#[derive(Clone, Debug)]
pub struct Page {
    /// the file: the model's name in lower case, what file names and C forbid replaced by `_`
    pub name: String,
    /// the page: one file that asks for nothing else
    pub html: String,
    /// what the user should know
    pub notes: Vec<String>,
    /// the answer "no", where the estimates of the page are not credible
    pub refusal: Option<Error>,
}

/// How a page is made.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct ReportOptions {
    /// longest step of the integration, in the unit of time, instead of the study's
    pub step: Option<f64>,
}

/// What is known of a study as one self-contained page of HTML, with its estimates on a log, or
/// on its simulation as a logger would have it. The estimates are those of
/// [`estimate()`](crate::estimate()) with the fixed steps that the page tells, and sliders run the
/// observer anew in the page; where it cannot run there the page says why, and shows estimates as
/// `[estimate]` says. What every position of the slider is worth is judged as by [`tune()`](crate::tune()).
/// `watch` is told the fraction done and may stop the run.
///
/// # Errors
/// As [`estimate()`](crate::estimate()); a step that is none; a study without `[simulate]` where there is no log.
/// What cannot be checked or certified is told in the page.
pub fn report(
    study: &Study,
    log: Option<&Table>,
    options: &ReportOptions,
    watch: &mut dyn FnMut(f64) -> ControlFlow<()>,
) -> Result<Page, Error> {
    let step = fixed_steps::sound(options.step)?;
    let plant = prepare::plant(study)?;
    let mut notes = vec![];
    let causal = causal(study, &mut notes);
    let prepared = Prepared::new(&causal, &plant)?;
    let recorded = match log {
        Some(_) => None,
        None => Some(run::simulated(&prepared, study, &plant, &mut notes)?),
    };
    let (table, ground) = match (log, &recorded) {
        (Some(log), _) => (log, Ground::Log(log)),
        (None, Some(Sampling { table, step, .. })) => (table, Ground::Simulation { step: *step }),
        (None, None) => return Err(Error::input("neither a log nor a simulation")),
    };
    let design = prepared.design()?;
    let as_it_is = prepared.run_by(study)?;
    let positions = Positions::new(&as_it_is, &design)?;
    let (moving, outcome) = match run::fixed(&prepared, &design, step, table, watch)? {
        Ok((fixed, outcome)) => {
            run::told(&fixed, &mut notes);
            let knob = Knob::new(&prepared, &fixed, positions.as_ref());
            (Ok(knob), outcome)
        }
        Err(why) => {
            // the estimates are then the command's own
            notes.clear();
            (Err(why), estimated(&as_it_is, table, watch)?)
        }
    };
    // a filter that cannot move takes too long, or has no noises to move
    let positions = positions.filter(|_| moving.is_ok() || design.observer.filter.is_none());
    let tradeoff = match positions {
        Some(positions) => Some(Tradeoff::new(&as_it_is, &design, positions, ground, watch)?),
        None => None,
    };
    let fitted = log.and_then(|log| Fitted::new(study, log, watch));
    let samples = Log::read(&prepared, table)?.own_samples();
    notes.extend_from_slice(&outcome.warnings);
    notes.extend_from_slice(&outcome.notes);
    // a page goes to others: no folder of this machine
    let named = Study {
        file: file_name(&study.file),
        ..study.clone()
    };
    let mut certified = certify(&named);
    if let Ok(certified) = &mut certified {
        // of the samples that the page shows
        certified.sampling = outcome.intervals.clone();
    }
    let told = Told {
        study,
        plant: &plant,
        source: match log {
            Some(log) => format!("the log {}", file_name(&log.place())),
            None => "a simulation of the study".to_owned(),
        },
        checked: checked(&named),
        fitted,
        certified,
        data: data::json(&prepared, &outcome, &samples, &moving, tradeoff.as_ref()),
        tradeoff,
        outcome,
        moving,
        notes,
    };
    Ok(Page {
        name: format!("{}.html", prefix(&plant.name)),
        html: told.page(),
        refusal: told.outcome.refusal(),
        notes: told.notes,
    })
}

/// What `check` says to others: files without the folders of this machine.
fn checked(study: &Study) -> Result<check::Report, Error> {
    let mut report = check(study, &CheckOptions::default())?;
    report.warnings = report.warnings.iter().map(without_folder).collect();
    Ok(report)
}

/// The style of a page.
pub const STYLE: &str = include_str!("../../assets/report/report.css");
const SCRIPT: &str = include_str!("../../assets/report/report.js");
/// What draws its pictures: uPlot.
pub const PLOT: &str = include_str!("../../assets/uplot/uPlot.iife.min.js");
/// Their style.
pub const PLOT_STYLE: &str = include_str!("../../assets/uplot/uPlot.min.css");
/// Under which licence they are drawn; a page has it in it.
pub const PLOT_LICENSE: &str = include_str!("../../assets/uplot/LICENSE");

/// Nothing is asked for, whatever the page holds.
const POLICY: &str = "default-src 'none'; script-src 'unsafe-inline'; style-src 'unsafe-inline'; img-src data:; base-uri 'none'; form-action 'none'";

impl Told<'_> {
    fn page(&self) -> String {
        let body = self.tell();
        let title = html::escaped(&format!("{}: what is estimated", self.outcome.plant));
        let variants = self.moving.as_ref().map_or(&[][..], |knob| &knob.variants);
        let observers: Vec<String> = variants
            .iter()
            .map(|variant| format!("() => {}", variant.text))
            .collect();
        let observers = observers.join(",\n");
        let data = data::in_a_script(&self.data);
        format!(
            "<!DOCTYPE html>
<html lang=\"en\">
<head>
<meta charset=\"utf-8\">
<meta http-equiv=\"Content-Security-Policy\" content=\"{POLICY}\">
<meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">
<meta name=\"color-scheme\" content=\"light dark\">
<meta name=\"generator\" content=\"lynkeus {}\">
<link rel=\"icon\" href=\"data:,\">
<title>{title}</title>
<style>
{PLOT_STYLE}
{STYLE}</style>
</head>
<body>
{body}<script>
/*
{PLOT_LICENSE}*/
{PLOT}</script>
<script id=\"observers\">
const observers = [
{observers}
];
</script>
<script type=\"application/json\" id=\"data\">{data}</script>
<script>
{SCRIPT}</script>
</body>
</html>
",
            env!("CARGO_PKG_VERSION"),
        )
    }
}
