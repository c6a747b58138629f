//! Remedies against peaking and noise that families share: a limit on the
//! innovation, another θ in the transient, the low-power form; their keys, and how the
//! observer departs from that of the family's paper with them.

mod low_power;
mod transient;

pub(crate) use low_power::{Part, Run, factor_rows, variation};
use lynkeus_expr::Node;
pub(crate) use transient::{Transient, gains};

use crate::estimate::PlantCopy;
use crate::guarantee::Lmi;
use crate::statement::undecided;
use crate::{Check, KeySpec, Shape, Statement, Tuning, TuningError, Value};
use low_power::LowPower;

const FORM: KeySpec = KeySpec {
    name: "form",
    kind: "`\"standard\"`, `\"low-power\"`",
    shape: Shape::Word(&["standard", "low-power"]),
    default: "`\"standard\"`",
    meaning: "the observer with gains of order θ² at most, with `low_power_poles` or `low_power_k`",
};

/// The keys.
pub(crate) const KEYS: [KeySpec; 5] = [
    LIMIT,
    transient::TRANSIENT,
    FORM,
    low_power::POLES,
    low_power::GIVEN,
];

/// The remedies that a study asks for.
pub struct Remedies {
    pub limit: InnovationLimit,
    pub transient: Option<Transient>,
    /// the form of Astolfi and Marconi
    pub low_power: bool,
    poles: Option<Value>,
    given: Option<Value>,
}

impl Remedies {
    /// `of_standard`: the family's keys that only its standard form reads. Keys of the form
    /// that is not asked for are refused.
    pub fn read(
        tuning: &Tuning,
        outputs: usize,
        of_standard: &[KeySpec],
    ) -> Result<Self, TuningError> {
        let form = tuning.choice(FORM.name, &["standard", "low-power"])?;
        let low_power = form.as_deref() == Some("low-power");
        let (asked, foreign) = match low_power {
            true => ("low-power", of_standard),
            false => ("standard", &[low_power::POLES, low_power::GIVEN][..]),
        };
        for key in foreign {
            if let Some(found) = tuning.values.get(key.name) {
                let expected =
                    format!("no such key with form = \"{asked}\", which does not read it");
                return Err(TuningError::new(key.name, expected, found));
            }
        }
        LowPower::refuse_unstable(tuning)?;
        Ok(Self {
            limit: InnovationLimit::read(tuning, outputs)?,
            transient: Transient::read(tuning, outputs)?,
            low_power,
            poles: tuning.values.get(low_power::POLES.name).cloned(),
            given: tuning.values.get(low_power::GIVEN.name).cloned(),
        })
    }

    /// The coefficients of the low-power form for chains of these lengths.
    pub fn coefficients(&self, lengths: &[usize]) -> Result<LowPower, TuningError> {
        LowPower::of(self.given.as_ref(), self.poles.as_ref(), lengths)
    }
}

/// The study's key.
pub(super) const LIMIT: KeySpec = KeySpec {
    name: "innovation_limit",
    kind: "number > 0, or one per output",
    shape: Shape::POSITIVES,
    default: "none",
    meaning: "the correction sees the innovation limited to ± this: a remedy against [peaking](peaking.md)",
};

/// How large |Cx̂ − y| may get in a correction, per measured output and in its unit.
///
/// While |Cx̂ − y| stays below the limit the observer is the unlimited one, bit by bit,
/// hence the hard saturation: convergence is kept for every start from which the unlimited
/// error never leaves that strip. Beyond it the correction is smaller than the proof asks for.
pub struct InnovationLimit(Option<Vec<f64>>);

impl InnovationLimit {
    pub fn read(tuning: &Tuning, outputs: usize) -> Result<Self, TuningError> {
        Ok(Self(tuning.positive_per_chain(LIMIT.name, outputs)?))
    }

    /// Whether there is a limit.
    pub fn is_set(&self) -> bool {
        self.0.is_some()
    }

    /// x̂ − x as measured for the state that output `i` shows, limited; in the unit of the state,
    /// y = slope·x + offset. None where the output shows no single state.
    pub(crate) fn innovation(&self, copy: &PlantCopy<'_, '_>, i: usize) -> Option<Node> {
        let innovation = copy.innovation(i)?;
        let Some(limits) = &self.0 else {
            return Some(innovation);
        };
        let graph = copy.extended.graph();
        let (_, slope, _) = copy.extended.outputs[i].state?;
        let limit = graph.constant(limits[i]) / graph.expr(slope).abs();
        Some(graph.expr(innovation).min(limit).max(-limit).node())
    }
}

/// How a study's observer departs from the one that the theorem is about.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Departure {
    /// a gain by linear matrix inequalities
    Gain,
    /// the form of Astolfi and Marconi
    LowPower,
    /// θ changes with time
    Transient,
    /// the correction sees a limited innovation
    InnovationLimit,
}

impl Departure {
    /// The first one.
    pub fn of(gain: Option<&Lmi>, remedies: &Remedies) -> Option<Self> {
        let departures = [
            (gain.is_some(), Self::Gain),
            (remedies.low_power, Self::LowPower),
            (remedies.transient.is_some(), Self::Transient),
            (remedies.limit.is_set(), Self::InnovationLimit),
        ];
        let mut asked = departures.into_iter().filter(|(asked, _)| *asked);
        asked.next().map(|(_, departure)| departure)
    }

    fn key(self) -> &'static str {
        match self {
            Self::Gain => "gain",
            Self::LowPower => "form",
            Self::Transient => "transient",
            Self::InnovationLimit => "innovation_limit",
        }
    }

    /// The hypothesis that the observer is the paper's, which is then open.
    pub fn check(self, statement: impl Into<Statement>) -> Check {
        let detail = format!(
            "the key '{}' makes another observer, which the theorem does not cover",
            self.key()
        );
        undecided(statement, detail)
    }
}
