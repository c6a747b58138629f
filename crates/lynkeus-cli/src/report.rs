//! `lynkeus report`: a study as one page.

use std::path::{Path, PathBuf};

use clap::Args;
use lynkeus::{Error, ReportOptions};

use super::ending::Ending;
use super::inputs::{self, Source};
use super::progress::Progress;
use super::save::Results;
use super::{limits, output};

#[derive(Debug, Args)]
pub(super) struct Options {
    /// Write the page here ("-": standard output)
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
    /// Longest step of the integration, in the unit of time (default: the study's)
    #[arg(long, value_name = "STEP")]
    step: Option<f64>,
    /// Print no progress bar and no notes
    #[arg(short, long)]
    quiet: bool,
}

pub(super) fn report(
    source: &Source,
    log: Option<&Path>,
    options: &Options,
) -> Result<Ending, Error> {
    let path = &options.output;
    let files = source.files().reads("the log", log);
    files.writes("-o", Some(path)).check()?;
    let table = log.map(|log| inputs::log(&source.study, log)).transpose()?;
    let mut progress = Progress::new("reporting", options.quiet);
    let wanted = ReportOptions { step: options.step };
    let page = lynkeus::report(
        &source.study,
        table.as_ref(),
        &wanted,
        &mut progress.watch(),
    )?;
    progress.finish();
    if !options.quiet {
        page.notes.iter().for_each(|note| output::note(note));
    }
    let mut results = Results::default();
    results.put(path, page.html)?;
    results.keep()?;
    let code = match &page.refusal {
        None => Ending::Done,
        Some(refusal) => {
            output::complain(refusal);
            Ending::No
        }
    };
    Ok(limits::code(&source.study, code))
}
