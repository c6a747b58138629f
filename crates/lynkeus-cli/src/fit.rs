//! `lynkeus fit`.

use std::path::{Path, PathBuf};

use clap::Args;

use super::ending::Ending;
use super::files;
use super::inputs::{self, Source};
use super::limits::{self, Limits};
use super::output;
use super::progress::Progress;
use super::save::{Results, is_standard};
use super::written;
use lynkeus::{Answer, Error, FitOptions};

/// What it is fitted to and where the answer goes.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Logs (CSV or Parquet; "-": standard input)
    #[arg(required = true, value_name = "LOG.csv")]
    logs: Vec<PathBuf>,
    /// Write the fitted values into the study, and change nothing else in it
    #[arg(long)]
    write: bool,
    /// Compute intervals by profile likelihood: optimise the other values along each one
    #[arg(long)]
    profiles: bool,
    /// Predict the standard errors with one more log: with another sensor, sampling or input
    #[arg(long)]
    next_experiment: bool,
    /// Write the innovations of every row as CSV ("-": standard output)
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
    /// Draw the innovations and their autocorrelation
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Print no progress bar and no notes
    #[arg(short, long)]
    quiet: bool,
}

/// Everything is computed before the first file is written.
pub(super) fn fit(path: &Path, options: &Options, limits: &Limits) -> Result<Ending, Error> {
    if options.write && is_standard(path) {
        return Err(Error::input("--write needs a study that is a file"));
    }
    let source = Source::load(path, limits.budget())?;
    let files = match options.write {
        true => source.plant().writes(files::CHANGED, Some(path)),
        false => source.files(),
    };
    let logs = options.logs.iter();
    logs.clone()
        .fold(files, |files, log| files.reads("the log", Some(log)))
        .writes("-o", options.output.as_deref())
        .draws("--plot", options.plot.as_deref())
        .prints_json(options.json)
        .check()?;
    let tables = logs.map(|log| inputs::log(&source.study, log));
    let tables = tables.collect::<Result<Vec<_>, _>>()?;
    let asked = FitOptions {
        profiles: options.profiles,
        next_experiment: options.next_experiment,
    };
    let mut progress = Progress::new("fitting", options.quiet);
    let fit = lynkeus::fit(&source.study, &tables, asked, &mut progress.watch())?;
    progress.finish();
    // values that are none of the plant's do not get into the study
    let is_written = options.write && fit.is_positive();
    let (text, changes) = match is_written {
        true => written::study(path, |text| fit.rewritten(text))?,
        false => (String::new(), vec![]),
    };
    output::remarks(&fit, options.quiet);
    let mut results = Results::default();
    results.files(&fit, options.plot.as_deref(), options.output.as_deref())?;
    if is_written {
        results.put(path, text)?;
    }
    let asked = options.write.then_some((path, &changes[..]));
    written::show(&fit, asked, options.json, &mut results);
    results.keep()?;
    Ok(limits::code(&source.study, output::verdict(&fit)))
}
