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
        let columns = outcome.log(&study.estimate);
        output::write_table(path, &columns.map_err(|e| e.at(&study.file))?)?;
    }
    let code = finish(study, output, &outcome, true)?;
    Ok(limits::code(study, code))
}

pub(super) fn estimate(study: &Study, log: &Path, output: &Output) -> Result<ExitCode, Error> {
    let table = Table::load(log)?;
    let mut progress = Progress::new("estimating", output.quiet);
    let outcome = lynkeus::estimate(study, &table, &mut progress.watch())?;
    progress.finish();
    drop(table);
    let code = finish(study, output, &outcome, false)?;
    Ok(limits::code(study, code))
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
    match outcome.refusal() {
        None => Ok(ExitCode::SUCCESS),
        Some(refusal) => {
            output::complain(&refusal);
            Ok(ExitCode::from(1))
        }
    }
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
    let watches = outcome.watches.iter().map(|w| {
        let entry = json!({ "alarm_at": w.alarm, "column": w.header });
        (w.monitor.name.clone(), entry)
    });
    let headers = estimated().map(|q| (q.name.clone(), json!(q.estimate_header)));
    let doubts = outcome.doubts.iter().map(|d| {
        let entry = json!({ "rows": d.rows, "widths": d.widths });
        (d.name.clone(), entry)
    });
    let outside = |outside: &Option<lynkeus::Outside>| json!(outside.as_ref().map(|o| o.to_json()));
    json!({
        "plant": outcome.plant,
        "family": outcome.design.observer.family,
        "chains": outcome.design.examination.chains,
        "gains": object(gains.collect()),
        "rows": outcome.time.len(),
        "columns": columns.iter().map(|(name, _)| name).collect::<Vec<_>>(),
        "estimates": object(headers.collect()),
        "final": object(estimated().map(|q| (q.name.clone(), last(q))).collect()),
        "rms_error_last_half": object(estimated().filter_map(settled).collect()),
        "monitors": object(watches.collect()),
        "outside_box": {
            "plant": outside(&outcome.plant_outside),
            "estimate": outside(&outcome.estimate_outside),
        },
        "innovations": object(outcome.innovations.iter().map(|i| (i.output.clone(), i.to_json())).collect()),
        "credible": outcome.is_credible(),
        "doubts": object(doubts.collect()),
        "notes": outcome.notes,
    })
}
