//! The keys that `[tune]` sweeps: what of a study they mean.

use std::collections::BTreeSet;

use lynkeus_answer::Error;
use lynkeus_answer::near::suggest;
use lynkeus_observers::{FAMILIES, Family};

use crate::{Name, Study};

/// What a key of a sweep means.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Swept {
    /// a key of `[observer]`, and where within its value, counted from 0
    Tuning(String, Vec<usize>),
    /// the spectral density of an estimated quantity in `[process_noise]`; of none, all of them
    Density(Option<String>),
    /// the noise of an output in `[sensors]`; of none, that of all
    Noise(Option<String>),
}

impl Swept {
    /// `theta[1]` is the key `theta` and the index 0, `noise.y` the noise of the output y.
    #[must_use]
    pub fn read(key: &str) -> Option<Self> {
        let (section, name) = match key.split_once('.') {
            Some((section, name)) => (section, Some(name.to_owned())),
            None => (key, None),
        };
        match section {
            DENSITY => Some(Self::Density(name)),
            NOISE => Some(Self::Noise(name)),
            _ => {
                let (base, path) = place(key)?;
                Some(Self::Tuning(base.to_owned(), path))
            }
        }
    }

    /// Whether a family reads it: noises are what filters weigh readings by.
    #[must_use]
    pub fn is_of(&self, family: &dyn Family) -> bool {
        match self {
            Self::Tuning(base, _) => family.owns(base),
            Self::Density(_) | Self::Noise(_) => family.is_filter(),
        }
    }
}

/// What a key begins with that is a density, or all of them,
pub(crate) const DENSITY: &str = "process_noise";
/// and with that is the noise of an output.
pub(crate) const NOISE: &str = "noise";

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

/// `theta[1]` is the key `theta` and the index 0.
fn place(key: &str) -> Option<(&str, Vec<usize>)> {
    let Some((base, rest)) = key.split_once('[') else {
        return Some((key, vec![]));
    };
    let indices = rest.strip_suffix(']')?.split("][");
    let index = |text: &str| text.trim().parse::<usize>().ok()?.checked_sub(1);
    Some((base.trim(), indices.map(index).collect::<Option<_>>()?))
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
