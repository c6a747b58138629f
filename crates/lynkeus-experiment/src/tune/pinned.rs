//! The study of a sweep: one family for all values.

use lynkeus_observers::{Examination, Family};
use lynkeus_structure::Standing;

use super::axis;
use crate::prepare::Prepared;
use crate::{Error, Study};
use lynkeus_study::Name;

/// A study that names its family.
pub(super) struct Pinned {
    pub study: Study,
    /// the key for which a value is proposed, as the study lacks it
    pub proposed: Option<&'static str>,
    /// which family that is, and which speed, where the study leaves them open
    pub notes: Vec<String>,
}

/// The study with its family named and with what is proposed for it: else each value could be
/// judged on a family of its own. It is the one that every command takes, if that has the keys that
/// are swept; else the first that may fit and has them.
///
/// # Errors
/// Keys of `[observer]` that cannot be used; keys to sweep that no family has together.
pub(super) fn pinned(prepared: &Prepared<'_>) -> Result<Pinned, Error> {
    let study = prepared.study();
    let as_it_is = || Pinned {
        study: study.clone(),
        proposed: None,
        notes: vec![],
    };
    let swept = axis::swept(study);
    if study.observer.family.is_some() && !swept.is_empty() {
        return Ok(as_it_is());
    }
    let Some(choice) = prepared.choice()? else {
        return Ok(as_it_is());
    };
    let owns = |family: &dyn Family| swept.iter().all(|key| key.is_of(family));
    let may_fit = |e: &&Examination| e.fit() != Standing::Refuted && owns(e.family);
    let family = match owns(choice.family) {
        true => Some(choice.family),
        false => prepared
            .examinations()?
            .iter()
            .find(may_fit)
            .map(|e| e.family),
    };
    let Some(family) = family else {
        let names = study.tune.keys.iter();
        let names: Vec<&str> = names.map(|(name, _)| name.text.as_str()).collect();
        let message = format!(
            "`keys` of [tune]: no family that may fit has all of {}",
            names.join(", ")
        );
        return Err(Error::input(message)
            .at(&study.file)
            .hint("name the family with `family` in [observer], and sweep keys that it has"));
    };
    let mut pinned = as_it_is();
    let proposal = choice.proposal.as_ref();
    if let Some(proposal) = proposal.filter(|_| family == choice.family) {
        pinned.study.observer.tuning = choice.completed(&study.observer.tuning);
        pinned.proposed = Some(proposal.speed.key());
        pinned.notes.push(proposal.to_string());
    }
    if choice.ended.is_some() {
        pinned.notes.extend(choice.notes());
    }
    if study.observer.family.is_none() {
        pinned.notes.push(format!(
            "every value is one of the family {family}; `family` of [observer] names another"
        ));
    }
    pinned.study.observer.family = Some(Name::from(family.name()));
    Ok(pinned)
}
