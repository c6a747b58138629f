//! The keys of the remedies, for every family that has them.

use super::low_power::{self, LowPower};
use super::{InnovationLimit, Transient, innovation, transient};
use crate::{KeySpec, Shape, Tuning, TuningError, Value};

const FORM: KeySpec = KeySpec {
    name: "form",
    kind: "`\"standard\"`, `\"low-power\"`",
    shape: Shape::Word(&["standard", "low-power"]),
    default: "`\"standard\"`",
    meaning: "the observer with gains of order θ² at most, with `low_power_poles` or `low_power_k`",
};

/// The keys.
pub(crate) const KEYS: [KeySpec; 5] = [
    innovation::LIMIT,
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
