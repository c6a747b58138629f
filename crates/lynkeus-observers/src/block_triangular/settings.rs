//! The study's keys, and K: given, or by its eigenvalues.

use lynkeus_structure::{AugmentedPlant, ChainRequest};

use super::said::Correction;
use crate::conditions::{CHAINS, chain_request, output_names};
use crate::estimate::PROLONG;
use crate::guarantee::{self, LMI, LMI_KEYS};
use crate::peaking::Remedies;
use crate::{KeySpec, REQUIRED, Shape, Tuning, TuningError, Value, peaking};

const THETA: KeySpec = KeySpec {
    name: "theta",
    shape: Shape::POSITIVES,
    default: REQUIRED,
    meaning: "θᵢ",
};

const GIVEN: KeySpec = KeySpec {
    name: "k",
    shape: Shape::As("list of lists of numbers, one per chain", &Shape::ROWS),
    default: "poles at −1",
    meaning: "Kᵢ: the coefficients that place the poles of Aᵢ − KᵢCᵢ",
};

const POLES: KeySpec = KeySpec {
    name: "k_poles",
    shape: Shape::As(
        "list of lists of negative numbers, one per chain",
        &Shape::ROWS,
    ),
    default: "−1, −1, …",
    meaning: "the eigenvalues of Aᵢ − KᵢCᵢ, instead of `k`",
};

const CORRECTION: KeySpec = KeySpec {
    name: "correction",
    shape: Shape::Word(&["lee", "classical"]),
    default: "`\"lee\"`",
    meaning: "observer (7), or (3)",
};

const ORDER: KeySpec = KeySpec {
    name: "order",
    shape: Shape::As("list of every measured output", &Shape::NAMES),
    default: "searched",
    meaning: "the order of the blocks",
};

const GAIN: KeySpec = KeySpec {
    name: "gain",
    shape: Shape::Word(&[LMI]),
    default: "by `k` or `k_poles`",
    meaning: "[a certified gain](certificates.md) instead of the paper's",
};

/// Those of the paper and its extensions.
const OWN: [KeySpec; 8] = [
    THETA, GIVEN, POLES, CORRECTION, CHAINS, ORDER, PROLONG, GAIN,
];

/// Every key of the family.
pub(super) const KEYS: &[&[KeySpec]] = &[&OWN, &LMI_KEYS, &peaking::KEYS];

/// The keys, read.
pub struct Settings {
    pub common: Tuning,
    /// per measured output
    pub K: Option<Vec<Vec<f64>>>,
    /// K comes from the study as it is, not by its poles
    pub given: bool,
    pub correction: Correction,
    /// the outputs, by place, in the order of the blocks
    pub order: Option<Vec<usize>>,
    pub request: ChainRequest,
    pub remedies: Remedies,
    /// measured outputs
    outputs: usize,
}

impl Settings {
    pub fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        let count = augmented.outputs.len();
        let remedies = Remedies::read(tuning, count, &[GIVEN, POLES])?;
        let correction = tuning.meant(&CORRECTION, [Correction::Lee, Correction::Classical])?;
        let K = coefficients(tuning)?;
        let lengths = K.as_ref().map(|k| k.iter().map(Vec::len).collect());
        Ok(Self {
            common: tuning.checked()?,
            K,
            given: tuning.values.contains_key(GIVEN.name),
            correction: correction.unwrap_or(Correction::Lee),
            request: chain_request(augmented, tuning, GIVEN.name, lengths)?,
            order: order(augmented, tuning)?,
            remedies,
            outputs: count,
        })
    }

    /// θ by measured output, where the study has it.
    pub fn given_θ(&self) -> Result<Option<Vec<f64>>, TuningError> {
        self.common.positive_per_chain(THETA.name, self.outputs)
    }

    /// θ, which has no default.
    pub fn θ(&self) -> Result<Vec<f64>, TuningError> {
        let missing = || TuningError::absent(THETA.name, "a positive number per chain");
        self.given_θ()?.ok_or_else(missing)
    }

    /// Whether the gain is a certified one.
    pub fn lmi(&self) -> Result<bool, TuningError> {
        let asked = self.common.meant(&GAIN, [true])?;
        guarantee::is_asked(&self.common, asked.is_some())
    }

    /// K for chains of these lengths, every eigenvalue of A − KC at −1 by default.
    pub fn K(&self, lengths: &[usize]) -> Vec<Vec<f64>> {
        let all_at_one = |n: &usize| placed(&vec![-1.0; *n]);
        let default = || lengths.iter().map(all_at_one).collect();
        self.K.clone().unwrap_or_else(default)
    }

    /// Whether observer (7) is asked for in a form that it does not have.
    pub fn impossible(&self) -> bool {
        self.remedies.low_power && self.correction == Correction::Lee
    }
}

/// K_i as the study gives them, or from the eigenvalues of A − KC.
fn coefficients(tuning: &Tuning) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    let (given, poles) = (
        number_lists(tuning, GIVEN.name)?,
        number_lists(tuning, POLES.name)?,
    );
    match (given, poles) {
        (Some(_), Some(_)) => {
            let expected = "k or k_poles, which both decide K";
            Err(TuningError::new(POLES.name, expected, "both"))
        }
        (k, None) => Ok(k),
        (None, Some(poles)) => {
            if let Some(pole) = poles.iter().flatten().find(|pole| **pole >= 0.0) {
                return Err(TuningError::new(POLES.name, "negative numbers", pole));
            }
            Ok(Some(poles.iter().map(|poles| placed(poles)).collect()))
        }
    }
}

/// The outputs in the order that the study asks for, by place.
fn order(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
) -> Result<Option<Vec<usize>>, TuningError> {
    let Some(names) = tuning.names(ORDER.name)? else {
        return Ok(None);
    };
    let outputs = output_names(augmented);
    let place = |name: &String| outputs.iter().position(|o| o == name);
    let places: Option<Vec<usize>> = names.iter().map(place).collect();
    let all = places.filter(|places| {
        places.len() == outputs.len() && (0..outputs.len()).all(|i| places.contains(&i))
    });
    all.map(Some).ok_or_else(|| {
        let expected = format!("every measured output once ({})", outputs.join(", "));
        TuningError::new(ORDER.name, expected, &tuning.values[ORDER.name])
    })
}

/// K with the eigenvalues of A − KC at the poles: the coefficients of Π(s − pole).
fn placed(poles: &[f64]) -> Vec<f64> {
    let mut coefficients = vec![1.0];
    for pole in poles {
        let shifted = coefficients.iter().map(|c| -pole * c);
        let mut next: Vec<f64> = coefficients.iter().copied().chain([0.0]).collect();
        for (sum, term) in next[1..].iter_mut().zip(shifted) {
            *sum += term;
        }
        coefficients = next;
    }
    coefficients.split_off(1)
}

/// Lists of numbers, one per chain.
fn number_lists(tuning: &Tuning, key: &str) -> Result<Option<Vec<Vec<f64>>>, TuningError> {
    let number = |x: &Value| x.number().filter(|x| x.is_finite());
    let expected = "a list of lists of numbers, one per chain";
    tuning.read(key, expected, |value| value.all(|row| row.all(number)))
}
