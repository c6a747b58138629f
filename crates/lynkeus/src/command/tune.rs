//! `lynkeus tune`.

use std::path::{Path, PathBuf};
use std::process::ExitCode;

use clap::Args;
use serde_json::json;

use lynkeus::tune::{Change, Sweep};
use lynkeus::{Error, Table};

use super::limits::{self, Limits};
use super::output::{self, print};
use super::progress::Progress;

/// On what it is judged and where the answer goes.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Judge by the prediction of held-out samples of this log instead of by simulation
    #[arg(long, value_name = "LOG.csv")]
    log: Option<PathBuf>,
    /// Write the figures of every value as CSV ("-": standard output)
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
    /// Draw the figures over the values, with the knee marked
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Write the knee's value into the study; everything else in it stays as it is
    #[arg(long)]
    write: bool,
    /// No progress bar and no notes
    #[arg(short, long)]
    quiet: bool,
}

/// Everything is computed before the first file is written.
pub(super) fn tune(path: &Path, options: &Options, limits: &Limits) -> Result<ExitCode, Error> {
    let study = limits.study(path)?;
    let log = options.log.as_ref().map(Table::load).transpose()?;
    let mut progress = Progress::new("tuning", options.quiet);
    let sweep = lynkeus::tune(&study, log.as_ref(), &mut progress.watch())?;
    progress.finish();
    if sweep.is_empty_handed() {
        return Err(sweep.refusal().at(&study.file));
    }
    let picture = options.plot.as_ref().map(|path| (path, sweep.to_svg()));
    let rewritten = match options.write {
        true => Some(rewritten(path, &sweep)?),
        false => None,
    };
    if !options.quiet {
        sweep.notes.iter().for_each(|note| output::note(note));
    }
    if let Some((path, svg)) = picture {
        output::write(path, svg?.as_bytes())?;
    }
    let changes = match &rewritten {
        Some((text, changes)) => {
            output::write(path, text.as_bytes())?;
            &changes[..]
        }
        None => &[],
    };
    show(&sweep, changes, path, options)?;
    Ok(limits::code(&study, ExitCode::SUCCESS))
}

/// The study with the knee's values.
fn rewritten(path: &Path, sweep: &Sweep) -> Result<(String, Vec<Change>), Error> {
    let text = std::fs::read_to_string(path).map_err(|e| {
        Error::input(format!("cannot read the study again: {e}")).at(path.display())
    })?;
    let rewritten = sweep.rewritten(&text);
    rewritten.map_err(|error| error.at(path.display()))
}

fn show(sweep: &Sweep, changes: &[Change], path: &Path, options: &Options) -> Result<(), Error> {
    let to_stdout = options.output.as_deref() == Some(Path::new("-"));
    match &options.output {
        Some(_) if to_stdout => print(&sweep.to_csv()?)?,
        Some(file) => output::write(file, sweep.to_csv()?.as_bytes())?,
        None => {}
    }
    let told = changes.iter().map(|c| format!("{}: {c}", path.display()));
    if to_stdout {
        told.for_each(|change| output::note(&change));
        return Ok(());
    }
    if options.json {
        let mut answer = sweep.to_json();
        if options.write {
            let words: Vec<String> = changes.iter().map(Change::to_string).collect();
            answer["written"] = json!(words);
        }
        return print(&format!("{answer:#}\n"));
    }
    let told: String = told.map(|change| change + "\n").collect();
    print(&format!("{sweep}{told}"))
}
