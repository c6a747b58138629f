//! The study's keys.

use lynkeus_gain::Tridiagonal;
use lynkeus_structure::{AugmentedPlant, ChainRequest};

use crate::conditions::{CHAINS, chain_request, output_names};
use crate::estimate::PROLONG;
use crate::guarantee::{self, LMI, LMI_KEYS};
use crate::peaking::Remedies;
use crate::tuning::numbers;
use crate::{KeySpec, REQUIRED, Shape, Tuning, TuningError, Value, peaking};

const THETA: KeySpec = KeySpec {
    name: "theta",
    shape: Shape::POSITIVES,
    default: REQUIRED,
    meaning: "the speed θ, in 1/(unit of time): larger converges faster, peaks higher and passes more noise",
};

const DELTA: KeySpec = KeySpec {
    name: "delta",
    shape: Shape::POSITIVES,
    default: "1, and the middle of Theorem 2's window",
    meaning: "the exponents δ of θ",
};

const FACTOR: KeySpec = KeySpec {
    name: "r",
    shape: Shape::POSITIVES,
    default: "1",
    meaning: "the factor r of the gain; with Lemma 1 its ρ/2",
};

const GAIN: KeySpec = KeySpec {
    name: "gain",
    shape: Shape::Word(&["lemma1", LMI]),
    default: "`\"lemma1\"`",
    meaning: "where the gain comes from: Lemma 1's S (unless `S` is given), or [a linear matrix inequality](certificates.md)",
};

const MATRICES: KeySpec = KeySpec {
    name: "S",
    shape: Shape::As(
        "list of `{ diag = […], off = […] }`, one per chain",
        &Shape::List(&Shape::Section(&[&[DIAGONAL, BESIDE]])),
    ),
    default: "Lemma 1's",
    meaning: "explicit tridiagonal matrices: n numbers on the diagonal, n − 1 beside it",
};

const DIAGONAL: KeySpec = KeySpec {
    name: "diag",
    shape: Shape::As("list of n numbers", &Shape::List(&Shape::Number)),
    default: REQUIRED,
    meaning: "on the diagonal",
};

const BESIDE: KeySpec = KeySpec {
    name: "off",
    shape: Shape::As("list of n − 1 numbers", &Shape::List(&Shape::Number)),
    default: REQUIRED,
    meaning: "beside it",
};

const PARTIALS: KeySpec = KeySpec {
    name: "partials",
    shape: Shape::Flag,
    default: "false",
    meaning: "divide the gain by the chain's partials at the estimate",
};

const LEADING: KeySpec = KeySpec {
    name: "leading",
    shape: Shape::As("name of a measured output", &Shape::Text),
    default: "the first chain that can; with `delta`, one for which it lies in the window",
    meaning: "which of several chains plays the first part in Theorem 2, where more than one can",
};

/// Those of the paper and its extensions.
const OWN: [KeySpec; 9] = [
    THETA, DELTA, FACTOR, GAIN, MATRICES, PARTIALS, CHAINS, LEADING, PROLONG,
];

/// Every key of the family.
pub(super) const KEYS: &[&[KeySpec]] = &[&OWN, &LMI_KEYS, &peaking::KEYS];

/// The keys, read.
pub struct Settings {
    pub common: Tuning,
    /// per chain, as in every list here
    pub δ: Option<Vec<f64>>,
    pub r: Option<Vec<f64>>,
    pub S: Option<Vec<Tridiagonal>>,
    /// the gain is divided by the partials
    pub divided: bool,
    pub request: ChainRequest,
    /// the output whose chain leads
    pub leading: Option<usize>,
    /// the gain is a certified one
    pub lmi: bool,
    pub remedies: Remedies,
    /// measured outputs
    outputs: usize,
}

impl Settings {
    pub fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        let count = augmented.outputs.len();
        let S = explicit(tuning)?;
        let sizes = S
            .as_ref()
            .map(|S| S.iter().map(Tridiagonal::size).collect());
        let asked = tuning.meant(&GAIN, [false, true])?.unwrap_or(false);
        let lmi = guarantee::is_asked(tuning, asked)?;
        let of_standard: &[KeySpec] = match lmi {
            true => &[],
            false => &[MATRICES, FACTOR, GAIN],
        };
        Ok(Self {
            common: tuning.checked()?,
            δ: tuning.positive_per_chain(DELTA.name, count)?,
            r: tuning.positive_per_chain(FACTOR.name, count)?,
            S,
            divided: tuning.flag(PARTIALS.name)?,
            request: chain_request(augmented, tuning, MATRICES.name, sizes)?,
            leading: leading(augmented, tuning)?,
            lmi,
            remedies: Remedies::read(tuning, count, of_standard)?,
            outputs: count,
        })
    }

    /// θ by chain, which has no default.
    pub fn θ(&self) -> Result<Vec<f64>, TuningError> {
        let expected = "a positive number (the gain grows like theta^n)";
        let missing = || TuningError::absent(THETA.name, expected);
        let given = self.common.positive_per_chain(THETA.name, self.outputs)?;
        given.ok_or_else(missing)
    }
}

/// The chain that the study lets lead, by the place of its output.
fn leading(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Option<usize>, TuningError> {
    let outputs = output_names(augmented);
    let name = tuning.choice(LEADING.name, &outputs)?;
    Ok(name.and_then(|name| outputs.iter().position(|o| *o == name)))
}

/// S as the study gives it.
fn explicit(tuning: &Tuning) -> Result<Option<Vec<Tridiagonal>>, TuningError> {
    let Some(value) = tuning.values.get(MATRICES.name) else {
        return Ok(None);
    };
    let expected = "a list of tables with the keys diag and off";
    let wrong = || TuningError::new(MATRICES.name, expected, value);
    let matrix = |(i, table): (usize, &Value)| {
        let entries = match table {
            Value::Table(entries) if entries.len() == 2 => entries,
            _ => return Err(wrong()),
        };
        let field = |key: KeySpec| numbers(MATRICES.name, entries.get(key.name).ok_or_else(wrong)?);
        Tridiagonal::new(field(DIAGONAL)?, field(BESIDE)?).map_err(|error| {
            let place = i + 1;
            let expected = format!("a positive definite tridiagonal matrix as entry {place}");
            TuningError::new(MATRICES.name, expected, error)
        })
    };
    let tables = value.list().ok_or_else(wrong)?;
    let matrices = tables.iter().enumerate().map(matrix);
    matrices.collect::<Result<_, _>>().map(Some)
}
