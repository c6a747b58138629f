//! `lynkeus simulate --runs`.

use std::process::ExitCode;

use lynkeus::Error;

use super::files::Output;
use super::inputs::Source;
use super::progress::Progress;
use super::save::Results;
use super::{limits, output};

/// Everything is computed before the first file is written.
pub(super) fn monte_carlo(
    source: &Source,
    output: &Output,
    runs: usize,
) -> Result<ExitCode, Error> {
    output.added_to(source.files()).check()?;
    let study = &source.study;
    let mut progress = Progress::new("simulating", output.quiet);
    let found = lynkeus::monte_carlo(study, runs, &mut progress.watch())?;
    progress.finish();
    if !output.quiet {
        found.notes.iter().for_each(|note| output::note(note));
    }
    let mut results = Results::default();
    results.files(&found, output.plot.as_deref(), output.output.as_deref())?;
    results.answer(output.json, &found);
    results.keep()?;
    let code = match found.refusal() {
        None => ExitCode::SUCCESS,
        Some(refusal) => {
            output::complain(&refusal);
            ExitCode::from(1)
        }
    };
    Ok(limits::code(study, code))
}
