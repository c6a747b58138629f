//! The keys that are swept and the values that they take.

use lynkeus_expr::real::rounded;
use lynkeus_observers::Value;

use crate::{Error, Study};
use lynkeus_study::{Name, Noise, Place, Scale, Swept, Values};
use lynkeus_table::significant;

/// The keys that speed belongs to; the first that a study sets is swept where it does not say which.
const SPEED: &[&str] = &["theta", "poles", "alpha"];

/// A default range reaches from the study's value divided by this to its multiple.
const REACH: f64 = 4.0;

/// Factors on all densities of a filter reach from the inverse of this to it where the study does not say.
const NOISE_REACH: f64 = 100.0;

/// How many of them to either side of 1.
const TO_A_SIDE: usize = 10;

/// Most combinations of values.
const MOST_VALUES: usize = 100_000;

/// Digits of a value that a range makes.
const DIGITS: usize = 4;

/// One key and the values that it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The key as the study writes it: `theta`, `theta[1]`, `process_noise.x`.
    pub key: String,
    /// The values are factors on all numbers of a list or a table.
    pub is_factor: bool,
    /// The values, in the order of the study.
    pub values: Vec<f64>,
    /// The value that the study has now (1 for a factor), if it has the key.
    pub present: Option<f64>,
    /// The value that is proposed, where the study does not have the key.
    pub proposed: Option<f64>,
    /// What it is of a study.
    swept: Swept,
    /// Where the study says which values it takes.
    place: Option<Place>,
}

impl Axis {
    /// Of all densities: so many factors to either side of 1.
    pub fn of_densities(to_a_side: usize) -> Self {
        let range = Values::Spread {
            from: Some(1.0 / NOISE_REACH),
            to: Some(NOISE_REACH),
            points: 2 * to_a_side + 1,
            scale: Scale::Log,
        };
        Self {
            key: "process_noise".to_owned(),
            is_factor: true,
            values: spread(&range, None).unwrap_or_default(),
            present: Some(1.0),
            proposed: None,
            swept: Swept::Density(None),
            place: None,
        }
    }

    /// The key with what its values mean: `theta`, `theta ×`.
    pub fn label(&self) -> String {
        match self.is_factor {
            true => format!("{} \u{d7}", self.key),
            false => self.key.clone(),
        }
    }

    /// What stands at the key where `value` is chosen, from what stands there now.
    pub(crate) fn chosen(&self, present: f64, value: f64) -> f64 {
        match self.is_factor {
            true => rounded(present * value, 2 + DIGITS),
            false => value,
        }
    }

    /// What it is of a study.
    pub(crate) fn swept(&self) -> &Swept {
        &self.swept
    }

    /// A study with `value` at the key.
    fn set(&self, study: &mut Study, value: f64) {
        match &self.swept {
            Swept::Tuning(base, path) => self.set_tuning(study, base, path, value),
            Swept::Density(Some(name)) => self.put(&mut study.process_noise, name, value),
            Swept::Noise(Some(name)) => {
                self.put(&mut study.sensors.noise, name, Noise::Absolute(value));
            }
            Swept::Density(None) => {
                for (_, density) in &mut study.process_noise {
                    *density = self.chosen(*density, value);
                }
            }
            Swept::Noise(None) => {
                for (_, noise) in &mut study.sensors.noise {
                    let (Noise::Absolute(size) | Noise::Relative(size) | Noise::Uniform(size)) =
                        noise;
                    *size = self.chosen(*size, value);
                }
            }
        }
    }

    fn put<T>(&self, said: &mut Vec<(Name, T)>, name: &str, value: T) {
        match said.iter_mut().find(|(own, _)| own.text == name) {
            Some((_, present)) => *present = value,
            None => {
                let (text, place) = (name.to_owned(), self.place.clone());
                said.push((Name { text, place }, value));
            }
        }
    }

    fn set_tuning(&self, study: &mut Study, base: &str, path: &[usize], value: f64) {
        let values = &mut study.observer.tuning.values;
        let mut slot = values
            .entry(base.to_owned())
            .or_insert(Value::Number(value));
        for &index in path {
            let Value::List(entries) = slot else { return };
            let Some(entry) = entries.get_mut(index) else {
                return;
            };
            slot = entry;
        }
        self.scale(slot, value);
        if let Some(place) = &self.place {
            study.observer.comes_from(base, place);
        }
    }

    fn scale(&self, slot: &mut Value, value: f64) {
        each(slot, &|x| self.chosen(x, value));
    }
}

/// Exchanges every number of a value.
fn each(slot: &mut Value, by: &impl Fn(f64) -> f64) {
    match slot {
        Value::Number(x) => *x = by(*x),
        Value::List(entries) => entries.iter_mut().for_each(|e| each(e, by)),
        // a conjugate pair of poles
        Value::Table(parts) => parts.values_mut().for_each(|x| each(x, by)),
        _ => {}
    }
}

