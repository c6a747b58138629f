//! The keys that `[tune]` sweeps: which of `[observer]` they mean.

use std::collections::BTreeSet;

use lynkeus_answer::Error;
use lynkeus_answer::near::suggest;
use lynkeus_observers::FAMILIES;

use crate::{Name, Study};

impl Study {
    /// Refuses keys to sweep that no family has; with `of_others` those, too, that none in question has.
    ///
    /// # Errors
    /// The first of them.
    pub fn refuse_strange_keys(&self, of_others: bool) -> Result<(), Error> {
        let is_elsewhere = |name: &Name| {
            let base = swept(&name.text).map(|(base, _)| base);
            base.is_some_and(|base| FAMILIES.iter().any(|family| family.owns(base)))
        };
        let mut keys = self.tune.keys.iter().map(|(name, _)| name);
        keys.try_for_each(|name| match is_elsewhere(name) && !of_others {
            true => Ok(()),
            false => self.swept_key(name).map(drop),
        })
    }

    /// The key of `[observer]` that a name means, and where within its value.
    ///
    /// # Errors
    /// It is no key, or no family that the study allows has it.
    pub fn swept_key<'n>(&self, name: &'n Name) -> Result<(&'n str, Vec<usize>), Error> {
        let (base, path) = swept(&name.text).ok_or_else(|| {
            let why =
                format!("expected a key or an entry of one such as \"theta[1]\", found \"{name}\"");
            self.refuse_swept(name, &why)
        })?;
        let known = known(self, base);
        known.map_err(|(why, hint)| self.refuse_swept(name, &why).hint(hint))?;
        Ok((base, path))
    }

    /// Why a key is not swept.
    pub fn refuse_swept(&self, name: &Name, why: &str) -> Error {
        let refusal = Error::input(format!("`keys` of [tune]: {why}")).at(&self.file);
        name.blame(refusal)
    }
}

/// `theta[1]` is the key `theta` and the index 0.
pub fn swept(key: &str) -> Option<(&str, Vec<usize>)> {
    let Some((base, rest)) = key.split_once('[') else {
        return Some((key, vec![]));
    };
    let indices = rest.strip_suffix(']')?.split("][");
    let index = |text: &str| text.trim().parse::<usize>().ok()?.checked_sub(1);
    Some((base.trim(), indices.map(index).collect::<Option<_>>()?))
}

/// The key belongs to a family that the study allows, or why not and what to do.
fn known(study: &Study, base: &str) -> Result<(), (String, String)> {
    let allowed: BTreeSet<&str> = study
        .observer
        .families()
        .flat_map(|family| family.keys())
        .map(|key| key.name)
        .collect();
    if allowed.contains(base) {
        return Ok(());
    }
    let elsewhere = FAMILIES.iter().any(|family| family.owns(base));
    let why = match elsewhere {
        true => format!("\"{base}\" belongs to another family than the study's"),
        false => format!("no family has a key \"{base}\""),
    };
    Err((why, suggest(base, allowed)))
}
