//! `gain = "lmi"`: a constant gain that comes with a proof.
//!
//! x̂' = f(x̂, u) − K (Cx̂ − y) with a full K: every output corrects every state. The
//! form of the equations does not matter, only the slopes of their nonlinear terms. Where
//! there is no gain, or no proof, the range that stands in the way is named.

use std::collections::BTreeMap;
use std::time::Duration;

use lynkeus_expr::Budget;
use lynkeus_proof::decay;
use lynkeus_proof::decay::{Aim, ErrorModel, Gain, NoGain, Request};
use lynkeus_structure::{AugmentedPlant, Measurement, Slopes, range};

use super::error_system::{ErrorSystem, expanded};
use super::said::{Obstacle, Said};
use crate::estimate::PlantCopy;
use crate::{
    ChainGain, Design, DesignError, Examination, KeySpec, ParameterValue, Shape, Tuning,
    TuningError, Value, estimate,
};

/// Bisections of the rate where only the gain is limited.
const HALVINGS: usize = 9;

const RATE: KeySpec = KeySpec {
    name: "rate",
    shape: Shape::Positive,
    default: "required with `\"lmi\"` unless `gain_limit` is given",
    meaning: "the decay to be proved, in 1/(unit of time)",
};

const LIMIT: KeySpec = KeySpec {
    name: "gain_limit",
    shape: Shape::Positive,
    default: "none",
    meaning: "the largest entry of the gain K on ŷ − y, with `\"lmi\"`",
};

const MINIMISE: KeySpec = KeySpec {
    name: "minimise",
    shape: Shape::Word(&["noise", "gain", "peak"]),
    default: "`\"noise\"`",
    meaning: "what the gain makes small at that rate, with `\"lmi\"`",
};

/// The word under the key `gain` that asks for it.
pub(crate) const LMI: &str = "lmi";

/// Whether a study asks for a gain that comes with a proof.
pub fn is_certified_gain(tuning: &Tuning) -> bool {
    matches!(tuning.values.get("gain"), Some(Value::Text(word)) if word == LMI)
}

/// The keys of this gain, for every family that has it.
pub(crate) const LMI_KEYS: [KeySpec; 3] = [RATE, LIMIT, MINIMISE];

/// Whether the study asks for it, as the family's key `gain` says.
///
/// # Errors
/// Wrong values, or keys of this gain where it is not asked for.
pub(crate) fn is_asked(tuning: &Tuning, asked: bool) -> Result<bool, TuningError> {
    let given = |key: &&KeySpec| tuning.values.contains_key(key.name);
    if let (false, Some(key)) = (asked, LMI_KEYS.iter().find(given)) {
        let expected = "this key only with gain = \"lmi\"";
        return Err(TuningError::new(key.name, expected, "another gain"));
    }
    tuning.positive(RATE.name)?;
    tuning.positive(LIMIT.name)?;
    aim(tuning)?;
    Ok(asked)
}

fn aim(tuning: &Tuning) -> Result<Aim, TuningError> {
    let chosen = tuning.meant(&MINIMISE, [Aim::Noise, Aim::Gain, Aim::Peak])?;
    Ok(chosen.unwrap_or(Aim::Noise))
}

/// The observer with a certified gain, for the family that asked.
pub(crate) fn design_lmi(
    augmented: &AugmentedPlant<'_>,
    tuning: &Tuning,
    examination: Examination,
) -> Result<Design, DesignError> {
    estimate::refuse(tuning, "gain = \"lmi\"")?;
    let (rate, limit) = (tuning.positive(RATE.name)?, tuning.positive(LIMIT.name)?);
    let copy = PlantCopy::new(augmented, tuning);
    let (measured, slopes) = shown(augmented)?;
    let system = ErrorSystem::open_loop(augmented, &augmented.region())?;
    if let Some((slope, undeclared)) = system.slopes.unbounded(&system.region) {
        let term = slope.term.clone();
        return Err(none("gain", Said::NoGainUnbounded { term, undeclared }));
    }
    let request = Request {
        rate: rate.unwrap_or(0.0),
        noise: weights(augmented, &tuning.noise),
        measured,
        slopes,
        scale: system.scale.clone(),
        aim: aim(tuning)?,
        limit,
        budget: augmented.graph().budget(),
    };
    let gain = match (rate, limit) {
        (Some(_), _) => decay::design(&system.models, &request)
            .map_err(|error| refusal(&system, &request, error))?,
        (None, Some(_)) => fastest(&system, request.clone())?,
        (None, None) => {
            let expected = "the required decay, 1/time unit (or gain_limit alone, for the fastest decay within it)";
            return Err(TuningError::absent(RATE.name, expected).into());
        }
    };
    assemble(augmented, &copy, examination, &request, &gain)
}