/// The key that the speed of a study belongs to, at so many values to either side of the study's own, from a
/// quarter of it to four times of it in equal ratios. None where it has no such key with numbers.
pub fn around(study: &Study, to_a_side: usize) -> Option<Axis> {
    let tuning = &study.observer.tuning.values;
    let mut keys = SPEED.iter().copied();
    let key = keys.find(|key| tuning.get(*key).is_some_and(numeric))?;
    let range = Values::Spread {
        from: None,
        to: None,
        points: 2 * to_a_side + 1,
        scale: Scale::Log,
    };
    let mut axis = axis(study, &Name::from(key), &range).ok()?;
    // to its last digit
    *axis.values.get_mut(to_a_side)? = axis.present?;
    Some(axis)
}

/// The keys that a study sweeps.
///
/// # Errors
/// A key that no family in question has, that is no number or list of numbers, or a range without ends.
pub(super) fn axes(study: &Study) -> Result<Vec<Axis>, Error> {
    let given = &study.tune.keys;
    if !given.is_empty() {
        return given
            .iter()
            .map(|(name, values)| axis(study, name, values))
            .collect();
    }
    if is_filters(study) {
        return match study.process_noise.is_empty() {
            false => Ok(vec![Axis::of_densities(TO_A_SIDE)]),
            true => Err(Error::input("nothing to sweep: the study has no [process_noise]")
                .at(&study.file)
                .hint("add [tune] with keys = { process_noise.NAME = { from = …, to = … } }, or noise.OUTPUT, or a key of [observer]")),
        };
    }
    match speed(study) {
        Some(key) => Ok(vec![axis(study, &Name::from(key), &Values::default())?]),
        None => Err(Error::input(format!(
            "nothing to sweep: [observer] sets none of {}",
            SPEED.join(", ")
        ))
        .at(&study.file)
        .hint("add [tune] with keys = { KEY = { from = …, to = … } }")),
    }
}

/// Whether the study names a filter.
pub(super) fn is_filters(study: &Study) -> bool {
    let named = study.observer.family.iter();
    let mut families = named.filter_map(|name| lynkeus_observers::find(&name.text));
    families.any(|family| family.is_filter())
}

/// What a study sweeps; nothing where there is nothing to sweep.
pub(super) fn swept(study: &Study) -> Vec<Swept> {
    let given = study.tune.keys.iter();
    let given: Vec<Swept> = given
        .filter_map(|(name, _)| Swept::read(&name.text))
        .collect();
    match given.is_empty() {
        true => speed(study).and_then(Swept::read).into_iter().collect(),
        false => given,
    }
}

/// The key that is swept where the study does not say which.
fn speed(study: &Study) -> Option<&'static str> {
    let tuning = &study.observer.tuning.values;
    let mut keys = SPEED.iter().copied();
    keys.find(|key| tuning.contains_key(*key))
}

/// Every combination of values, the last key's fastest, each with its study.
///
/// # Errors
/// Too many.
pub fn grid(study: &Study, axes: &[Axis]) -> Result<Vec<(Vec<f64>, Study)>, Error> {
    let mut counts = axes.iter().map(|a| a.values.len());
    let count = counts.clone().try_fold(1_usize, usize::checked_mul);
    if count.is_none_or(|count| count > MOST_VALUES) {
        let product = counts.try_fold(1_u128, |all, n| all.checked_mul(n as u128));
        let found = product.map_or("more than 10^38".to_owned(), |count| count.to_string());
        return Err(Error::input(format!(
            "`keys` of [tune]: expected at most {MOST_VALUES} combinations of values, found {found}"
        ))
        .at(&study.file)
        .hint("sweep fewer keys or values at a time"));
    }
    let mut grid = vec![(vec![], study.clone())];
    for axis in axes {
        let with = |(values, study): &(Vec<f64>, Study), value: f64| {
            let (mut values, mut study) = (values.clone(), study.clone());
            values.push(value);
            axis.set(&mut study, value);
            (values, study)
        };
        grid = grid
            .iter()
            .flat_map(|point| axis.values.iter().map(move |value| with(point, *value)))
            .collect();
    }
    Ok(grid)
}

/// A study with another value at a key of `[tune]`: of a number the value itself, of lists and tables a factor of all
/// their numbers.
///
/// # Errors
/// No family that the study allows has the key, or the study does not say it.
pub fn changed(study: &Study, key: &str, value: f64) -> Result<Study, Error> {
    let mut study = study.clone();
    let (text, place) = (key.to_owned(), None);
    study.tune.keys = vec![(Name { text, place }, Values::Listed(vec![value]))];
    let axes = axes(&study)?;
    let found = grid(&study, &axes)?.into_iter().next();
    let none = || Error::input(format!("no study has {value} at \"{key}\""));
    found.map(|(_, study)| study).ok_or_else(none)
}

/// The keys that are changed first: what a filter weighs readings by, or how fast an observer is.
#[must_use]
pub fn usual(study: &Study) -> Vec<&'static str> {
    match study.observer.families().all(|family| family.is_filter()) {
        true => vec!["process_noise", "noise"],
        false => speed(study).into_iter().collect(),
    }
}

