//! Remedies against peaking and noise that families share: a limit on the
//! innovation, another θ in the transient, the low-power form; their keys, and how the
//! observer departs from that of the family's paper with them.

mod low_power;
mod transient;

pub(crate) use low_power::Part;
use low_power::{Blocks, Run};
use lynkeus_expr::{Graph, Node};
use lynkeus_gain::low_power::Coefficients;
pub(crate) use transient::{Transient, gains};

use crate::conditions::Partial;
use crate::estimate::{PlantCopy, Speed};
use crate::statement::undecided;
use crate::{
    Check, Design, Examination, KeySpec, ParameterValue, Reason, Shape, Statement, Tuning,
    TuningError, Value,
};

const FORM: KeySpec = KeySpec {
    name: "form",
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
    /// How large |Cx̂ − y| may get in a correction, per measured output and in its unit.
    ///
    /// While |Cx̂ − y| stays below the limit the observer is the unlimited one, bit by bit,
    /// hence the hard saturation: convergence is kept for every start from which the unlimited
    /// error never leaves that strip. Beyond it the correction is smaller than the proof asks for.
    pub limit: Option<Vec<f64>>,
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
        let low_power = tuning.meant(&FORM, [false, true])?.unwrap_or(false);
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
        low_power::refuse_unstable(tuning)?;
        Ok(Self {
            limit: tuning.positive_per_chain(LIMIT.name, outputs)?,
            transient: Transient::read(tuning, outputs)?,
            low_power,
            poles: tuning.values.get(low_power::POLES.name).cloned(),
            given: tuning.values.get(low_power::GIVEN.name).cloned(),
        })
    }

    /// The coefficients of the low-power form for chains of these lengths.
    fn coefficients(&self, lengths: &[usize]) -> Result<Vec<Coefficients>, TuningError> {
        low_power::coefficients(self.given.as_ref(), self.poles.as_ref(), lengths)
    }

    /// x̂ − x as measured for the state that output `i` shows, limited; in the unit of the state,
    /// y = slope·x + offset. None where the output shows no single state.
    pub(crate) fn innovation(&self, copy: &PlantCopy<'_, '_>, i: usize) -> Option<Node> {
        let innovation = copy.innovation(i)?;
        let Some(limits) = &self.limit else {
            return Some(innovation);
        };
        let graph = copy.augmented.graph();
        let (_, slope, _) = copy.augmented.outputs[i].state?;
        let limit = graph.constant(limits[i]) / graph.expr(slope).abs();
        Some(graph.expr(innovation).min(limit).max(-limit).node())
    }
}

/// The study's key.
pub(super) const LIMIT: KeySpec = KeySpec {
    name: "innovation_limit",
    shape: Shape::As("number > 0, or one per output", &Shape::POSITIVES),
    default: "none",
    meaning: "the correction sees the innovation limited to ± this: a remedy against [peaking](peaking.md)",
};

/// The hypothesis that the observer is the paper's, which is open where a key of the study makes
/// another one, as a certified gain does.
pub(crate) fn departure(
    statement: impl Into<Statement>,
    is_certified: bool,
    remedies: &Remedies,
) -> Option<Check> {
    let departures = [
        (is_certified, "gain"),
        (remedies.low_power, FORM.name),
        (remedies.transient.is_some(), transient::TRANSIENT.name),
        (remedies.limit.is_some(), LIMIT.name),
    ];
    let (_, key) = departures.into_iter().find(|(asked, _)| *asked)?;
    Some(undecided(statement, Reason::AnotherObserver { key }))
}

/// The observer with every chain in the low-power form; `θ` is by output, `f` has f_1, …, f_n of a part over
/// the plant's symbols. The gains are divided by constants in the middle of the partials' bounds, with `advice` for
/// where there is none, or by the partials at the estimate.
pub(crate) fn low_power(
    copy: &PlantCopy<'_, '_>,
    remedies: &Remedies,
    θ: &[f64],
    parts: &[Part<'_>],
    f: impl Fn(usize) -> Vec<Node>,
    advice: Option<&str>,
    examination: Examination,
) -> Result<Design, TuningError> {
    let mut lengths = vec![0; parts.len()];
    for part in parts {
        lengths[part.output] = part.states.len();
    }
    let K = remedies.coefficients(&lengths)?;
    let starts = copy.states()?.into_iter().map(|(_, start)| start);
    let transient = remedies.transient.as_ref();
    let mut run = Run {
        copy,
        transient,
        starts: starts.collect(),
        derivatives: copy.at_estimate(&copy.augmented.derivatives),
        copies: vec![],
    };
    let speeds = Speed::of_chains(copy, θ);
    let mut parameters = vec![("θ".to_owned(), θ.to_vec().into())];
    parameters.extend(transient.map(Transient::parameter));
    let pairs = K.iter().enumerate().map(|(i, K)| {
        let name = format!("K of chain {}", i + 1);
        (name, ParameterValue::Pairs(K.clone()))
    });
    parameters.extend(pairs);
    let mut notes = vec![];
    for (place, part) in parts.iter().enumerate() {
        let Some(innovation) = remedies.innovation(copy, part.output) else {
            continue;
        };
        let (output, K) = (
            &copy.augmented.outputs[part.output].variable.name,
            &K[part.output],
        );
        let bounds: Vec<(f64, f64)> = part.partials.iter().map(|p| p.bounds).collect();
        if advice.is_some() && low_power::varies(&bounds, K) {
            let output = output.clone();
            notes.push(Reason::PartialsVary { output });
        }
        let blocks = Blocks {
            part,
            f: &f(place),
            divisors: &divisors(copy.augmented.graph(), part.partials, advice)?,
            innovation,
            K,
            θ: &speeds[part.output],
        };
        // each acts on the innovation of its block, not on ŷ − y: they are no gain K
        let added = run.add(&blocks).into_iter();
        parameters.extend(added.map(|(state, x)| (format!("{output}: on {state}"), x.into())));
    }
    let mut observer = copy.observer(run.derivatives)?;
    for (state, derivative) in run.copies {
        observer.states.push(state);
        observer.derivatives.push(derivative);
    }
    Ok(Design {
        observer: observer.tuned_by(&speeds),
        examination,
        gains: vec![],
        parameters,
        notes,
    })
}

/// What the second gain of each block is divided by, over the plant's symbols: a_i itself, or the
/// constant that stands for it.
fn divisors(
    graph: &Graph,
    partials: &[Partial],
    advice: Option<&str>,
) -> Result<Vec<Node>, TuningError> {
    let divisor = |partial: &Partial| match (advice, partial.nominal()) {
        (None, _) => Ok(partial.node),
        (Some(_), Some(middle)) => Ok(graph.constant(middle).node()),
        (Some(advice), None) => {
            let expected = format!(
                "partial derivatives with known positive bounds for form = \"low-power\"; {advice}"
            );
            let found = format!("bounds {} and {}", partial.bounds.0, partial.bounds.1);
            Err(TuningError::new(FORM.name, expected, found))
        }
    };
    partials.iter().map(divisor).collect()
}
