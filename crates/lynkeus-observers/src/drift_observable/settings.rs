//! The study's keys: which of the three observers, indices, poles, filters, bounds of slopes.
//! What depends on the form is kept as it stands until the indices are known.

use lynkeus_expr::Node;
use lynkeus_gain::integrators::{self, Lemma32, Pole};
use lynkeus_structure::AugmentedPlant;

use crate::{KeySpec, Shape, Tuning, TuningError, Value};

/// Numbers, or a single one.
const SPEEDS: Shape = Shape::Either(&[Shape::Number, Shape::List(&Shape::Number)]);

/// The same for one input, or for several by their names.
const PER_INPUT: Shape = Shape::Either(&[SPEEDS, Shape::Table(&SPEEDS)]);

const BESIDE_ALPHA: &str = "poles by Lemma 3.2 instead, with `alpha`, see below";

/// Words of [`Variant`].
const VARIANTS: [&str; 3] = ["bounded", "theoretical", "practical"];

const VARIANT: KeySpec = KeySpec {
    name: "variant",
    shape: Shape::Word(&VARIANTS),
    default: "see above",
    meaning: "which observer",
};

pub(super) const POLES: KeySpec = KeySpec {
    name: "poles",
    shape: Shape::As(
        "n poles; for several outputs one list of μ_i each, or the slowest pole of each",
        &Shape::Either(&[SPEEDS, Shape::List(&SPEEDS), Shape::List(&Shape::ROWS)]),
    ),
    default: "required, or `alpha`",
    meaning: "the eigenvalues of A − KC, see below",
};

pub(super) const ALPHA: KeySpec = KeySpec {
    name: "alpha",
    shape: Shape::Positive,
    default: "required, or `poles`",
    meaning: "the decay α: poles by Lemma 3.2 instead, see below",
};

const BETA: KeySpec = KeySpec {
    name: "beta",
    shape: Shape::Positive,
    default: "1",
    meaning: BESIDE_ALPHA,
};

pub(super) const GAMMA: KeySpec = KeySpec {
    name: "gamma",
    shape: Shape::Positive,
    default: "required with `alpha`",
    meaning: BESIDE_ALPHA,
};

pub(super) const FILTER_POLES: KeySpec = KeySpec {
    name: "filter_poles",
    shape: Shape::As(
        "n − r poles or the slowest; for several inputs a table `{ u = […], v = […] }`",
        &Shape::Either(&[
            SPEEDS,
            Shape::ROWS,
            Shape::Table(&Shape::Either(&[SPEEDS, Shape::ROWS])),
        ]),
    ),
    default: "10 times the slowest pole, each 1.2 times the one before",
    meaning: "the eigenvalues of the input filter",
};

pub(super) const FILTER_INITIAL: KeySpec = KeySpec {
    name: "filter_initial",
    shape: Shape::As("as `filter_poles`", &PER_INPUT),
    default: "the input's start value, then zeros",
    meaning: "x̂ₐ(0)",
};

pub(super) const INDICES: KeySpec = KeySpec {
    name: "indices",
    shape: Shape::As(
        "a whole number per measured output",
        &Shape::Either(&[Shape::Whole(0), Shape::List(&Shape::Whole(0))]),
    ),
    default: "found",
    meaning: "how many derivatives of each output count",
};

pub(super) const SLOPES: KeySpec = KeySpec {
    name: "input_derivatives",
    shape: Shape::As("n − r numbers; for several inputs a table", &PER_INPUT),
    default: "those of `[certify]`",
    meaning: "bounds of &#124;u'&#124;, …, &#124;u^(n−r)&#124;, read by guarantees only",
};

/// Every key of the family.
pub(super) const KEYS: [KeySpec; 9] = [
    VARIANT,
    POLES,
    ALPHA,
    BETA,
    GAMMA,
    FILTER_POLES,
    FILTER_INITIAL,
    INDICES,
    SLOPES,
];

