//! The keys that are swept and the values that they take.

use lynkeus_expr::real::rounded;
use lynkeus_observers::Value;

use crate::{Error, Study};
use lynkeus_study::{Name, Place, Scale, Values};
use lynkeus_table::significant;

/// The keys that speed belongs to; the first that a study sets is swept where it does not say which.
const SPEED: &[&str] = &["theta", "poles", "alpha"];

/// A default range reaches from the study's value divided by this to its multiple.
const REACH: f64 = 4.0;

/// Most combinations of values.
const MOST_VALUES: usize = 100_000;

/// Digits of a value that a range makes.
const DIGITS: usize = 4;

/// One key of `[observer]` and the values that it takes.
#[derive(Clone, Debug, PartialEq)]
pub struct Axis {
    /// The key as the study writes it: `theta`, `theta[1]`.
    pub key: String,
    /// The key is a list and the values are factors on all of its numbers.
    pub is_factor: bool,
    /// The values, in the order of the study.
    pub values: Vec<f64>,
    /// The value that the study has now (1 for a factor), if it has the key.
    pub present: Option<f64>,
    /// The value that is proposed, where the study does not have the key.
    pub proposed: Option<f64>,
    /// The key without indices.
    base: String,
    /// Its indices, from 0.
    path: Vec<usize>,
    /// Where the study says which values it takes.
    place: Option<Place>,
}

impl Axis {
    /// Of what is no key of `[observer]`: factors on what the study says, so many to either side of 1, the last
    /// of them `reach` and its inverse.
    pub(crate) fn of_factors(name: &str, reach: f64, to_a_side: usize) -> Self {
        let range = Values::Spread {
            from: Some(1.0 / reach),
            to: Some(reach),
            points: 2 * to_a_side + 1,
            scale: Scale::Log,
        };
        Self {
            key: name.to_owned(),
            is_factor: true,
            values: spread(&range, None).unwrap_or_default(),
            present: Some(1.0),
            proposed: None,
            base: name.to_owned(),
            path: vec![],
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

    /// The key without indices, and its indices from 0.
    pub(crate) fn path(&self) -> (&str, &[usize]) {
        (&self.base, &self.path)
    }

    /// A study with `value` at the key.
    fn set(&self, study: &mut Study, value: f64) {
        let values = &mut study.observer.tuning.values;
        let mut slot = values
            .entry(self.base.clone())
            .or_insert(Value::Number(value));
        for &index in &self.path {
            let Value::List(entries) = slot else { return };
            let Some(entry) = entries.get_mut(index) else {
                return;
            };
            slot = entry;
        }
        self.scale(slot, value);
        if let Some(place) = &self.place {
            study.observer.comes_from(&self.base, place);
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
pub(crate) fn around(study: &Study, to_a_side: usize) -> Option<Axis> {
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

/// The keys of `[observer]` that a study sweeps, without indices; none where there is nothing to sweep.
pub(super) fn swept(study: &Study) -> Vec<String> {
    let given = study.tune.keys.iter().map(|(name, _)| name.text.as_str());
    let bases = given.filter_map(|key| Some(lynkeus_study::swept(key)?.0.to_owned()));
    let bases: Vec<String> = bases.collect();
    match bases.is_empty() {
        true => speed(study).into_iter().map(str::to_owned).collect(),
        false => bases,
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
pub(crate) fn grid(study: &Study, axes: &[Axis]) -> Result<Vec<(Vec<f64>, Study)>, Error> {
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

fn axis(study: &Study, name: &Name, values: &Values) -> Result<Axis, Error> {
    let refuse = |why: String| study.refuse_swept(name, &why);
    let (base, path) = study.swept_key(name)?;
    let present = present(study, base, &path).map_err(&refuse)?;
    let is_factor = matches!(present, Some(Value::List(_)));
    let present = match present {
        Some(Value::Number(x)) => Some(*x),
        Some(_) => Some(1.0),
        None => None,
    };
    let values = spread(values, present).ok_or_else(|| {
        refuse(format!("\"{name}\" needs the ends of its range")).hint(format!(
            "write {name} = {{ from = …, to = … }}; without them a range reaches from a quarter of the study's value, which must not be 0, to four times of it"
        ))
    })?;
    Ok(Axis {
        key: name.text.clone(),
        is_factor,
        values,
        present,
        proposed: None,
        base: base.to_owned(),
        path,
        place: name.place.clone(),
    })
}

/// What stands at the key: a number, or a list in which all entries are numbers in the end.
fn present<'s>(study: &'s Study, base: &str, path: &[usize]) -> Result<Option<&'s Value>, String> {
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
pub(crate) fn shown(x: f64) -> String {
    significant(x)
}

#[cfg(test)]
mod tests;
