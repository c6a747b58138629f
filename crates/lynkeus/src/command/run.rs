//! The subcommands.

use std::path::Path;
use std::process::ExitCode;

use lynkeus::{CheckOptions, Error, Outcome, Study, Table};
use serde_json::{Value, json};

use super::output::{self, print};
use super::progress::{Alive, Progress};
use super::{Output, limits};

pub(super) fn check(
    study: &Study,
    options: &CheckOptions,
    singular: Option<&Path>,
    json: bool,
) -> Result<ExitCode, Error> {
    let alive = Alive::new("examining");
    let report = lynkeus::check(study, options);
    drop(alive);
    let report = report?;
    if let Some(path) = singular {
        output::write(path, report.picture()?.to_svg()?.as_bytes())?;
    }
    match json {
        true => print(&format!("{:#}\n", report.to_json()))?,
        false => print(&report.to_string())?,
    }
    Ok(match report.is_positive() {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(1),
    })
}

pub(super) fn design(study: &Study, file: Option<&Path>, json: bool) -> Result<ExitCode, Error> {
    let alive = Alive::new("designing");
    let report = lynkeus::design(study);
    drop(alive);
    let report = report?;
    tell(file, json, &report, || report.to_json())?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn certify(study: &Study, file: Option<&Path>, json: bool) -> Result<ExitCode, Error> {
    let alive = Alive::new("certifying");
    let report = lynkeus::certify(study);
    drop(alive);
    let report = report?;
    tell(file, json, &report, || report.to_json())?;
    Ok(match report.is_refuted() {
        true => ExitCode::from(1),
        false => ExitCode::SUCCESS,
    })
}

/// A report as text or as JSON, to a file or to standard output.
fn tell(
    file: Option<&Path>,
    json: bool,
    report: &impl std::fmt::Display,
    to_json: impl Fn() -> Value,
) -> Result<(), Error> {
    let text = match json {
        true => format!("{:#}\n", to_json()),
        false => report.to_string(),
    };
    match file {
        Some(path) => output::write(path, text.as_bytes()),
        None => print(&text),
    }
}

pub(super) fn simulate(
    study: &Study,
    output: &Output,
    log: Option<&Path>,
) -> Result<ExitCode, Error> {
    let mut progress = Progress::new("simulating", output.quiet);
    let outcome = lynkeus::simulate(study, &mut progress.watch())?;
    progress.finish();
    if let Some(path) = log {
        output::write_table(path, &logged(&outcome))?;
    }
    let code = finish(study, output, &outcome, true)?;
    Ok(limits::code(study, code))
}

pub(super) fn estimate(study: &Study, log: &Path, output: &Output) -> Result<ExitCode, Error> {
    let table = Table::load(log)?;
    let mut progress = Progress::new("estimating", output.quiet);
    let outcome = lynkeus::estimate(study, &table, &mut progress.watch())?;
    progress.finish();
    let code = finish(study, output, &outcome, false)?;
    Ok(limits::code(study, code))
}

/// `t`, the measured outputs and the inputs.
fn logged(outcome: &Outcome) -> Vec<(String, &[f64])> {
    let mut columns: Vec<(String, &[f64])> = vec![("t".to_owned(), &outcome.time)];
    columns.extend(
        outcome
            .measurements
            .iter()
            .map(|(name, values)| (name.clone(), &values[..])),
    );
    let inputs = outcome.quantities.iter().filter(|q| q.is_input);
    columns.extend(inputs.filter_map(|q| Some((q.name.clone(), &q.truth.as_ref()?[..]))));
    columns
}

/// Everything is computed before the first file is written.
fn finish(
    study: &Study,
    output: &Output,
    outcome: &Outcome,
    simulated: bool,
) -> Result<ExitCode, Error> {
    let picture = match &output.plot {
        Some(path) => {
            let figure =
                lynkeus::figure(outcome, study.time_unit.as_deref(), study.show.as_deref())?;
            Some((path, figure.to_svg()?))
        }
        None => None,
    };
    if !output.quiet {
        outcome.notes.iter().for_each(|note| output::note(note));
    }
    let columns = outcome.columns(simulated);
    if let Some((path, svg)) = &picture {
        output::write(path, svg.as_bytes())?;
    }
    let to_stdout = output.output.as_deref() == Some(Path::new("-"));
    match &output.output {
        Some(path) if !to_stdout => output::write_table(path, &columns)?,
        Some(_) => print(&output::csv(&columns)?)?,
        None if !output.json && picture.is_none() => print(&output::csv(&columns)?)?,
        None => {}
    }
    if output.json && !to_stdout {
        print(&format!("{:#}\n", summary(outcome, &columns)))?;
    }
    Ok(ExitCode::SUCCESS)
}

fn summary(outcome: &Outcome, columns: &[(String, &[f64])]) -> Value {
    let object = |pairs: Vec<(String, Value)>| Value::Object(pairs.into_iter().collect());
    let estimated = || outcome.quantities.iter().filter(|q| q.estimate.is_some());
    let last = |q: &lynkeus::Quantity| json!(q.estimate.as_ref().and_then(|values| values.last()));
    let settled = |q: &lynkeus::Quantity| Some((q.name.clone(), json!(q.settled_error()?)));
    let gains = outcome.design.gains.iter().map(|gain| {
        let entries = gain
            .entries
            .iter()
            .map(|(state, k)| (state.clone(), json!(k)));
        (gain.output.clone(), object(entries.collect()))
    });
    let watches = outcome
        .watches
        .iter()
        .map(|w| (w.monitor.name.clone(), json!({ "alarm_at": w.alarm })));
    json!({
        "plant": outcome.plant,
        "family": outcome.design.observer.family,
        "chains": outcome.design.examination.chains,
        "gains": object(gains.collect()),
        "rows": outcome.time.len(),
        "columns": columns.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "final": object(estimated().map(|q| (q.name.clone(), last(q))).collect()),
        "rms_error_last_half": object(estimated().filter_map(settled).collect()),
        "monitors": object(watches.collect()),
        "notes": outcome.notes,
    })
}
