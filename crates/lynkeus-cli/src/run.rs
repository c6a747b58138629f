//! The subcommands.

use std::path::Path;

use lynkeus::{Answer, CheckOptions, Checkpoint, Error, Outcome};

use super::ending::Ending;
use super::inputs::{self, Source};
use super::options::Output;
use super::progress::{Alive, Progress};
use super::save::{Results, is_standard};
use super::{limits, output};

pub(super) fn check(
    source: &Source,
    options: &CheckOptions,
    singular: Option<&Path>,
    json: bool,
) -> Result<Ending, Error> {
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
    let output = Output {
        json,
        ..Output::default()
    };
    results.tell(&report, &output)
}

pub(super) fn design(source: &Source, file: Option<&Path>, json: bool) -> Result<Ending, Error> {
    source.files().writes("-o", file).check()?;
    let alive = Alive::new("designing");
    let report = lynkeus::design(&source.study);
    drop(alive);
    tell(file, json, &report?)
}

pub(super) fn certify(source: &Source, file: Option<&Path>, json: bool) -> Result<Ending, Error> {
    source.files().writes("-o", file).check()?;
    let alive = Alive::new("certifying");
    let report = lynkeus::certify(&source.study);
    drop(alive);
    tell(file, json, &report?)
}

/// A report as text or as JSON, to a file or to standard output.
fn tell(file: Option<&Path>, json: bool, answer: &dyn Answer) -> Result<Ending, Error> {
    let mut results = Results::default();
    match file {
        None => results.answer(json, answer),
        Some(path) if json => results.put(path, output::json(&answer.to_json()))?,
        Some(path) => results.put(path, answer.text())?,
    }
    results.keep()?;
    Ok(output::verdict(answer))
}

pub(super) fn simulate(
    source: &Source,
    output: &Output,
    log: Option<&Path>,
) -> Result<Ending, Error> {
    let files = source.files().writes("--log", log);
    files.asked(output).check()?;
    let mut progress = Progress::new("simulating", output.quiet);
    let outcome = lynkeus::simulate(&source.study, &mut progress.watch())?;
    progress.finish();
    let mut results = Results::default();
    if let Some(path) = log {
        let columns = outcome.log()?;
        results.write(path, |to| output::table(path, &columns, to))?;
    }
    let code = finish(output, &outcome, results)?;
    Ok(limits::code(&source.study, code))
}

pub(super) fn open_run(source: &Source, log: &Path, output: &Output) -> Result<Ending, Error> {
    let files = source.files().reads("the log", Some(log));
    files.asked(output).check()?;
    let study = &source.study;
    let table = inputs::log(study, log)?;
    let mut progress = Progress::new("simulating", output.quiet);
    let run = lynkeus::open_run(study, &table, &mut progress.watch())?;
    progress.finish();
    drop(table);
    let code = Results::default().tell(&run, output)?;
    Ok(limits::code(study, code))
}

pub(super) fn estimate(
    source: &Source,
    log: &Path,
    output: &Output,
    checkpoint: Option<&Path>,
) -> Result<Ending, Error> {
    if checkpoint.is_some_and(is_standard) {
        let message = "--checkpoint needs a file, found -, which is standard output";
        return Err(Error::input(message).hint("name a file after --checkpoint"));
    }
    let files = source.files().reads("the log", Some(log));
    let files = files.asked(output).writes("--checkpoint", checkpoint);
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
    let code = finish(output, &outcome, Results::default())?;
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
) -> Result<Ending, Error> {
    let files = source.files().reads("the log", log);
    files.asked(output).check()?;
    let table = log.map(|log| inputs::log(&source.study, log)).transpose()?;
    let mut progress = Progress::new("comparing", output.quiet);
    let found = lynkeus::compare(&source.study, table.as_ref(), &mut progress.watch())?;
    progress.finish();
    let code = Results::default().tell(&found, output)?;
    Ok(limits::code(&source.study, code))
}

/// Everything is computed before the first file is written. Where nothing is asked for, and where
/// all that is asked for is a picture that cannot be drawn, the columns are printed.
fn finish(asked: &Output, outcome: &Outcome, mut results: Results) -> Result<Ending, Error> {
    output::remarks(outcome, asked.quiet);
    let columns = outcome.columns();
    let mut shown = asked.json;
    if let Some(path) = &asked.plot {
        let svg = outcome.figure().and_then(|figure| figure.to_svg());
        shown |= svg.is_ok();
        results.picture(path, svg)?;
    }
    let printed = Path::new("-");
    match &asked.output {
        Some(path) => results.write(path, |to| output::table(path, &columns, to))?,
        None if !shown && !results.has_printed() => {
            results.write(printed, |to| output::table(printed, &columns, to))?
        }
        None => {}
    }
    if asked.json {
        results.print(&output::json(&outcome.to_json()));
    }
    results.keep()?;
    Ok(output::verdict(outcome))
}
