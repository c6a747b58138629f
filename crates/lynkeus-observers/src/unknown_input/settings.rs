//! The study's keys.

use lynkeus_structure::AugmentedPlant;

use crate::conditions::output_names;
use crate::{KeySpec, Shape, Tuning, TuningError, Value};

const THETA: KeySpec = KeySpec {
    name: "theta",
    shape: Shape::As(
        "list of two numbers > 0, [θ1, θ2]",
        &Shape::List(&Shape::Positive),
    ),
    default: "from the proof, where a bound exists",
    meaning: "θ1 for the unknown inputs and x₁¹, θ2 for the rest",
};

const PARTITION: KeySpec = KeySpec {
    name: "partition",
    shape: Shape::As("list of measured outputs", &Shape::NAMES),
    default: "found",
    meaning: "the outputs of x₁¹",
};

/// Every key of the family.
pub(super) const KEYS: [KeySpec; 2] = [THETA, PARTITION];

/// The keys, read.
pub struct Settings {
    pub common: Tuning,
    /// places of the measured outputs of x₁¹ in ascending order; none to search them
    pub partition: Option<Vec<usize>>,
}

impl Settings {
    pub fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Self, TuningError> {
        Ok(Self {
            common: tuning.checked()?,
            partition: partition(tuning, augmented)?,
        })
    }

    /// θ₁ and θ₂, none where the proof is to choose them.
    pub fn thetas(&self) -> Result<Option<[f64; 2]>, TuningError> {
        let Some(found) = self.common.numbers(THETA.name)? else {
            return Ok(None);
        };
        let [θ1, θ2] = found[..] else {
            return Err(THETA.wrong(format!("{} number(s)", found.len())));
        };
        match [θ1, θ2].iter().find(|θ| !(**θ > 0.0 && θ.is_finite())) {
            Some(wrong) => Err(THETA.wrong(wrong)),
            None => Ok(Some([θ1, θ2])),
        }
    }
}

fn partition(
    tuning: &Tuning,
    augmented: &AugmentedPlant<'_>,
) -> Result<Option<Vec<usize>>, TuningError> {
    let Some(value) = tuning.values.get(PARTITION.name) else {
        return Ok(None);
    };
    let outputs = output_names(augmented);
    let wrong = |found: &Value| {
        let expected = format!(
            "a list of measured outputs, those of x₁¹ ({})",
            outputs.join(", ")
        );
        TuningError::new(PARTITION.name, expected, found)
    };
    let mut first = vec![];
    for entry in value.list().ok_or_else(|| wrong(value))? {
        let named = entry.text();
        let place = named.and_then(|name| outputs.iter().position(|o| *o == name));
        let place = place.filter(|place| !first.contains(place));
        first.push(place.ok_or_else(|| wrong(entry))?);
    }
    first.sort_unstable();
    Ok(Some(first))
}

/// A number of outputs in `partition` that cannot be.
pub(super) fn wrong_size(
    sizes: &std::ops::RangeInclusive<usize>,
    measured: usize,
    found: usize,
) -> TuningError {
    let expected = format!(
        "between {} and {} of the {measured} measured outputs: at least one per unknown input, and as many left as there are states behind the measured ones",
        sizes.start(),
        sizes.end(),
    );
    TuningError::new(PARTITION.name, expected, format!("{found} outputs"))
}

/// No θ is given, and `reason` says why the proof gives none.
pub(super) fn no_theta(reason: &str) -> TuningError {
    let expected = format!("two positive numbers [θ1, θ2]; {reason}");
    TuningError::absent(THETA.name, expected)
}

#[cfg(test)]
mod tests {
    /// The page of the family shows the table of its keys as it is declared here.
    #[test]
    fn the_page_shows_the_keys() {
        let page = include_str!("../../../../docs/unknown-input.md");
        for key in super::KEYS {
            assert!(page.contains(&key.row()), "{}", key.row());
        }
    }
}
