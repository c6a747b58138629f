//! `lynkeus simulate --runs`.

use std::process::ExitCode;

use lynkeus::{Error, Series};

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
    if let Some(path) = &output.plot {
        let figure = found.figure(study.time_unit.as_deref(), study.show.as_deref());
        results.picture(path, figure.and_then(|figure| figure.to_svg()))?;
    }
    if let Some(path) = &output.output {
        let columns = found.columns().into_iter();
        let columns: Vec<(String, Series)> = columns
            .map(|(name, values)| (name, values.to_vec().into()))
            .collect();
        let columns: Vec<(String, &Series)> = columns
            .iter()
            .map(|(name, values)| (name.clone(), values))
            .collect();
        results.write(path, |to| output::table(path, &columns, to))?;
    }
    results.report(output.json, &found, || found.to_json());
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
