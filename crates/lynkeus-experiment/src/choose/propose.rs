//! How fast an observer is to be, where the study leaves it out.

use lynkeus_proof::spectrum;

use lynkeus_expr::Spent;
use lynkeus_observers::Examination;
use lynkeus_observers::Value;

use crate::prepare::Prepared;
use crate::prepare::choice::{Proposal, Speed};
use crate::prepare::modes::Start;

/// Values tried in simulation.
const POINTS: usize = 13;
/// They reach from this many decays in a run …
const SLOWEST: f64 = 2.0;
/// … to this many.
const FASTEST: f64 = 1000.0;
/// States, and rows of the run, beyond which the time scales have to do.
const STATES: usize = 30;
const ROWS: f64 = 5000.0;
/// The time that the runs may take: seldom reached, as what is chosen must not depend on the machine.
const TIME: std::time::Duration = std::time::Duration::from_secs(30);

/// The knee of a short sweep where the study has a simulation, else twice the mean rate of the plant.
///
/// # Errors
/// The limit that ended the sweep.
pub(crate) fn propose(
    prepared: &Prepared<'_>,
    examination: &Examination,
    speed: Speed,
) -> Result<Option<Proposal>, Spent> {
    if let Some(value) = knee(prepared, examination, speed)? {
        return Ok(Some(Proposal {
            speed,
            value,
            is_tried: true,
            why: format!("the knee of {POINTS} values in simulation, which `lynkeus tune` refines"),
        }));
    }
    Ok(time_scales(prepared, examination, speed))
}
fn knee(
    prepared: &Prepared<'_>,
    examination: &Examination,
    speed: Speed,
) -> Result<Option<Value>, Spent> {
    use lynkeus_study::{Name, Values};
    use std::ops::ControlFlow;

    let study = prepared.study();
    let Some(run) = &study.simulate else {
        return Ok(None);
    };
    let family = examination.family;
    let span = run.until - run.start;
    let step = run.sample_step.or(run.output_step).unwrap_or(span / 500.0);
    if prepared.augmented().states.len() > STATES || span / step > ROWS {
        return Ok(None);
    }
    let mut own = study.clone();
    own.budget = study.budget.within(TIME);
    own.observer.family = Some(Name::from(family.name()));
    own.observer.tuning.values.retain(|key, _| family.owns(key));
    start_off(&mut own, prepared);
    let (low, high) = (
        SLOWEST / span,
        (1.0 / step).min(FASTEST / span).max(4.0 * SLOWEST / span),
    );
    let rate = |k: usize| low * (high / low).powf(k as f64 / (POINTS - 1) as f64);
    // a list is swept by factors on what stands there
    let value = |rate: f64| speed.value(family, rate);
    let (factor, first) = match value(low) {
        list @ Value::List(_) => (low, Some(list)),
        _ => (1.0, None),
    };
    let tried: Vec<(f64, Value)> = (0..POINTS)
        .map(|k| match (value(rate(k)), &first) {
            (Value::Number(x), None) => (x, Value::Number(x)),
            (value, _) => (rate(k) / factor, value),
        })
        .collect();
    if let Some(first) = first {
        let key = speed.key().to_owned();
        own.observer.tuning.values.insert(key, first);
    }
    own.tune.keys = vec![(
        Name::from(speed.key()),
        Values::Listed(tried.iter().map(|(x, _)| *x).collect()),
    )];
    let found = crate::tune::tune(&own, None, &mut |_| ControlFlow::Continue(()));
    // a sweep that is not whole would depend on the machine
    if let Some(spent) = own.budget.marked() {
        return Err(spent);
    }
    let best = found
        .ok()
        .and_then(|found| found.chosen()?.values.first().copied());
    let chosen = tried.into_iter().find(|(x, _)| Some(*x) == best);
    Ok(chosen.map(|(_, value)| value))
}

/// From the true start no speed would be too slow: where the study does not say where the estimate
/// starts, it is off by this share of each range.
const OFF: f64 = 0.1;
fn start_off(own: &mut crate::Study, prepared: &Prepared<'_>) {
    let initial = &mut own.observer.tuning.initial;
    let augmented = prepared.augmented();
    let starts = Start::of(augmented).states;
    for (state, start) in augmented.states.iter().zip(starts) {
        let off = OFF * (state.max - state.min);
        let moved = match start + off > state.max {
            true => start - off,
            false => start + off,
        };
        let is_given = initial.of(&state.name).or(initial.default).is_some();
        if !is_given && off.is_finite() {
            initial.values.insert(state.name.clone(), moved);
        }
    }
}

/// Twice the mean rate of the plant's modes, which nothing was tried with.
pub(crate) fn time_scales(
    prepared: &Prepared<'_>,
    examination: &Examination,
    speed: Speed,
) -> Option<Proposal> {
    let (family, augmented) = (examination.family, prepared.augmented());
    let modes = spectrum::eigenvalues(Start::of(augmented).jacobian(augmented)?)?;
    let sizes: Vec<f64> = modes.iter().map(|λ| λ.norm()).collect();
    let largest = sizes.iter().copied().fold(0.0, f64::max);
    let moving: Vec<f64> = sizes.into_iter().filter(|x| *x > 1e-9 * largest).collect();
    let logs: f64 = moving.iter().map(|x| x.ln()).sum();
    let span = prepared
        .study()
        .simulate
        .as_ref()
        .map(|run| run.until - run.start);
    let (rate, why): (f64, String) = match (moving.len(), span) {
        (0, None) => (1.0, "the plant has no time scale of its own, and the study no [simulate] to try values on".to_owned()),
        (0, Some(span)) => (30.0 / span, "thirty decays in the run of [simulate]".to_owned()),
        (count, _) => (2.0 * (logs / count as f64).exp(), "twice the mean rate of the plant's modes at its start; with [simulate] it is the knee of a sweep".to_owned()),
    };
    let limited = span.map_or(rate, |span| rate.clamp(3.0 / span, FASTEST / span));
    limited.is_finite().then(|| Proposal {
        speed,
        is_tried: false,
        value: speed.value(family, limited),
        why,
    })
}

#[cfg(test)]
mod tests {
    use lynkeus_model::{LoadOptions, Plant};

    use super::*;

    #[test]
    fn only_a_start_that_is_not_given_is_moved() {
        let text = "model M Real x[2](each max = 1, each min = 0); Real z(min = 0, max = 2); output Real y = x[1]; equation der(x[1]) = x[2]; der(x[2]) = z; der(z) = 0; end M;";
        let plant = Plant::from_modelica(text, "m.mo", &LoadOptions::default()).unwrap();
        let started = |initial: &str| {
            let text = format!("plant = \"m.mo\"\n[observer]\ninitial = {{ {initial} }}\n");
            let study = crate::Study::parse(&text, "s.toml").unwrap();
            let mut own = study.clone();
            start_off(&mut own, &Prepared::new(&study, &plant).unwrap());
            let initial = own.observer.tuning.initial;
            ["x[1]", "x[2]", "z"].map(|name| initial.of(name))
        };
        let [one, two, z] = started("x = 0.25");
        assert_eq!((one, two), (Some(0.25), Some(0.25)));
        assert!(z.is_some());
        let [one, two, _] = started("\"x[2]\" = 0.75");
        assert!(one.is_some_and(|x| x != 0.75) && two == Some(0.75));
        assert_eq!(started("default = 0.5"), [None; 3]);
    }
}
