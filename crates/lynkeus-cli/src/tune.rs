//! `lynkeus tune`.

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
use lynkeus::Error;

/// On what it is judged and where the answer goes.
#[derive(Debug, Args)]
pub(super) struct Options {
    /// Judge on this log, not in simulation: by held-out samples, or by a filter's likelihood
    #[arg(long, value_name = "LOG.csv")]
    log: Option<PathBuf>,
    /// Write the figures of every value as CSV ("-": standard output)
    #[arg(short, long, value_name = "FILE.csv")]
    output: Option<PathBuf>,
    /// Draw the figures over the values, and mark the knee
    #[arg(long, value_name = "FILE.svg")]
    plot: Option<PathBuf>,
    /// Print one JSON object instead of a table
    #[arg(long)]
    json: bool,
    /// Write the knee's value into the study, and change nothing else in it
    #[arg(long)]
    write: bool,
    /// Print no progress bar and no notes
    #[arg(short, long)]
    quiet: bool,
}

/// Everything is computed before the first file is written.
pub(super) fn tune(path: &Path, options: &Options, limits: &Limits) -> Result<Ending, Error> {
    if options.write && is_standard(path) {
        return Err(Error::input("--write needs a study that is a file"));
    }
    let source = Source::load(path, limits.budget())?;
    let files = match options.write {
        true => source.plant().writes(files::CHANGED, Some(path)),
        false => source.files(),
    };
    files
        .reads("the log", options.log.as_deref())
        .writes("-o", options.output.as_deref())
        .draws("--plot", options.plot.as_deref())
        .prints_json(options.json)
        .check()?;
    let log = options.log.as_deref();
    let log = log.map(|log| inputs::log(&source.study, log)).transpose()?;
    let mut progress = Progress::new("tuning", options.quiet);
    let sweep = lynkeus::tune(&source.study, log.as_ref(), &mut progress.watch())?;
    progress.finish();
    if sweep.is_empty_handed() {
        return Err(sweep.refusal().at(&source.study.file));
    }
    let (text, changes) = match options.write {
        true => written::study(path, |text| sweep.rewritten(text))?,
        false => (String::new(), vec![]),
    };
    output::remarks(&sweep, options.quiet);
    let mut results = Results::default();
    results.files(&sweep, options.plot.as_deref(), None)?;
    if let Some(file) = &options.output {
        results.put(file, sweep.to_csv()?)?;
    }
    if options.write {
        results.put(path, text)?;
    }
    let asked = options.write.then_some((path, &changes[..]));
    written::show(&sweep, asked, options.json, &mut results);
    results.keep()?;
    Ok(limits::code(&source.study, Ending::Done))
}
