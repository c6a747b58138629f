//! Another θ in the transient than in the steady state.

use std::collections::BTreeMap;

use lynkeus_expr::Node;

use crate::estimate::{PlantCopy, Speed};
use crate::{KeySpec, ParameterValue, REQUIRED, Shape, Tuning, TuningError, Value};

/// The study's key.
pub(super) const TRANSIENT: KeySpec = KeySpec {
    name: "transient",
    shape: Shape::As(
        "`{ theta = …, until = …, fall = … }`",
        &Shape::Section(&[&[THETA, UNTIL, FALL]]),
    ),
    default: "none",
    meaning: "another θ up to a time, then the study's; `fall` is the time constant of a smooth change",
};

const THETA: KeySpec = KeySpec {
    name: "theta",
    shape: Shape::POSITIVES,
    default: REQUIRED,
    meaning: "θ at the start",
};

const UNTIL: KeySpec = KeySpec {
    name: "until",
    shape: Shape::Number,
    default: REQUIRED,
    meaning: "the time up to which it holds, on the axis of the study",
};

const FALL: KeySpec = KeySpec {
    name: "fall",
    shape: Shape::Positive,
    default: "at once",
    meaning: "the time constant of the change",
};

/// θ(t): one value up to `until`, the study's `theta` after it, at once or falling
/// (or rising) to it exponentially.
pub struct Transient {
    /// per chain
    pub θ: Vec<f64>,
    /// on the axis of time of the study
    until: f64,
    /// time constant of the change
    fall: Option<f64>,
}

impl Transient {
    /// The key `transient`, for `count` chains.
    pub fn read(tuning: &Tuning, count: usize) -> Result<Option<Self>, TuningError> {
        let Some(value) = tuning.values.get(TRANSIENT.name) else {
            return Ok(None);
        };
        let expected = "a table { theta = …, until = time }, and fall = time constant if the change is to be smooth";
        let wrong = || TuningError::new(TRANSIENT.name, expected, value);
        let Value::Table(table) = value else {
            return Err(wrong());
        };
        let known = |key: &String| [THETA, UNTIL, FALL].iter().any(|field| field.name == key);
        if !table.keys().all(known) {
            return Err(wrong());
        }
        let (Some(_), Some(Value::Number(until))) = (table.get("theta"), table.get("until")) else {
            return Err(wrong());
        };
        let θ = positive(table, "theta", count)?.ok_or_else(wrong)?;
        let fall = positive(table, "fall", 1)?.map(|fall| fall[0]);
        Ok(Some(Self {
            θ,
            until: *until,
            fall,
        }))
    }

    /// For the reader.
    pub fn parameter(&self) -> (String, ParameterValue) {
        let value = ParameterValue::Transient {
            θ: self.θ.clone(),
            until: self.until,
            fall: self.fall,
        };
        ("θ in the transient".to_owned(), value)
    }
}

/// The gains of chain `i` that grow like θ^exponent, with or without a transient: `(gain, exponent)` at
/// the study's steady θ.
pub(crate) fn gains(
    transient: Option<&Transient>,
    copy: &PlantCopy<'_, '_>,
    i: usize,
    θ: &Speed,
    steady: &[(f64, f64)],
) -> Vec<Node> {
    let graph = copy.augmented.graph();
    let time = graph.expr(copy.augmented.plant.time);
    let until = transient.map(|transient| graph.constant(transient.until));
    let gain = |&(gain, exponent): &(f64, f64)| {
        let steady = || θ.scaled(graph, gain, exponent);
        let (Some(transient), Some(until)) = (transient, until) else {
            return steady().node();
        };
        let gain = match transient.fall {
            None => {
                let ratio = transient.θ[i] / θ.value();
                let first = graph.constant(gain * ratio.powf(exponent));
                time.less(until).select(first, steady())
            }
            Some(fall) => {
                let since = (time - until).max(graph.constant(0.0));
                let left = (-since / graph.constant(fall)).exp();
                // θ(t)/θ
                let change = graph.constant(transient.θ[i]) / θ.expr(graph) - 1.0;
                let ratio = graph.constant(1.0) + change * left;
                steady() * ratio.pow(graph.constant(exponent))
            }
        };
        gain.node()
    };
    steady.iter().map(gain).collect()
}

/// A positive number or one per chain, with the key named as `transient.theta`.
fn positive(
    table: &BTreeMap<String, Value>,
    field: &str,
    count: usize,
) -> Result<Option<Vec<f64>>, TuningError> {
    let inner = Tuning {
        values: table.clone(),
        ..Tuning::default()
    };
    inner.positive_per_chain(field, count).map_err(|error| {
        TuningError::new(
            TRANSIENT.name,
            format!("{} for {field}", error.expected),
            error.found,
        )
    })
}
