//! The family's keys as the study gives them: indices, poles, filters, bounds of slopes.

use lynkeus_gain::vandermonde::{self, Lemma32, Pole};
use lynkeus_structure::Extended;

use super::poles::Poles;
use super::settings::{ALPHA, FILTER_POLES, GAMMA, INDICES, POLES, SLOPES, Settings};
use crate::{KeySpec, Tuning, TuningError, Value};

/// What is asked for of the known inputs: (name, how many numbers), in their order.
pub struct Needed<'a> {
    pub names: Vec<&'a str>,
    pub orders: Vec<usize>,
}

impl<'a> Needed<'a> {
    pub fn new(extended: &'a Extended<'_>, orders: Vec<usize>) -> Self {
        let names = extended.inputs.iter().map(|i| i.name.as_str()).collect();
        Self { names, orders }
    }
}

/// `input_derivatives`: per input bounds of |u'|, |u''|, …, one more than the observer
/// reads; for guarantees only. None where they are left out.
pub(super) fn slopes(
    value: Option<&Value>,
    needed: &Needed<'_>,
) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
    let found = numbers_per_input(value, SLOPES, "bounds of the derivatives of", needed)?;
    match found.iter().flatten().flatten().find(|x| **x < 0.0) {
        Some(x) => Err(TuningError::new(
            SLOPES.name,
            "bounds, no negative numbers",
            x,
        )),
        None => Ok(found),
    }
}

/// `filter_poles`: the eigenvalues of the filter per input.
pub(super) fn filter_poles(
    value: Option<&Value>,
    needed: &Needed<'_>,
) -> Result<Vec<Option<Vec<Pole>>>, TuningError> {
    let entries = PerInput::read(value, FILTER_POLES, "numbers for the filter of", needed)?;
    entries.map(|value, order| {
        let poles = Poles::read(FILTER_POLES.name, value)?;
        Ok(poles.and_then(|poles| poles.of_length(order)))
    })
}

/// How many derivatives of which output the study asks for.
#[derive(Clone)]
pub enum Asked {
    /// the key `indices`, or as many poles for every output
    Indices(Vec<usize>),
    /// per output, where its poles are listed
    Lengths(Vec<Option<usize>>),
}

/// `indices`: one whole number per measured output, n in sum; else the lengths of the lists
/// under `poles`.
pub(super) fn indices(
    extended: &Extended<'_>,
    tuning: &Tuning,
    poles: Option<&Value>,
) -> Result<Asked, TuningError> {
    let (p, n) = (extended.outputs.len(), extended.states.len());
    if let Some(found) = tuning.numbers(INDICES.name)? {
        let whole = |x: &f64| *x >= 0.0 && x.fract() == 0.0 && *x <= n as f64;
        if found.len() != p || !found.iter().all(whole) || found.iter().sum::<f64>() != n as f64 {
            let expected = format!(
                "one whole number per measured output ({p}), the number of states ({n}) in sum"
            );
            let found: Vec<String> = found.iter().map(f64::to_string).collect();
            return Err(TuningError::new(INDICES.name, expected, found.join(", ")));
        }
        return Ok(Asked::Indices(found.iter().map(|&x| x as usize).collect()));
    }
    // one output has n derivatives whatever the list says
    let Some(value) = poles.filter(|_| p > 1) else {
        return Ok(Asked::Lengths(vec![None; p]));
    };
    let given = per_output(value, p)?;
    let lengths: Vec<Option<usize>> = given.iter().map(Poles::count).collect();
    let all: Option<Vec<usize>> = lengths.iter().copied().collect();
    match all {
        Some(indices) if indices.iter().sum::<usize>() == n => Ok(Asked::Indices(indices)),
        Some(_) => {
            let expected = format!("as many poles as states ({n}) in all");
            Err(TuningError::new(POLES.name, expected, value))
        }
        None => Ok(Asked::Lengths(lengths)),
    }
}

/// `poles`: for one output its n poles; for several a list or the slowest pole of each. A single
/// number is the slowest pole of every output.
pub(super) fn poles(value: &Value, μ: &[usize]) -> Result<Vec<Vec<Pole>>, TuningError> {
    let given = per_output(value, μ.len())?;
    let pairs = given.iter().zip(μ);
    let lists: Option<Vec<Vec<Pole>>> = pairs.map(|(poles, &μ)| poles.of_length(μ)).collect();
    let lengths: Vec<String> = μ.iter().map(usize::to_string).collect();
    let expected = match μ {
        [n] => format!("{n} negative numbers, one per state"),
        _ => format!(
            "a list of negative numbers per measured output, of lengths {}, or the slowest pole of each",
            lengths.join(", ")
        ),
    };
    lists.ok_or_else(|| TuningError::new(POLES.name, expected, value))
}

