//! What of a study's estimator may be changed while it runs elsewhere.

use lynkeus_export::curly::{self, Entry};
use lynkeus_observers::{Design, Tunable, Tuning};
use lynkeus_run::{Blueprint, Updates};

use crate::Error;
use lynkeus_experiment::prepare::{Prepared, StudyDesign};

/// The design with what may be changed as symbols.
pub(crate) fn design(prepared: &Prepared<'_>) -> Result<StudyDesign, Error> {
    let tuning = Tuning {
        tunable: true,
        ..prepared.study().observer.tuning.clone()
    };
    prepared.design_with(&tuning)
}

/// The numbers of an estimator that may be changed.
fn tunables<'d>(design: &'d Design, made: &Blueprint) -> &'d [Tunable] {
    let numbers = &design.observer.tunables;
    match &made.updates {
        Updates::Jumps { tuned: Some(_), .. } => numbers,
        Updates::Filter { model, .. } if model.process_noise.iter().any(|q| *q > 0.0) => numbers,
        Updates::Jumps { .. } | Updates::Filter { .. } => &[],
    }
}

/// What the user should know of them.
pub(crate) fn note(design: &Design, made: &Blueprint) -> String {
    let numbers = tunables(design, made).iter();
    let names: Vec<&str> = numbers.map(|tunable| tunable.name.as_str()).collect();
    if !names.is_empty() {
        return format!(
            "{} may be changed while it runs: what is guaranteed holds for the study's values, and larger ones may need shorter steps",
            names.join(", ")
        );
    }
    let reason = match (design.observer.is_whole, &made.updates) {
        (true, _) => {
            "a gain by linear matrix inequalities has no θ: it is made, and proved, as a whole"
        }
        (false, Updates::Filter { .. }) => "without process noise there is none to scale",
        (false, Updates::Jumps { .. }) => "its equations read no gain",
    };
    format!("nothing may be changed while it runs: {reason}")
}

/// As the printed text has them.
pub(crate) fn printed(design: &Design, made: &Blueprint) -> Vec<curly::Tunable> {
    let each = tunables(design, made).iter().map(|known| curly::Tunable {
        entry: Entry {
            name: known.name.clone(),
            about: known.meaning.clone(),
        },
        start: known.value,
    });
    each.collect()
}
