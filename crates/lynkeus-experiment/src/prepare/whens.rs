//! What does not go along where a plant's state jumps at events.

use lynkeus_model::Plant;

use crate::{Error, Study};

/// That a plant's state never jumps; `what` takes no other.
///
/// # Errors
/// The line of the first `when`.
pub fn refuse(study: &Study, plant: &Plant, what: &str) -> Result<(), Error> {
    match plant.whens.clauses.first() {
        None => Ok(()),
        Some(clause) => Err(refused(study, plant, clause.line, what)),
    }
}

/// None of the families that the study allows goes along.
pub(super) fn no_family(study: &Study, plant: &Plant) -> Error {
    let line = plant.whens.clauses.first().map_or(0, |clause| clause.line);
    let named = study.observer.family.as_ref();
    let what = named.map_or_else(
        || "this observer".to_owned(),
        |name| format!("family = \"{}\"", name.text),
    );
    refused(study, plant, line, &what)
}

fn refused(study: &Study, plant: &Plant, line: usize, what: &str) -> Error {
    let model = &plant.name;
    let message = format!(
        "{what}: the state of '{model}' jumps at events (`when` of line {line}), which this does not follow"
    );
    let hint = "`simulate`, and `estimate` and `export` with family = \"ekf\" or \"ukf\", follow them, smoothers too, and so do `fit` and `export --system plant`; `estimate` with \"particle\" as well";
    Error::refused(message).at(&study.file).hint(hint)
}