/// Of each output the state that it shows, and |c| of y = c·x + d: the smallest on the box where it
/// varies.
fn shown(augmented: &AugmentedPlant<'_>) -> Result<(Vec<usize>, Vec<f64>), DesignError> {
    let graph = augmented.graph();
    let (mut measured, mut slopes) = (vec![], vec![]);
    for output in &augmented.outputs {
        let wrong = |expected: &str| {
            let name = &output.variable.name;
            TuningError::new("gain", expected, format!("the output {name}"))
        };
        let Some((state, slope, _)) = output.state else {
            return Err(wrong("outputs that each show one state (y = c·x + d)").into());
        };
        let c = match graph.constant_value(slope) {
            Some(c) => c.abs(),
            None => {
                let values = range(graph, slope, &augmented.region())?;
                values.enclosure.mignitude()
            }
        };
        if c <= 0.0 || !c.is_finite() {
            return Err(wrong("outputs y = c·x + d with a c that is 0 nowhere on the box").into());
        }
        measured.push(state);
        slopes.push(c);
    }
    Ok((measured, slopes))
}

/// Sizes of the measurement errors, one per output: as declared, and all the same where none is.
fn weights(augmented: &AugmentedPlant<'_>, declared: &BTreeMap<String, f64>) -> Vec<f64> {
    let of = |output: &Measurement| declared.get(&output.variable.name).copied();
    let sizes: Vec<f64> = augmented
        .outputs
        .iter()
        .map(|o| of(o).unwrap_or(0.0))
        .collect();
    let counts = sizes.iter().all(|size| size.is_finite()) && sizes.iter().any(|size| *size > 0.0);
    match counts {
        true => sizes,
        false => vec![1.0; sizes.len()],
    }
}

fn none(key: &'static str, said: Said) -> DesignError {
    let reason = Box::new(said.into());
    DesignError::NoGain { key, reason }
}

fn refusal(system: &ErrorSystem, request: &Request, error: NoGain) -> DesignError {
    let rate = request.rate;
    match error {
        NoGain::Spent(spent) => spent.into(),
        NoGain::Limit(least) => {
            let limit = request.limit.unwrap_or(f64::INFINITY);
            none(LIMIT.name, Said::BeyondLimit { rate, limit, least })
        }
        _ => {
            let obstacle = obstacle(system, request);
            none(RATE.name, Said::NotReached { rate, obstacle })
        }
    }
}

/// The fastest decay within the limit of the gain.
fn fastest(system: &ErrorSystem, mut request: Request) -> Result<Gain, DesignError> {
    let budget = request.budget.clone();
    let mut at = |rate: f64| {
        request.rate = rate;
        decay::design(&system.models, &request)
    };
    // the pace of the plant itself, from which to search
    let pace = system
        .models
        .iter()
        .map(|m| m.scaled(&system.scale, 1.0).at(&m.middles()).amax());
    let mut high = pace.fold(0.0, f64::max).max(1e-9);
    let mut best = None;
    let mut low = 0.0;
    for _ in 0..HALVINGS {
        if budget.spent().is_some() {
            break;
        }
        let rate = if low > 0.0 {
            f64::midpoint(low, high)
        } else {
            0.3 * high
        };
        match at(rate) {
            Ok(gain) => (low, best) = (rate, Some(gain)),
            Err(_) => high = rate,
        }
    }
    best.ok_or_else(|| {
        request.rate = high;
        let error = decay::design(&system.models, &request)
            .err()
            .unwrap_or(NoGain::Unproved);
        refusal(system, &request, error)
    })
}

