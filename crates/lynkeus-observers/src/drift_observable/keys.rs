//! The family's keys: variant, indices, poles, and the filter of each input.

use std::collections::BTreeMap;

use lynkeus_expr::Node;
use lynkeus_gain::vandermonde::{self, Lemma32};
use lynkeus_structure::Extended;

use super::conditions::Form;
use crate::{Tuning, TuningError, Value};

/// Default ratio of the filter's poles to the slowest pole of the observer, and of
/// each pole to the one before: those of the paper's example.
const FILTER_SPEED: f64 = 10.0;
const FILTER_RATIO: f64 = 1.2;

/// The key of [`slopes`].
pub(super) const SLOPES: &str = "input_derivatives";

/// `input_derivatives`: per input bounds of |u'|, |u''|, …, one more than the observer
/// reads; for guarantees only. None where they are left out.
pub(super) fn slopes(
    extended: &Extended<'_>,
    tuning: &Tuning,
    form: &Form,
) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
    let names: Vec<&str> = extended.inputs.iter().map(|i| i.name.as_str()).collect();
    let orders: Vec<usize> = match form.variant {
        Variant::Bounded => vec![0; names.len()],
        _ => form.U.iter().map(Vec::len).collect(),
    };
    let found = per_input(tuning, SLOPES, &names, &orders)?;
    match found.iter().flatten().flatten().find(|x| **x < 0.0) {
        Some(x) => Err(TuningError::new(SLOPES, "bounds, no negative numbers", x)),
        None => Ok(found),
    }
}

/// Which of the three observers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Variant {
    /// (3.1)
    Bounded,
    /// (4.1)
    Theoretical,
    /// (4.22)
    Practical,
}

impl Variant {
    const ALL: [Self; 3] = [Self::Bounded, Self::Theoretical, Self::Practical];

    pub fn word(self) -> &'static str {
        match self {
            Self::Bounded => "bounded",
            Self::Theoretical => "theoretical",
            Self::Practical => "practical",
        }
    }

    /// The least demanding one that takes account of the inputs: with r = n the
    /// three coincide, with r = n − 1 no derivative is needed (Remark 4.2).
    pub fn suited(U: &[Vec<Node>]) -> Self {
        match U.iter().map(Vec::len).max().unwrap_or(0) {
            0 => Self::Bounded,
            1 => Self::Theoretical,
            _ => Self::Practical,
        }
    }
}

pub(super) fn variant(tuning: &Tuning) -> Result<Option<Variant>, TuningError> {
    let words = Variant::ALL.map(Variant::word);
    let word = tuning.choice("variant", &words)?;
    Ok(word.and_then(|word| Variant::ALL.into_iter().find(|v| v.word() == word)))
}

/// `indices`: one whole number per measured output, n in sum.
pub(super) fn indices(
    extended: &Extended<'_>,
    tuning: &Tuning,
) -> Result<Option<Vec<usize>>, TuningError> {
    let Some(found) = tuning.numbers("indices")? else {
        return Ok(None);
    };
    let (p, n) = (extended.outputs.len(), extended.states.len());
    let whole = |x: &f64| *x >= 0.0 && x.fract() == 0.0 && *x <= n as f64;
    if found.len() != p || !found.iter().all(whole) || found.iter().sum::<f64>() != n as f64 {
        let expected = format!(
            "one whole number per measured output ({p}), the number of states ({n}) in sum"
        );
        return Err(TuningError::new("indices", expected, list(&found)));
    }
    Ok(Some(found.iter().map(|&x| x as usize).collect()))
}

/// The numbers of the gain.
#[derive(Debug)]
pub(super) struct Gains {
    /// eigenvalues and K per output, empty where the output is not used
    pub λ: Vec<Vec<f64>>,
    pub K: Vec<Vec<f64>>,
    /// per input: eigenvalues, K₂ and x̂_a(0); empty where no filter is needed
    pub filter_λ: Vec<Vec<f64>>,
    pub K2: Vec<Vec<f64>>,
    pub filter_start: Vec<Vec<f64>>,
    /// what Lemma 3.2 gave, per output that it was used for
    pub lemma: Vec<Lemma32>,
}

impl Gains {
    pub fn new(extended: &Extended<'_>, tuning: &Tuning, form: &Form) -> Result<Self, TuningError> {
        let μ = &form.indices;
        let (λ, lemma) = match pole_lists(tuning, μ)? {
            Some(λ) => (λ, vec![]),
            None => lemma_lists(tuning, μ)?,
        };
        let filters: Vec<usize> = match form.variant {
            Variant::Practical => form.U.iter().map(Vec::len).collect(),
            _ => vec![0; form.U.len()],
        };
        let names: Vec<&str> = extended.inputs.iter().map(|i| i.name.as_str()).collect();
        let slowest = λ.iter().flatten().fold(f64::INFINITY, |m, λ| m.min(-λ));
        let default = |order: usize| -> Vec<f64> {
            let pole = |k: usize| -FILTER_SPEED * slowest * FILTER_RATIO.powi(k as i32);
            (0..order).map(pole).collect()
        };
        let given = per_input(tuning, "filter_poles", &names, &filters)?;
        for pole in given.iter().flatten().flatten() {
            negative("filter_poles", *pole)?;
        }
        let filter_λ = with_defaults(given, |j| default(filters[j]));
        let given = per_input(tuning, "filter_initial", &names, &filters)?;
        let filter_start = with_defaults(given, |j| {
            let mut start = vec![0.0; filters[j]];
            if let Some(u) = start.first_mut() {
                *u = extended.inputs[j].start.unwrap_or(0.0);
            }
            start
        });
        let place = |λ: &Vec<f64>| vandermonde::place(λ);
        Ok(Self {
            K: λ.iter().map(place).collect(),
            K2: filter_λ.iter().map(place).collect(),
            λ,
            filter_λ,
            filter_start,
            lemma,
        })
    }
}

