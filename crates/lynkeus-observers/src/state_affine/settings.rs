//! The study's keys.

use lynkeus_gain::UnitFactor;
use lynkeus_proof::matrix::square;
use lynkeus_structure::AugmentedPlant;

use crate::estimate::PROLONG;
use crate::paper::usable;
use crate::{KeySpec, REQUIRED, Shape, Tuning, TuningError, Value};

const THETA: KeySpec = KeySpec {
    name: "theta",
    shape: Shape::Positive,
    default: REQUIRED,
    meaning: "the speed θ, in 1/(unit of time): the gain of block k grows like θ^k. Theorem 1 is stated for θ ≥ 1, so choose a unit of time in which the entries of F are of the order of 1",
};

const START: KeySpec = KeySpec {
    name: "S0",
    shape: Shape::As(
        "number s > 0, or a matrix as a list of rows",
        &Shape::Either(&[Shape::Positive, Shape::ROWS]),
    ),
    default: "1",
    meaning: "S(0) = s·I, or the matrix; rows and columns in the order of the plant's states, then the unknown inputs",
};

const ALARM: KeySpec = KeySpec {
    name: "alarm",
    shape: Shape::Positive,
    default: "see below",
    meaning: "the flag is raised where `excitation` is below this",
};

const CONTINUED: KeySpec = KeySpec {
    meaning: "the observer runs on F(u, σ(x̂))x̂ + φ(u, σ(x̂)), σ the limits of the declared ranges, as A2 asks: the theorem then holds for every start of the estimate",
    ..PROLONG
};

/// Every key of the family.
pub(super) const KEYS: [KeySpec; 4] = [THETA, START, ALARM, CONTINUED];

/// The keys, read.
pub struct Settings {
    pub common: Tuning,
    /// of the plant, with the unknown inputs
    states: usize,
}

impl Settings {
    pub fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        Ok(Self {
            common: tuning.checked()?,
            states: augmented.states.len(),
        })
    }

    /// The first of the keys left for later that has a wrong value.
    pub fn deferred(&self) -> Result<(), TuningError> {
        usable(self.θ())?;
        usable(start(&self.common, self.states))?;
        usable(self.alarm())
    }

    /// θ, which has no default.
    pub fn θ(&self) -> Result<f64, TuningError> {
        let expected = "a positive number (the gain of block k grows like theta^k)";
        let missing = || TuningError::absent(THETA.name, expected);
        self.common.positive(THETA.name)?.ok_or_else(missing)
    }

    /// Below this excitation the flag is raised, where the study says so.
    pub fn alarm(&self) -> Result<Option<f64>, TuningError> {
        self.common.positive(ALARM.name)
    }

    /// S(0) with the states in this order.
    pub fn S0(&self, order: &[usize]) -> Result<UnitFactor, TuningError> {
        let given = start(&self.common, self.states)?;
        let entry = |i: usize, j: usize| match &given {
            Given::Number(s) if i == j => *s,
            Given::Number(_) => 0.0,
            Given::Matrix(given) => given[order[i]][order[j]],
        };
        let n = order.len();
        UnitFactor::new(&square(n, entry)).map_err(|error| START.wrong(error))
    }
}

/// S(0) as the study has it: a large plant needs no matrix before its observer does.
enum Given {
    /// s of s·I
    Number(f64),
    /// in the order of the plant's states
    Matrix(Vec<Vec<f64>>),
}

/// S(0): s·I for a number s, or a matrix in the order of the plant's states.
fn start(tuning: &Tuning, n: usize) -> Result<Given, TuningError> {
    let expected = format!(
        "a positive number s for s·I, or a symmetric positive definite {n}×{n} matrix as a list of rows, one per estimated quantity"
    );
    let wrong = |found: String| TuningError::new(START.name, expected.clone(), found);
    let given = match tuning.values.get(START.name) {
        None => return Ok(Given::Number(1.0)),
        Some(Value::Number(s)) if *s > 0.0 && s.is_finite() => return Ok(Given::Number(*s)),
        Some(Value::List(rows)) => {
            let entry = |x: &Value| x.number().ok_or_else(|| wrong(x.to_string()));
            let row = |row: &Value| {
                let entries = row.list().ok_or_else(|| wrong(row.to_string()))?;
                entries.iter().map(entry).collect::<Result<Vec<f64>, _>>()
            };
            rows.iter().map(row).collect::<Result<Vec<_>, _>>()?
        }
        Some(other) => return Err(wrong(other.to_string())),
    };
    if given.len() != n {
        return Err(wrong(format!("{} rows", given.len())));
    }
    // refused in the user's order, factored in that of the blocks
    UnitFactor::new(&given).map_err(|error| wrong(error.to_string()))?;
    Ok(Given::Matrix(given))
}

#[cfg(test)]
mod tests {
    /// The page of the family shows the table of its keys as it is declared here.
    #[test]
    fn the_page_shows_the_keys() {
        let page = include_str!("../../../../docs/state-affine.md");
        for key in super::KEYS {
            assert!(page.contains(&key.row()), "{}", key.row());
        }
    }
}
