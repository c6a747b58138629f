//! `[observer]`: the family and its tuning.
//!
//! The keys `family`, `initial` and `clamp` belong to every family; all others are
//! handed on as they stand to the family that owns them.

use std::collections::BTreeMap;

use lynkeus_observers::{
    DesignError, FAMILIES, Family, Initial, KeySpec, Tuning, TuningError, Value,
};
use lynkeus_words::Words;

use super::keys::OBSERVER;
use super::section::{Entry, Section};
use super::{ManifoldSettings, Name, Place};
use lynkeus_answer::Error;

/// The observer's family and tuning.
#[derive(Clone, Debug, Default)]
pub struct ObserverSettings {
    /// The family by name; `None` lets the tool choose the first that fits.
    pub family: Option<Name>,
    /// Its tuning.
    pub tuning: Tuning,
    /// Whether a state or an output is an angle or a rotation: no family with a theorem takes it then.
    pub is_curved: bool,
    /// Lists that stand for the elements of arrays, with their lengths.
    pub lists: Vec<(Name, usize)>,
    /// Where the keys stand, for messages.
    places: BTreeMap<String, Place>,
}

impl ObserverSettings {
    /// The families that may be used: the one asked for, or all that own the keys given, and the
    /// filters, which stand in where none of those will do; those that draw random numbers where they are asked for.
    pub fn families(&self) -> impl Iterator<Item = &'static dyn Family> + '_ {
        FAMILIES
            .iter()
            .copied()
            .filter(|family| match &self.family {
                Some(name) => family.name() == name.text,
                None => !family.is_sampled() && (family.is_filter() || self.owns_all(*family)),
            })
            .filter(|family| family.is_filter() || !self.is_curved)
    }

    /// Of a plant with such states and outputs.
    ///
    /// # Errors
    /// A family with a theorem is asked for.
    pub(super) fn live_on(&mut self, manifold: &ManifoldSettings) -> Result<(), Error> {
        self.is_curved = !manifold.is_empty();
        let Some(name) = self.family.as_ref().filter(|_| self.is_curved) else {
            return Ok(());
        };
        match self.families().next() {
            Some(_) => Ok(()),
            None => {
                let refusal = Error::input(format!(
                    "{name} takes no [manifold]: its theorem is about errors that are differences of real numbers, and those of angles and rotations are none"
                ));
                let hint = "take \"ekf\" or \"ukf\"; an angle that the log unwraps is a real number, without [manifold]";
                Err(name.blame(refusal.hint(hint)))
            }
        }
    }

    /// Whether a filter is among them.
    pub fn may_be_a_filter(&self) -> bool {
        self.families().any(Family::is_filter)
    }

    /// Whether a family takes all of the keys given.
    fn owns_all(&self, family: &dyn Family) -> bool {
        self.tuning.values.keys().all(|key| family.owns(key))
    }

    /// Whether it asks for the same observer.
    pub fn is_like(&self, other: &Self) -> bool {
        self.family == other.family && self.tuning == other.tuning
    }

    /// Messages about `key` are to blame another place, where its value comes from.
    pub fn comes_from(&mut self, key: &str, place: &Place) {
        self.places.insert(key.to_owned(), place.clone());
    }

    /// The answer no to what a key asks for, with the key's place.
    pub fn place(&self, key: &str, file: &str, error: &DesignError) -> Error {
        let refusal = Error::refused(format!("`{key}` of [observer]: {}", error.words()));
        match self.places.get(key) {
            Some(place) => refusal.at(place),
            None => refusal.at(file),
        }
    }

    /// A family's refusal of a key, with the key's place.
    pub fn blame(&self, error: &TuningError, file: &str) -> Error {
        let message = format!(
            "`{}` of [observer]: expected {}, found {}",
            error.key, error.expected, error.found
        );
        match self.places.get(&error.key) {
            Some(place) => Error::input(message).at(place),
            None => Error::input(message).at(file),
        }
    }
}