/// The keys, read as far as they do not depend on the form. Those that do are kept as they
/// stand until the indices and the orders of the filters are known.
pub struct Settings {
    pub common: Tuning,
    pub variant: Option<Variant>,
    /// how many derivatives of each output count, where the study says so: under `indices`, or by
    /// the lengths of the lists under `poles`
    pub indices: Vec<Option<usize>>,
    /// α, β and γ of Lemma 3.2
    lemma: [Option<f64>; 3],
    /// names of the known inputs
    inputs: Vec<String>,
}

impl Settings {
    pub fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        let positive = |key: KeySpec| tuning.positive(key.name);
        let names = augmented.inputs.iter().map(|input| input.name.clone());
        Ok(Self {
            common: tuning.checked()?,
            variant: tuning.meant(&VARIANT, Variant::ALL)?,
            indices: indices(augmented, tuning)?,
            lemma: [positive(ALPHA)?, positive(BETA)?, positive(GAMMA)?],
            inputs: names.collect(),
        })
    }

    /// Whether the study decides the poles.
    pub fn has_poles(&self) -> bool {
        self.common.values.contains_key(POLES.name) || self.lemma[0].is_some()
    }

    /// `poles`: for one output its n poles; for several a list or the slowest pole of each. A single
    /// number is the slowest pole of every output. None where they are not listed.
    pub fn poles(&self, μ: &[usize]) -> Result<Option<Vec<Vec<Pole>>>, TuningError> {
        let Some(value) = self.common.values.get(POLES.name) else {
            return Ok(None);
        };
        let given = per_output(value, μ.len())?;
        let pairs = given.iter().zip(μ);
        let lists: Option<Vec<Vec<Pole>>> = pairs.map(|(poles, &μ)| poles.of_length(μ)).collect();
        lists.map(Some).ok_or_else(|| {
            let lengths: Vec<String> = μ.iter().map(usize::to_string).collect();
            let expected = match μ {
                [n] => format!("{n} negative numbers, one per state"),
                _ => format!(
                    "a list of negative numbers per measured output, of lengths {}, or the slowest pole of each",
                    lengths.join(", ")
                ),
            };
            TuningError::new(POLES.name, expected, value)
        })
    }

    /// Lemma 3.2 with `alpha`, `beta`, `gamma`; none for an output that is not used.
    pub fn lemma(&self, μ: &[usize]) -> Result<Vec<Option<Lemma32>>, TuningError> {
        let absent = |key: KeySpec, expected| TuningError::absent(key.name, expected);
        let [α, β, γ] = self.lemma;
        let α = α.ok_or_else(|| absent(POLES, "the eigenvalues of the error, negative numbers, or alpha, beta and gamma for Lemma 3.2 to choose them"))?;
        let constant = "the Lipschitz constant for Lemma 3.2, a positive number";
        let γ = γ.ok_or_else(|| absent(GAMMA, constant))?;
        // (4.7) has β = 1
        let found = |&μ: &usize| integrators::lemma_3_2(μ, α, β.unwrap_or(1.0), γ);
        let used = |μ: &usize| (*μ > 0).then(|| found(μ)).transpose();
        μ.iter()
            .map(used)
            .collect::<Result<_, _>>()
            .map_err(|error| {
                TuningError::new(ALPHA.name, "numbers Lemma 3.2 can be used with", error)
            })
    }

    /// `filter_poles`: the eigenvalues of the filter per input, so many of each.
    pub fn filter_poles(&self, orders: &[usize]) -> Result<Vec<Option<Vec<Pole>>>, TuningError> {
        let what = "numbers for the filter of";
        self.per_input(FILTER_POLES, what, orders, |value, order| {
            let poles = Poles::read(FILTER_POLES.name, value)?;
            Ok(poles.and_then(|poles| poles.of_length(order)))
        })
    }

    /// x̂ₐ(0) per input.
    pub fn filter_initial(&self, orders: &[usize]) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
        self.per_input(FILTER_INITIAL, "numbers for the filter of", orders, numbers)
    }

    /// Bounds of |u'|, |u''|, … per input as far as any are declared: the family's key, else those of the plant. A
    /// list that has not the length that a guarantee needs is no help here.
    pub fn known_slopes(&self, augmented: &AugmentedPlant<'_>, U: &[Vec<Node>]) -> Vec<Vec<f64>> {
        let orders: Vec<usize> = U.iter().map(Vec::len).collect();
        let own = self.slopes(&orders).unwrap_or_default().into_iter();
        let own = own.chain(std::iter::repeat(None));
        let general = augmented.input_derivatives.iter();
        own.zip(general)
            .map(|(own, general)| own.unwrap_or_else(|| general.clone()))
            .collect()
    }

    /// `input_derivatives`: per input bounds of |u'|, |u''|, …, one more than the observer
    /// reads; for guarantees only. None where they are left out.
    pub fn slopes(&self, orders: &[usize]) -> Result<Vec<Option<Vec<f64>>>, TuningError> {
        let found = self.per_input(SLOPES, "bounds of the derivatives of", orders, numbers)?;
        match found.iter().flatten().flatten().find(|x| **x < 0.0) {
            Some(x) => Err(TuningError::new(
                SLOPES.name,
                "bounds, no negative numbers",
                x,
            )),
            None => Ok(found),
        }
    }

    /// What the key has for each input that takes numbers, so many of each: a value for the only
    /// one, or a table by their names. None where it is left out.
    fn per_input<T>(
        &self,
        key: KeySpec,
        what: &str,
        orders: &[usize],
        read: impl Fn(&Value, usize) -> Result<Option<T>, TuningError>,
    ) -> Result<Vec<Option<T>>, TuningError> {
        let mut found: Vec<Option<T>> = self.inputs.iter().map(|_| None).collect();
        let Some(all) = self.common.values.get(key.name) else {
            return Ok(found);
        };
        let takes: Vec<usize> = (0..found.len()).filter(|&j| orders[j] > 0).collect();
        let wrong = || TuningError::new(key.name, self.expected(what, &takes, orders), all);
        let mut entries = vec![];
        match (all, &takes[..]) {
            (Value::Table(table), _) => {
                for (name, value) in table {
                    let j = takes.iter().find(|&&j| self.inputs[j] == *name);
                    entries.push((*j.ok_or_else(wrong)?, value));
                }
            }
            (value, &[j]) => entries.push((j, value)),
            _ => return Err(wrong()),
        }
        entries.sort_unstable_by_key(|entry| entry.0);
        for (j, value) in entries {
            found[j] = Some(read(value, orders[j])?.ok_or_else(wrong)?);
        }
        Ok(found)
    }

    /// What may stand for the inputs that take numbers.
    fn expected(&self, what: &str, takes: &[usize], orders: &[usize]) -> String {
        match *takes {
            [] => "no such key: this observer has no filter and reads no derivative".to_owned(),
            [j] => format!("{} {what} {}", orders[j], self.inputs[j]),
            _ => {
                let one = |&j: &usize| format!("{} = {} numbers", self.inputs[j], orders[j]);
                let all: Vec<String> = takes.iter().map(one).collect();
                format!("a table {{ {} }}", all.join(", "))
            }
        }
    }
}

