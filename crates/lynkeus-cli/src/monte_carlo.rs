//! `lynkeus simulate --runs`.

use lynkeus::Error;

use super::ending::Ending;
use super::inputs::Source;
use super::limits;
use super::options::Output;
use super::progress::Progress;
use super::save::Results;

/// Everything is computed before the first file is written.
pub(super) fn monte_carlo(source: &Source, output: &Output, runs: usize) -> Result<Ending, Error> {
    source.files().asked(output).check()?;
    let study = &source.study;
    let mut progress = Progress::new("simulating", output.quiet);
    let found = lynkeus::monte_carlo(study, runs, &mut progress.watch())?;
    progress.finish();
    let code = Results::default().tell(&found, output)?;
    Ok(limits::code(study, code))
}