fn axis(study: &Study, name: &Name, values: &Values) -> Result<Axis, Error> {
    let refuse = |why: String| study.refuse_swept(name, &why);
    let swept = study.swept_key(name)?;
    let (present, is_factor) = present(study, &swept).map_err(&refuse)?;
    let values = spread(values, present).ok_or_else(|| {
        refuse(format!("\"{name}\" needs the ends of its range")).hint(format!(
            "write {name} = {{ from = …, to = … }}; without them a range reaches from a quarter of the study's value, which must not be 0, to four times of it"
        ))
    })?;
    let is_noise = !matches!(swept, Swept::Tuning(..));
    if let Some(negative) = values.iter().find(|x| is_noise && **x < 0.0) {
        return Err(refuse(format!(
            "\"{name}\": expected numbers >= 0, found {negative}"
        )));
    }
    Ok(Axis {
        key: name.text.clone(),
        is_factor,
        values,
        present,
        proposed: None,
        swept,
        place: name.place.clone(),
    })
}

/// The number at a key, none where the study does not have it; 1 and that the values are factors where it is a
/// list or a table in which all entries are numbers in the end.
fn present(study: &Study, swept: &Swept) -> Result<(Option<f64>, bool), String> {
    let factors = |is_there: bool, place: &str| match is_there {
        true => Ok((Some(1.0), true)),
        false => Err(format!("the study has no {place} for factors")),
    };
    match swept {
        Swept::Tuning(base, path) => match tuning(study, base, path)? {
            None => Ok((None, false)),
            Some(Value::Number(x)) => Ok((Some(*x), false)),
            Some(_) => Ok((Some(1.0), true)),
        },
        Swept::Density(Some(name)) => Ok((Name::best(&study.process_noise, name).copied(), false)),
        Swept::Density(None) => factors(!study.process_noise.is_empty(), "[process_noise]"),
        Swept::Noise(Some(name)) => match Name::best(&study.sensors.noise, name) {
            None => Ok((None, false)),
            Some(Noise::Absolute(x)) => Ok((Some(*x), false)),
            Some(_) => Err(format!(
                "the noise of {name} is no standard deviation; sweep `noise`, whose values are factors on all of them"
            )),
        },
        Swept::Noise(None) => factors(!study.sensors.noise.is_empty(), "`noise` of [sensors]"),
    }
}

/// What stands at a key of `[observer]`.
fn tuning<'s>(study: &'s Study, base: &str, path: &[usize]) -> Result<Option<&'s Value>, String> {
    let Some(mut value) = study.observer.tuning.values.get(base) else {
        return match path {
            [] => Ok(None),
            _ => Err(format!("[observer] has no `{base}` to take an entry of")),
        };
    };
    for index in path {
        let entry = match value {
            Value::List(entries) => entries.get(*index),
            _ => None,
        };
        value =
            entry.ok_or_else(|| format!("`{base}` has no entry {}: it is {value}", index + 1))?;
    }
    match numeric(value) {
        true => Ok(Some(value)),
        false => Err(format!(
            "`{base}` must be a number or a list of numbers to be swept, found {value}"
        )),
    }
}

fn numeric(value: &Value) -> bool {
    match value {
        Value::Number(_) => true,
        Value::List(entries) => {
            let scaled = |e: &Value| match e {
                // a conjugate pair of poles
                Value::Table(parts) => parts.values().all(numeric),
                _ => numeric(e),
            };
            !entries.is_empty() && entries.iter().all(scaled)
        }
        _ => false,
    }
}

/// The values of a range; none where an end is missing and does not follow from `present`.
fn spread(values: &Values, present: Option<f64>) -> Option<Vec<f64>> {
    let (from, to, points, scale) = match values {
        Values::Listed(values) => return Some(values.clone()),
        Values::Spread {
            from,
            to,
            points,
            scale,
        } => (*from, *to, *points, *scale),
    };
    // poles are negative
    let ends = present
        .filter(|x| *x != 0.0)
        .map(|x| (x / REACH, x * REACH));
    let from = from.or(ends.map(|(near, far)| near.min(far)))?;
    let to = to.or(ends.map(|(near, far)| near.max(far)))?;
    let ordered = from < to && (scale == Scale::Linear || from * to > 0.0);
    if !ordered || points < 2 {
        return None;
    }
    let place = |i: usize| i as f64 / (points - 1) as f64;
    let value = |share: f64| match scale {
        Scale::Linear => from + share * (to - from),
        Scale::Log => from * (to / from).powf(share),
    };
    let mut all: Vec<f64> = (0..points)
        .map(|i| rounded(value(place(i)), DIGITS))
        .collect();
    all.dedup();
    Some(all)
}

/// A value as tables and messages show it.
pub fn shown(x: f64) -> String {
    significant(x)
}

#[cfg(test)]
mod tests;
