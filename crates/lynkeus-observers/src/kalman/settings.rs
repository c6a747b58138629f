//! The study's keys.

use lynkeus_model::Variable;
use lynkeus_run::filter::FilterKind;
use lynkeus_structure::Extended;

use crate::estimate::Common;
use crate::{KeySpec, Shape, Signal, Tuning, TuningError, Value};

const VARIANCE: KeySpec = KeySpec {
    name: "initial_variance",
    kind: "table: name = number ≥ 0, and `default`",
    shape: Shape::Table(&Shape::NotNegative),
    default: "the square of a quarter of the declared range (without a range: of the start value, or 1)",
    meaning: "how uncertain the first estimate is: the variance of each state and unknown input; `default` holds for everything not listed",
};

const GATE: KeySpec = KeySpec {
    name: "gate",
    kind: "number > 0",
    shape: Shape::Positive,
    default: "none",
    meaning: "a reading whose innovation exceeds so many of its standard deviations is rejected and counted; after ten in a row the next is believed",
};

/// Those of every filter.
pub(super) const KEYS: [KeySpec; 2] = [VARIANCE, GATE];

/// That of the filters that may go anywhere.
pub(super) const BOUNDS: [KeySpec; 1] = [KeySpec {
    name: "bounds",
    kind: "\"project\"",
    shape: Shape::Word(&["project"]),
    default: "none",
    meaning: "\"project\": the estimate is kept in the declared ranges `[min, max]`: after each prediction and correction it is put to the nearest place inside by the covariance's metric, so that what is correlated moves along; the covariance stays",
}];

/// Those of the unscented filter.
pub(super) const POINTS: [KeySpec; 3] = [
    KeySpec {
        name: "alpha",
        kind: "number > 0",
        shape: Shape::Positive,
        default: "1",
        meaning: "α, the spread of the sigma points: λ = α²(n + κ) − n",
    },
    KeySpec {
        name: "beta",
        kind: "number",
        shape: Shape::Number,
        default: "0",
        meaning: "β, what the first weight of the covariance gets on top",
    },
    KeySpec {
        name: "kappa",
        kind: "number",
        shape: Shape::Number,
        default: "0",
        meaning: "κ, with n + κ above 0; the defaults make the cubature filter",
    },
];

/// Samples in the window where the study does not say.
pub(super) const HORIZON: usize = 10;

/// That of the moving-horizon estimator.
pub(super) const WINDOW: [KeySpec; 1] = [KeySpec {
    name: "horizon",
    kind: "whole number ≥ 1",
    shape: Shape::Whole(1),
    default: "10",
    meaning: "samples over which the states are estimated anew at each sample, within `[min, max]`",
}];

/// The keys, read.
pub struct Settings {
    pub common: Common,
    pub kind: FilterKind,
    pub gate: Option<f64>,
    /// the estimate is kept in the declared ranges
    pub projects: bool,
    /// as given, by extended state
    variance: Vec<Option<f64>>,
}

/// A variance of the first estimate.
pub struct Variance {
    pub value: f64,
    /// by the study
    pub given: bool,
}

impl Settings {
    pub fn read(
        extended: &Extended<'_>,
        tuning: &Tuning,
        kind: FilterKind,
    ) -> Result<Self, TuningError> {
        Ok(Self {
            common: Common::read(tuning)?,
            kind,
            gate: tuning.positive(GATE.name)?,
            projects: tuning.choice(BOUNDS[0].name, &["project"])?.is_some(),
            variance: variances(extended, tuning)?,
        })
    }

    /// The variances given, and those that follow from the declared ranges.
    pub fn variances(&self, extended: &Extended<'_>, starts: &[(Signal, f64)]) -> Vec<Variance> {
        let states = extended.states.iter().zip(starts).zip(&self.variance);
        states
            .map(|((state, (_, start)), given)| Variance {
                value: given.unwrap_or_else(|| prior_variance(state, *start)),
                given: given.is_some(),
            })
            .collect()
    }
}

/// The square of a quarter of the range: two standard deviations reach its ends. Without a range, that of
/// the start value, or 1.
pub fn prior_variance(state: &Variable, start: f64) -> f64 {
    let width = state.max - state.min;
    match width.is_finite() && width > 0.0 {
        true => (width / 4.0).powi(2),
        false => start.powi(2).max(1.0),
    }
}

fn variances(extended: &Extended<'_>, tuning: &Tuning) -> Result<Vec<Option<f64>>, TuningError> {
    let table = match tuning.values.get(VARIANCE.name) {
        None => return Ok(vec![None; extended.states.len()]),
        Some(Value::Table(table)) => table,
        Some(other) => return Err(VARIANCE.wrong(other)),
    };
    let variance = |name: &str, value: &Value| match value {
        Value::Number(x) if *x >= 0.0 && x.is_finite() => Ok(*x),
        other => Err(VARIANCE.wrong(format!("{name} = {other}"))),
    };
    let default = table.get("default").map(|value| variance("default", value));
    let mut found = vec![default.transpose()?; extended.states.len()];
    for (name, value) in table.iter().filter(|(name, _)| *name != "default") {
        let value = variance(name, value)?;
        let mut meant = 0;
        for (state, found) in extended.states.iter().zip(&mut found) {
            if is_or_has(name, &state.name) {
                *found = Some(value);
                meant += 1;
            }
        }
        if meant == 0 {
            let names: Vec<&str> = extended.states.iter().map(|s| s.name.as_str()).collect();
            let expected = format!("names of estimated quantities ({})", names.join(", "));
            return Err(TuningError::new(
                VARIANCE.name,
                expected,
                format!("\"{name}\""),
            ));
        }
    }
    Ok(found)
}

/// Whether a name is that of a variable, or of the array it is an element of.
pub(crate) fn is_or_has(name: &str, variable: &str) -> bool {
    let element = variable.strip_prefix(name);
    element.is_some_and(|rest| rest.is_empty() || rest.starts_with('['))
}

/// A number under a key.
pub(super) fn number(tuning: &Tuning, key: &KeySpec) -> Result<Option<f64>, TuningError> {
    match tuning.values.get(key.name) {
        None => Ok(None),
        Some(Value::Number(x)) => Ok(Some(*x)),
        Some(other) => Err(key.wrong(other)),
    }
}