pub(super) fn read(entry: Entry<'_>) -> Result<ObserverSettings, Error> {
    let owned: Vec<KeySpec> = FAMILIES.iter().flat_map(|f| f.keys()).copied().collect();
    let known: Vec<KeySpec> = OBSERVER.iter().chain(&owned).copied().collect();
    let mut section = entry.section("[observer]", &known)?;
    let family = section.optional("family", family)?.flatten();
    let mut lists = vec![];
    let initial = |entry| initial(entry, &mut lists);
    let mut settings = ObserverSettings {
        tuning: Tuning {
            initial: section.optional("initial", initial)?.unwrap_or_default(),
            clamp: section
                .optional("clamp", Entry::boolean)?
                .unwrap_or_default(),
            ..Tuning::default()
        },
        is_curved: false,
        lists,
        places: BTreeMap::new(),
        family,
    };
    for key in owned.iter().map(|spec| spec.name) {
        let Some(entry) = section.take(key) else {
            continue;
        };
        if let Some(family) = settings.families().next()
            && settings.family.is_some()
            && !family.owns(key)
        {
            return Err(foreign(&entry, key, family));
        }
        settings.places.insert(key.to_owned(), entry.place());
        let value = match key {
            "initial_variance" if entry.is_table() => variances(entry, &mut settings.lists)?,
            _ => entry.value()?,
        };
        settings.tuning.values.insert(key.to_owned(), value);
    }
    refuse_mixture(&section, &settings)?;
    Ok(settings)
}

/// A key of another family than the one asked for.
fn foreign(entry: &Entry<'_>, key: &str, asked: &dyn Family) -> Error {
    let owners: Vec<&str> = FAMILIES
        .iter()
        .filter(|family| family.owns(key))
        .map(|family| family.name())
        .collect();
    let (name, owners) = (asked.name(), owners.join(", "));
    let taken: Vec<&str> = asked.keys().iter().map(|key| key.name).collect();
    entry
        .refuse_key(&format!("belongs to the family {owners}, not to {name}"))
        .hint(format!("{name} takes {}", taken.join(", ")))
}

/// With `auto`, keys that no single family owns together.
fn refuse_mixture(section: &Section<'_>, settings: &ObserverSettings) -> Result<(), Error> {
    let mut families = FAMILIES.iter();
    if settings.family.is_some() || families.any(|family| settings.owns_all(*family)) {
        return Ok(());
    }
    let keys: Vec<&str> = settings.tuning.values.keys().map(String::as_str).collect();
    Err(section
        .refuse(&format!(
            "no family takes all of the keys {}",
            keys.join(", ")
        ))
        .hint("name the family with `family`, or remove the keys of the others"))
}

fn family(entry: Entry<'_>) -> Result<Option<Name>, Error> {
    let names: Vec<&str> = FAMILIES.iter().map(|family| family.name()).collect();
    let refusal = entry.wrong(&format!("\"auto\" or one of {}", names.join(", ")));
    let name = entry.name()?;
    match name.text.as_str() {
        "auto" => Ok(None),
        text if names.contains(&text) => Ok(Some(name)),
        _ => Err(refusal),
    }
}

fn initial(entry: Entry<'_>, lists: &mut Vec<(Name, usize)>) -> Result<Initial, Error> {
    let mut start = Initial::default();
    for (name, value) in entry.elements(lists)? {
        let value = value.number()?;
        if name.text == "default" {
            start.default = Some(value);
        } else {
            start.values.insert(name.text, value);
        }
    }
    Ok(start)
}

fn variances(entry: Entry<'_>, lists: &mut Vec<(Name, usize)>) -> Result<Value, Error> {
    let all = entry.elements(lists)?.into_iter();
    let all = all.map(|(name, entry)| Ok((name.text, entry.value()?)));
    Ok(Value::Table(all.collect::<Result<_, Error>>()?))
}

impl Entry<'_> {
    /// The value as the families read it; every number finite.
    fn value(self) -> Result<Value, Error> {
        if self.is_list() {
            return Ok(Value::List(self.list_of(Entry::value)?));
        }
        if self.is_table() {
            let pairs = self.pairs()?.into_iter();
            let values = pairs.map(|(name, entry)| Ok((name.text, entry.value()?)));
            return Ok(Value::Table(values.collect::<Result<_, Error>>()?));
        }
        if let Some(text) = self.as_text() {
            return Ok(Value::Text(text.to_owned()));
        }
        match self.as_boolean() {
            Some(flag) => Ok(Value::Flag(flag)),
            None => Ok(Value::Number(self.number()?)),
        }
    }
}