/// The poles of each of p outputs.
fn per_output(value: &Value, p: usize) -> Result<Vec<Poles>, TuningError> {
    let wrong = || {
        let expected = match p {
            1 => "negative numbers, one per state".to_owned(),
            _ => format!(
                "a list of negative numbers, or the slowest pole, for each measured output ({p})"
            ),
        };
        TuningError::new(POLES.name, expected, value)
    };
    let of = |value: &Value| Poles::read(POLES.name, value)?.ok_or_else(wrong);
    match value {
        Value::Number(_) => Ok(vec![of(value)?; p]),
        Value::List(entries) => {
            let nested = entries.iter().any(|e| matches!(e, Value::List(_)));
            if p == 1 && !nested {
                return Ok(vec![of(value)?]);
            }
            if entries.len() != p {
                return Err(wrong());
            }
            entries.iter().map(of).collect()
        }
        _ => Err(wrong()),
    }
}

/// Lemma 3.2 with `alpha`, `beta`, `gamma`; none for an output that is not used.
pub(super) fn lemma(
    settings: &Settings, μ: &[usize]
) -> Result<Vec<Option<Lemma32>>, TuningError> {
    let Some(α) = settings.α else {
        let expected = "the eigenvalues of the error, negative numbers, or alpha, beta and gamma for Lemma 3.2 to choose them";
        return Err(TuningError::absent(POLES.name, expected));
    };
    let missing = || {
        TuningError::absent(
            GAMMA.name,
            "the Lipschitz constant for Lemma 3.2, a positive number",
        )
    };
    let γ = settings.γ.ok_or_else(missing)?;
    // (4.7) has β = 1
    let β = settings.β.unwrap_or(1.0);
    let of = |&μ: &usize| match μ {
        0 => Ok(None),
        _ => vandermonde::lemma_3_2(μ, α, β, γ)
            .map(Some)
            .map_err(|error| {
                TuningError::new(ALPHA.name, "numbers Lemma 3.2 can be used with", error)
            }),
    };
    μ.iter().map(of).collect()
}

/// Numbers for each input that takes some; none where they are left out.
pub(super) fn numbers_per_input(
    value: Option<&Value>,
    key: KeySpec,
    what: &str,
    needed: &Needed<'_>,
) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
    let entries = PerInput::read(value, key, what, needed)?;
    entries.map(|value, order| Ok(numbers(value).filter(|numbers| numbers.len() == order)))
}

/// A value for the only input that takes one, or a table of them by the inputs' names.
struct PerInput<'a> {
    key: &'static str,
    /// per input its value and how many numbers it takes
    entries: Vec<Option<(&'a Value, usize)>>,
    /// the key's value
    all: Option<&'a Value>,
    expected: String,
}

impl<'a> PerInput<'a> {
    fn read(
        all: Option<&'a Value>,
        key: KeySpec,
        what: &str,
        needed: &Needed<'_>,
    ) -> Result<Self, TuningError> {
        let Needed { names, orders } = needed;
        let some: Vec<usize> = (0..names.len()).filter(|&j| orders[j] > 0).collect();
        let expected = match some[..] {
            [] => "no such key: this observer has no filter and reads no derivative".to_owned(),
            [j] => format!("{} {what} {}", orders[j], names[j]),
            _ => {
                let one = |&j: &usize| format!("{} = {} numbers", names[j], orders[j]);
                let all: Vec<String> = some.iter().map(one).collect();
                format!("a table {{ {} }}", all.join(", "))
            }
        };
        let mut found = Self {
            key: key.name,
            entries: vec![None; names.len()],
            all,
            expected,
        };
        match (found.all, &some[..]) {
            (None, _) => {}
            (Some(Value::Table(table)), _) => {
                for (name, value) in table {
                    let j = some.iter().copied().find(|&j| names[j] == name.as_str());
                    let j = j.ok_or_else(|| found.wrong())?;
                    found.entries[j] = Some((value, orders[j]));
                }
            }
            (Some(value), &[j]) => found.entries[j] = Some((value, orders[j])),
            _ => return Err(found.wrong()),
        }
        Ok(found)
    }

    fn wrong(&self) -> TuningError {
        let found = self.all.map_or_else(String::new, Value::to_string);
        TuningError::new(self.key, self.expected.clone(), found)
    }

    fn map<T>(
        &self,
        read: impl Fn(&Value, usize) -> Result<Option<T>, TuningError>,
    ) -> Result<Vec<Option<T>>, TuningError> {
        let one = |entry: &Option<(&Value, usize)>| match entry {
            None => Ok(None),
            Some((value, order)) => read(value, *order)?.map(Some).ok_or_else(|| self.wrong()),
        };
        self.entries.iter().map(one).collect()
    }
}

fn numbers(value: &Value) -> Option<Vec<f64>> {
    let number = |value: &Value| match value {
        Value::Number(x) if x.is_finite() => Some(*x),
        _ => None,
    };
    match value {
        Value::List(values) => values.iter().map(number).collect(),
        one => Some(vec![number(one)?]),
    }
}
