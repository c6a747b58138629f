//! The keys that `[tune]` sweeps: what of a study they mean.

use std::collections::BTreeSet;

use lynkeus_answer::Error;
use lynkeus_answer::near::suggest;
use lynkeus_observers::FAMILIES;

use crate::{Name, Study, Swept};

impl Study {
    /// Refuses keys to sweep that no family has; with `of_others` those, too, that none in question has.
    ///
    /// # Errors
    /// The first of them.
    pub fn refuse_strange_keys(&self, of_others: bool) -> Result<(), Error> {
        let is_elsewhere = |name: &Name| {
            let swept = Swept::read(&name.text);
            swept.is_some_and(|swept| FAMILIES.iter().any(|family| swept.is_of(*family)))
        };
        let mut keys = self.tune.keys.iter().map(|(name, _)| name);
        keys.try_for_each(|name| match is_elsewhere(name) && !of_others {
            true => Ok(()),
            false => self.swept_key(name).map(drop),
        })
    }

    /// What a name means that is swept.
    ///
    /// # Errors
    /// It is no key, or no family that the study allows has it.
    pub fn swept_key(&self, name: &Name) -> Result<Swept, Error> {
        let swept = Swept::read(&name.text).ok_or_else(|| {
            let why =
                format!("expected a key or an entry of one such as \"theta[1]\", found \"{name}\"");
            self.refuse_swept(name, &why)
        })?;
        let known = known(self, name, &swept);
        known.map_err(|(why, hint)| self.refuse_swept(name, &why).hint(hint))?;
        Ok(swept)
    }

    /// Why a key is not swept.
    pub fn refuse_swept(&self, name: &Name, why: &str) -> Error {
        let refusal = Error::input(format!("`keys` of [tune]: {why}")).at(&self.file);
        name.blame(refusal)
    }
}

/// What is swept belongs to a family that the study allows, or why not and what to do.
fn known(study: &Study, name: &Name, swept: &Swept) -> Result<(), (String, String)> {
    if study.observer.families().any(|family| swept.is_of(family)) {
        return Ok(());
    }
    let base = match swept {
        Swept::Tuning(base, _) => base,
        Swept::Density(_) | Swept::Noise(_) => {
            let family = study.observer.family.as_ref().map_or("auto", |f| &f.text);
            let why = format!(
                "\"{name}\" is swept for filters, which weigh readings by it, and the study's family is \"{family}\""
            );
            let filters = FAMILIES.iter().filter(|family| family.is_filter());
            let filters: Vec<&str> = filters.map(|family| family.name()).collect();
            let hint = format!(
                "sweep a key of [observer], or take one of {} as its `family`",
                filters.join(", ")
            );
            return Err((why, hint));
        }
    };
    let allowed: BTreeSet<&str> = study
        .observer
        .families()
        .flat_map(|family| family.keys())
        .map(|key| key.name)
        .collect();
    let elsewhere = FAMILIES.iter().any(|family| family.owns(base));
    let why = match elsewhere {
        true => format!("\"{base}\" belongs to another family than the study's"),
        false => format!("no family has a key \"{base}\""),
    };
    Err((why, suggest(base, allowed)))
}