/// Which of the three observers.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Variant {
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
        VARIANTS[self as usize]
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

/// `indices`: one whole number per measured output, n in sum; else the lengths of the lists
/// under `poles`, n in sum where every output has one.
fn indices(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
) -> Result<Vec<Option<usize>>, TuningError> {
    let (p, n) = (augmented.outputs.len(), augmented.states.len());
    if let Some(found) = tuning.numbers(INDICES.name)? {
        let whole = |x: &f64| *x >= 0.0 && x.fract() == 0.0 && *x <= n as f64;
        if found.len() != p || !found.iter().all(whole) || found.iter().sum::<f64>() != n as f64 {
            let expected = format!(
                "one whole number per measured output ({p}), the number of states ({n}) in sum"
            );
            let found: Vec<String> = found.iter().map(f64::to_string).collect();
            return Err(TuningError::new(INDICES.name, expected, found.join(", ")));
        }
        return Ok(found.iter().map(|&x| Some(x as usize)).collect());
    }
    // one output has n derivatives whatever the list says
    let Some(value) = tuning.values.get(POLES.name).filter(|_| p > 1) else {
        return Ok(vec![None; p]);
    };
    let given = per_output(value, p)?;
    let lengths: Vec<Option<usize>> = given.iter().map(Poles::count).collect();
    let all: Option<Vec<usize>> = lengths.iter().copied().collect();
    match all {
        Some(all) if all.iter().sum::<usize>() != n => {
            let expected = format!("as many poles as states ({n}) in all");
            Err(TuningError::new(POLES.name, expected, value))
        }
        _ => Ok(lengths),
    }
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

/// So many finite numbers.
fn numbers(value: &Value, count: usize) -> Result<Option<Vec<f64>>, TuningError> {
    let number = |value: &Value| value.number().filter(|x| x.is_finite());
    let found = match value {
        Value::List(_) => value.all(number),
        one => number(one).map(|x| vec![x]),
    };
    Ok(found.filter(|found| found.len() == count))
}

/// Ratio of each pole to the one before where only the slowest is given: that of the
/// paper's example.
pub(super) const RATIO: f64 = 1.2;

/// The poles of one chain or filter.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum Poles {
    /// the slowest one, each further one 1.2 times as fast as the one before
    Slowest(f64),
    /// all of them
    All(Vec<Pole>),
}

