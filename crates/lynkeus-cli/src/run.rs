//! The subcommands.

use std::path::Path;
use std::process::ExitCode;

use lynkeus::{CheckOptions, Checkpoint, Error, Outcome, Study};
use serde_json::Value;

use super::files::Output;
use super::inputs::{self, Source};
use super::progress::{Alive, Progress};
use super::save::{Results, is_standard};
use super::{limits, output};

pub(super) fn check(
    source: &Source,
    options: &CheckOptions,
    singular: Option<&Path>,
    json: bool,
) -> Result<ExitCode, Error> {
    let files = source.files().draws("--singular", singular);
    files.prints_json(json).check()?;
    let alive = Alive::new("examining");
    let report = lynkeus::check(&source.study, options);
    drop(alive);
    let report = report?;
    let mut results = Results::default();
    if let Some(path) = singular {
        let svg = report.picture().and_then(|picture| picture.to_svg());
        results.picture(path, svg)?;
    }
    results.report(json, &report, || report.to_json());
    results.keep()?;
    Ok(match report.is_positive() {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(1),
    })
}

pub(super) fn design(source: &Source, file: Option<&Path>, json: bool) -> Result<ExitCode, Error> {
    source.files().writes("-o", file).check()?;
    let alive = Alive::new("designing");
    let report = lynkeus::design(&source.study);
    drop(alive);
    let report = report?;
    tell(file, json, &report, || report.to_json())?;
    Ok(ExitCode::SUCCESS)
}

pub(super) fn certify(source: &Source, file: Option<&Path>, json: bool) -> Result<ExitCode, Error> {
    source.files().writes("-o", file).check()?;
    let alive = Alive::new("certifying");
    let report = lynkeus::certify(&source.study);
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
    to_json: impl FnOnce() -> Value,
) -> Result<(), Error> {
    let mut results = Results::default();
    match file {
        None => results.report(json, report, to_json),
        Some(path) if json => results.put(path, output::json(&to_json()))?,
        Some(path) => results.put(path, output::text(report))?,
    }
    results.keep()
}

pub(super) fn simulate(
    source: &Source,
    output: &Output,
    log: Option<&Path>,
) -> Result<ExitCode, Error> {
    output
        .added_to(source.files().writes("--log", log))
        .check()?;
    let mut progress = Progress::new("simulating", output.quiet);
    let outcome = lynkeus::simulate(&source.study, &mut progress.watch())?;
    progress.finish();
    let mut results = Results::default();
    if let Some(path) = log {
        let columns = outcome.log(&source.study.estimate);
        let columns = columns.map_err(|e| e.at(&source.study.file))?;
        results.write(path, |to| output::table(path, &columns, to))?;
    }
    let code = finish(&source.study, output, &outcome, true, results)?;
    Ok(limits::code(&source.study, code))
}

pub(super) fn estimate(
    source: &Source,
    log: &Path,
    output: &Output,
    checkpoint: Option<&Path>,
) -> Result<ExitCode, Error> {
    if checkpoint.is_some_and(is_standard) {
        let message = "--checkpoint needs a file, found -, which is standard output";
        return Err(Error::input(message).hint("name a file after --checkpoint"));
    }
    let files = source.files().reads("the log", Some(log));
    let files = output.added_to(files).writes("--checkpoint", checkpoint);
    files.check()?;
    let study = &source.study;
    let table = inputs::log(study, log)?;
    let mut checkpoint = checkpoint.map(Checkpoint::new);
    let mut progress = Progress::new("estimating", output.quiet);
    let outcome = match &mut checkpoint {
        None => lynkeus::estimate(study, &table, &mut progress.watch())?,
        Some(checkpoint) => {
            lynkeus::estimate_resumed(study, &table, checkpoint, &mut progress.watch())?
        }
    };
    progress.finish();
    drop(table);
    if let Some(checkpoint) = checkpoint
        .as_ref()
        .filter(|c| c.resumed() > 0 && !output.quiet)
    {
        output::note(&format!("went on after row {}", checkpoint.resumed()));
    }
    let code = finish(study, output, &outcome, false, Results::default())?;
    // a run that a limit ended goes on another time
    if let Some(checkpoint) = checkpoint.filter(|_| study.budget.marked().is_none()) {
        checkpoint.remove()?;
    }
    Ok(limits::code(study, code))
}

pub(super) fn compare(
    source: &Source,
    log: Option<&Path>,
    output: &Output,
) -> Result<ExitCode, Error> {
    let files = source.files().reads("the log", log);
    output.added_to(files).check()?;
    let table = log.map(|log| inputs::log(&source.study, log)).transpose()?;
    let mut progress = Progress::new("comparing", output.quiet);
    let found = lynkeus::compare(&source.study, table.as_ref(), &mut progress.watch())?;
    progress.finish();
    found.warnings().iter().for_each(|text| output::warn(text));
    let mut results = Results::default();
    if let Some(path) = &output.plot {
        let picture = found.picture(source.study.time_unit.as_deref());
        results.picture(path, picture.to_svg())?;
    }
    results.report(output.json, &found, || found.to_json());
    results.keep()?;
    let code = match found.is_positive() {
        true => ExitCode::SUCCESS,
        false => ExitCode::from(1),
    };
    Ok(limits::code(&source.study, code))
}

/// Everything is computed before the first file is written. Where nothing is asked for, and where
/// all that is asked for is a picture that cannot be drawn, the columns are printed.
fn finish(
    study: &Study,
    output: &Output,
    outcome: &Outcome,
    simulated: bool,
    mut results: Results,
) -> Result<ExitCode, Error> {
    outcome.warnings.iter().for_each(|text| output::warn(text));
    if !output.quiet {
        outcome.notes.iter().for_each(|note| output::note(note));
    }
    let columns = outcome.columns(simulated);
    let mut shown = output.json;
    if let Some(path) = &output.plot {
        let figure = lynkeus::figure(outcome, study.time_unit.as_deref(), study.show.as_deref());
        let svg = figure.and_then(|figure| figure.to_svg());
        shown |= svg.is_ok();
        results.picture(path, svg)?;
    }
    let printed = Path::new("-");
    match &output.output {
        Some(path) => results.write(path, |to| output::table(path, &columns, to))?,
        None if !shown && !results.has_printed() => {
            results.write(printed, |to| output::table(printed, &columns, to))?
        }
        None => {}
    }
    if output.json {
        results.print(&output::json(&outcome.to_json(simulated)));
    }
    results.keep()?;
    match outcome.refusal() {
        None => Ok(ExitCode::SUCCESS),
        Some(refusal) => {
            output::complain(&refusal);
            Ok(ExitCode::from(1))
        }
    }
}
