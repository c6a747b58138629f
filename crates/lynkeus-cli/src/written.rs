//! Values that were found, into the study that they were found for.

use std::path::Path;

use lynkeus::{Answer, Change, Error, visible};

use super::output;
use super::save::Results;

/// The study's text as `rewritten` has it, and what changed.
pub(super) fn study(
    path: &Path,
    rewritten: impl FnOnce(&str) -> Result<(String, Vec<Change>), Error>,
) -> Result<(String, Vec<Change>), Error> {
    let text = std::fs::read_to_string(path).map_err(|e| {
        Error::input(format!("cannot read the study again: {e}")).at(path.display())
    })?;
    rewritten(&text).map_err(|error| error.at(path.display()))
}

/// An answer in words or as JSON, with what was written to the study where that was asked for; where standard output
/// has a result, that is a note.
pub(super) fn show(
    answer: &dyn Answer,
    written: Option<(&Path, &[Change])>,
    json: bool,
    results: &mut Results,
) {
    let changes = written.iter().flat_map(|(path, changes)| {
        let told = changes.iter();
        told.map(move |change| format!("{}: {change}", path.display()))
    });
    let told: Vec<String> = changes.collect();
    if results.has_printed() {
        return told.iter().for_each(|change| output::note(change));
    }
    if json {
        let mut object = answer.to_json();
        if let Some((_, changes)) = written {
            let words: Vec<String> = changes.iter().map(Change::to_string).collect();
            object["written"] = words.into();
        }
        return results.print(&output::json(&object));
    }
    results.answer(false, answer);
    told.iter()
        .for_each(|change| results.print(&format!("{}\n", visible::lines(change))));
}