fn assemble(
    augmented: &AugmentedPlant<'_>,
    copy: &PlantCopy<'_, '_>,
    examination: Examination,
    request: &Request,
    gain: &Gain,
) -> Result<Design, DesignError> {
    let graph = augmented.graph();
    let mut derivatives = copy.at_estimate(&augmented.derivatives);
    let mut gains = vec![];
    for (j, output) in augmented.outputs.iter().enumerate() {
        let Some(innovation) = copy.innovation(j) else {
            continue;
        };
        let K: Vec<f64> = gain.K.column(j).iter().copied().collect();
        for (derivative, &k) in derivatives.iter_mut().zip(&K) {
            let correction = graph.constant(k) * graph.expr(innovation);
            *derivative = (graph.expr(*derivative) - correction).node();
        }
        let slope = output.state.map(|(_, slope, _)| slope);
        let slope = slope.and_then(|slope| graph.constant_value(slope));
        let states = augmented.states.iter().map(|state| state.name.clone());
        // on ŷ − y, where the slope is a number
        let on_output = K.iter().map(|k| k / slope.unwrap_or(1.0));
        gains.push(ChainGain {
            output: output.variable.name.clone(),
            entries: states.zip(on_output).collect(),
        });
    }
    let mut observer = copy.observer(derivatives)?;
    observer.is_whole = copy.common.tunable;
    let slopes = gain.proof.multipliers.first().map_or(0, |t| t.len());
    let row = |name: &str, value| (name.to_owned(), value);
    let largest = ParameterValue::Computed(request.largest(&gain.K));
    let parameters = vec![
        row("rate", request.rate.into()),
        row("largest gain", largest),
        row("slopes", (slopes as f64).into()),
    ];
    Ok(Design {
        observer,
        examination,
        gains,
        parameters,
        notes: vec![],
    })
}

/// Bisections of the share of the ranges.
const SHARE_HALVINGS: usize = 6;

/// The smallest share tried.
const LEAST: f64 = 0.01;

/// Slopes up to which each is tried alone.
const SINGLES: usize = 12;

/// What an explanation may take.
const EXPLAINING: Duration = Duration::from_secs(15);

/// The models with every slope's range cut by a factor that may depend on the slope.
fn cut(slopes: &Slopes, factor: impl Fn(usize) -> f64 + Copy) -> Vec<ErrorModel> {
    let cut: Vec<ErrorModel> = slopes.models.iter().map(|m| m.shrunk(factor)).collect();
    expanded(&cut)
}

/// The largest share of every range, about its middle, for which `works`; none where
/// not even a hundredth works.
fn share(slopes: &Slopes, works: impl Fn(&[ErrorModel]) -> bool) -> Option<f64> {
    let at = |share: f64| works(&cut(slopes, |_| share));
    let (mut low, mut high) = (LEAST, 1.0);
    if !at(low) {
        return None;
    }
    for _ in 0..SHARE_HALVINGS {
        let middle = f64::midpoint(low, high);
        match at(middle) {
            true => low = middle,
            false => high = middle,
        }
    }
    Some(low)
}

/// The share of the ranges for which some decay of the observer is proved.
///
/// None where the budget ends.
pub(super) fn provable_share(system: &ErrorSystem, budget: &Budget) -> Option<f64> {
    let share = share(&system.slopes, |models| {
        decay::prove(models, &system.scale, 0.0, budget).is_some()
    });
    share.filter(|_| budget.marked().is_none())
}

/// What keeps every gain from a proof of the requested rate.
fn obstacle(system: &ErrorSystem, request: &Request) -> Obstacle {
    let slopes = &system.slopes;
    let request = &Request {
        budget: request.budget.within(EXPLAINING),
        ..request.clone()
    };
    let works = |models: &[ErrorModel]| decay::is_reachable(models, request, true);
    // that there is none at all is said of a thorough look only
    let least = || decay::is_reachable(&cut(slopes, |_| LEAST), request, false);
    let share = share(slopes, works).or_else(|| least().then_some(LEAST));
    if request.budget.marked().is_some() {
        return Obstacle::TakesLonger;
    }
    let Some(share) = share else {
        return Obstacle::Middle;
    };
    // one inequality per slope is affordable only for few
    let few = slopes.slopes.len() <= SINGLES;
    let mut tried = slopes.slopes.iter().enumerate().filter(|_| few);
    let alone = tried
        .find(|(only, _)| works(&cut(slopes, |k| if k == *only { 0.0 } else { 1.0 })))
        .map(|(_, slope)| slope.clone());
    Obstacle::Ranges { share, alone }
}
