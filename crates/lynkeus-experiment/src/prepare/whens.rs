//! What does not go along where a plant's state jumps at events.

use lynkeus_model::Plant;

use crate::{Error, Study};

/// A part of the tool that takes plants whose state never jumps.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Part {
    /// a family of observers
    Family,
    /// what this command, or this part of one, makes of the plant
    Command(&'static str),
}

/// That a plant's state never jumps.
///
/// # Errors
/// The line of the first `when`.
pub fn refuse(study: &Study, plant: &Plant, part: Part) -> Result<(), Error> {
    match plant.whens.is_empty() {
        true => Ok(()),
        false => Err(refused(study, plant, part)),
    }
}

pub(super) fn refused(study: &Study, plant: &Plant, part: Part) -> Error {
    let lines = plant.whens.lines();
    let line = lines.first().copied().unwrap_or_default();
    let subject = match (part, &study.observer.family) {
        (Part::Command(what), _) => what.to_owned(),
        (Part::Family, Some(name)) => format!("family = \"{}\"", name.text),
        (Part::Family, None) => "this observer".to_owned(),
    };
    let model = &plant.name;
    let message = format!(
        "{subject}: the state of '{model}' jumps at events (`when` of line {line}), which this does not follow"
    );
    let hint = "family = \"ekf\" follows them, with its smoother; `simulate` does without an observer";
    Error::refused(message).at(&study.file).hint(hint)
}