fn negative(key: &str, pole: f64) -> Result<(), TuningError> {
    match pole < 0.0 && pole.is_finite() {
        true => Ok(()),
        false => Err(TuningError::new(key, "negative numbers", pole)),
    }
}

/// `poles`: μ numbers, or such a list per measured output.
fn pole_lists(tuning: &Tuning, μ: &[usize]) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    let Some(value) = tuning.values.get("poles") else {
        return Ok(None);
    };
    let lengths: Vec<String> = μ.iter().map(usize::to_string).collect();
    let expected = match μ {
        [n] => format!("{n} negative numbers, one per state"),
        _ => format!(
            "a list of negative numbers per measured output, of lengths {}",
            lengths.join(", ")
        ),
    };
    let wrong = || TuningError::new("poles", expected.clone(), value);
    let Value::List(entries) = value else {
        return Err(wrong());
    };
    let numbers = |entries: &[Value]| -> Result<Vec<f64>, TuningError> {
        let number = |entry: &Value| match entry {
            Value::Number(x) => Ok(*x),
            _ => Err(wrong()),
        };
        entries.iter().map(number).collect()
    };
    let nested = entries.iter().any(|e| matches!(e, Value::List(_)));
    let lists: Vec<Vec<f64>> = match nested {
        false if μ.len() == 1 => vec![numbers(entries)?],
        _ => {
            let list = |entry: &Value| match entry {
                Value::List(entries) => numbers(entries),
                _ => Err(wrong()),
            };
            entries.iter().map(list).collect::<Result<_, _>>()?
        }
    };
    if lists.iter().map(Vec::len).ne(μ.iter().copied()) {
        return Err(wrong());
    }
    for pole in lists.iter().flatten() {
        negative("poles", *pole)?;
    }
    Ok(Some(lists))
}

/// Lemma 3.2 with `alpha`, `beta`, `gamma`, for every output that is used.
fn lemma_lists(
    tuning: &Tuning, μ: &[usize]
) -> Result<(Vec<Vec<f64>>, Vec<Lemma32>), TuningError> {
    let one = |key: &str| match tuning.positive_per_chain(key, 1)? {
        Some(x) => Ok(x.first().copied()),
        None => Ok(None),
    };
    let Some(α) = one("alpha")? else {
        let expected = "the eigenvalues of the error, negative numbers, or alpha, beta and gamma for Lemma 3.2 to choose them";
        return Err(TuningError::new("poles", expected, "nothing"));
    };
    let missing = || {
        TuningError::new(
            "gamma",
            "the Lipschitz constant for Lemma 3.2, a positive number",
            "nothing",
        )
    };
    let γ = one("gamma")?.ok_or_else(missing)?;
    // (4.7) has β = 1
    let β = one("beta")?.unwrap_or(1.0);
    let (mut λ, mut lemma) = (vec![], vec![]);
    for &μ in μ {
        if μ == 0 {
            λ.push(vec![]);
            continue;
        }
        let found = vandermonde::lemma_3_2(μ, α, β, γ).map_err(|error| {
            TuningError::new("alpha", "numbers Lemma 3.2 can be used with", error)
        })?;
        λ.push(found.poles.clone());
        lemma.push(found);
    }
    Ok((λ, lemma))
}

fn with_defaults(
    given: Vec<Option<Vec<f64>>>,
    default: impl Fn(usize) -> Vec<f64>,
) -> Vec<Vec<f64>> {
    let entries = given.into_iter().enumerate();
    entries
        .map(|(j, given)| given.unwrap_or_else(|| default(j)))
        .collect()
}

/// A list of numbers for the only input with a filter, or a table of lists by the
/// input's name; `orders` says how many numbers each takes.
fn per_input(
    tuning: &Tuning,
    key: &str,
    names: &[&str],
    orders: &[usize],
) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
    let mut lists: Vec<Option<Vec<f64>>> = vec![None; names.len()];
    let Some(value) = tuning.values.get(key) else {
        return Ok(lists);
    };
    let needed: Vec<usize> = (0..names.len()).filter(|&j| orders[j] > 0).collect();
    let what = match key {
        SLOPES => "bounds of the derivatives of",
        _ => "numbers for the filter of",
    };
    let expected = match needed[..] {
        [] => "no such key: this observer has no filter and reads no derivative".to_owned(),
        [j] => format!("{} {what} {}", orders[j], names[j]),
        _ => {
            let one = |&j: &usize| format!("{} = {} numbers", names[j], orders[j]);
            let all: Vec<String> = needed.iter().map(one).collect();
            format!("a table {{ {} }}", all.join(", "))
        }
    };
    let wrong = || TuningError::new(key, expected.clone(), value);
    let table = match (value, &needed[..]) {
        (Value::Table(table), _) => table.clone(),
        (list, &[j]) => BTreeMap::from([(names[j].to_owned(), list.clone())]),
        _ => return Err(wrong()),
    };
    for (name, list) in &table {
        let found = needed.iter().copied().find(|&j| names[j] == name.as_str());
        let j = found.ok_or_else(wrong)?;
        let numbers = numbers(list).ok_or_else(wrong)?;
        if numbers.len() != orders[j] {
            return Err(wrong());
        }
        lists[j] = Some(numbers);
    }
    Ok(lists)
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

pub(super) fn list(values: &[f64]) -> String {
    let values: Vec<String> = values.iter().map(f64::to_string).collect();
    values.join(", ")
}