impl Poles {
    /// A number, or a list of numbers and of tables { re, im } for conjugate pairs. None
    /// where the value is neither.
    pub fn read(key: &str, value: &Value) -> Result<Option<Self>, TuningError> {
        match value {
            Value::Number(x) => Ok(Some(Self::Slowest(negative(key, *x)?))),
            Value::List(entries) => {
                let poles: Result<Option<Vec<Pole>>, _> =
                    entries.iter().map(|e| pole(key, e)).collect();
                Ok(poles?.map(Self::All))
            }
            _ => Ok(None),
        }
    }

    /// How many eigenvalues, where that is said.
    pub fn count(&self) -> Option<usize> {
        match self {
            Self::Slowest(_) => None,
            Self::All(poles) => Some(poles.iter().map(|p| p.count()).sum()),
        }
    }

    /// For a chain of length `n`; none where these are more or fewer.
    pub fn of_length(&self, n: usize) -> Option<Vec<Pole>> {
        match self {
            Self::Slowest(λ) => Some(spaced(*λ, n)),
            Self::All(poles) => (self.count() == Some(n)).then(|| poles.clone()),
        }
    }
}

/// n real poles from the slowest on.
pub(super) fn spaced(slowest: f64, n: usize) -> Vec<Pole> {
    let pole = |k: usize| Pole::Real(slowest * RATIO.powi(k as i32));
    (0..n).map(pole).collect()
}

fn pole(key: &str, value: &Value) -> Result<Option<Pole>, TuningError> {
    match value {
        Value::Number(λ) => Ok(Some(Pole::Real(negative(key, *λ)?))),
        Value::Table(parts) => {
            let part = |name: &str| parts.get(name)?.number().filter(|x| x.is_finite());
            let (Some(re), Some(im), 2) = (part("re"), part("im"), parts.len()) else {
                let expected = "a conjugate pair as { re = number, im = number }";
                return Err(TuningError::new(key, expected, value));
            };
            let re = negative(key, re)?;
            if im == 0.0 {
                let expected = "im ≠ 0 in a conjugate pair; a real pole is a number";
                return Err(TuningError::new(key, expected, value));
            }
            Ok(Some(Pole::Pair { re, im }))
        }
        _ => Ok(None),
    }
}

fn negative(key: &str, pole: f64) -> Result<f64, TuningError> {
    match pole < 0.0 && pole.is_finite() {
        true => Ok(pole),
        false => Err(TuningError::new(key, "negative numbers", pole)),
    }
}
