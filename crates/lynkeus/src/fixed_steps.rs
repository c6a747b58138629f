//! Fixed steps: those that are asked for, those that are needed, and what is told of them.

use lynkeus_model::Variable;
use lynkeus_run::{Blueprint, Method, Step, System, needed_step};
use lynkeus_structure::short;

use crate::Error;
use crate::prepare::Prepared;

/// How many of the steps that the fastest mode needs (|λ|h ≤ ½) are one with which the classical method
/// is stable for no mode that decays: all of its region left of the axis has |λ|h < 2.97.
const LONGEST: f64 = 5.94;

/// A step that is asked for.
///
/// # Errors
/// It is none.
pub(crate) fn sound(step: Option<f64>) -> Result<Option<f64>, Error> {
    match step {
        Some(step) if !(step > 0.0 && step.is_finite()) => Err(Error::input(format!(
            "--step: expected a finite number above 0, found {step}"
        ))),
        step => Ok(step),
    }
}

/// The next shorter step of one digit: 1, 2 or 5.
pub(crate) fn rounded(step: f64) -> f64 {
    let unit = 10.0_f64.powf(step.log10().floor());
    let digit = match step / unit {
        d if d >= 5.0 => 5.0,
        d if d >= 2.0 => 2.0,
        _ => 1.0,
    };
    // the nearest number with these digits
    format!("{digit}e{}", step.log10().floor())
        .parse()
        .unwrap_or(digit * unit)
}

/// What a step does that `estimate` and `simulate` do not.
pub(crate) fn bends(system: &System) -> Option<String> {
    let told = "the model bends with time alone (max, min, abs of time): lynkeus stops at these instants, here a step goes across them";
    system.has_instants().then(|| told.to_owned())
}

/// With fixed steps: those asked for, those of the study, or such as the fastest mode needs.
pub(crate) fn stepped(
    prepared: &Prepared<'_>,
    made: Blueprint,
    step: Option<f64>,
    notes: &mut Vec<String>,
) -> Result<Blueprint, Error> {
    if let Some(step) = sound(step)? {
        return Ok(made.with_method(Method::Rk4(Step::AtMost(step))));
    }
    if let Method::Rk4(Step::AtMost(_) | Step::Substeps(_)) = made.method() {
        return Ok(made);
    }
    let Some(needed) = needed(prepared, &made) else {
        let message = "the step cannot be chosen: the equations have no slopes at the start";
        return Err(Error::input(message)
            .at(&prepared.study().file)
            .hint("write method = \"rk4\" and step = … under [estimate], or give --step"));
    };
    if needed.is_infinite() {
        notes.push("one step from each sample to the next: at the start nothing moves by itself; --step takes a longest step".to_owned());
        return Ok(made.with_method(Method::Rk4(Step::Substeps(1))));
    }
    let step = rounded(needed);
    notes.push(format!(
        "steps of {} at most, which the fastest mode at the start needs: [estimate] has no method = \"rk4\" with `step`; --step takes another",
        short(step)
    ));
    Ok(made.with_method(Method::Rk4(Step::AtMost(step))))
}

/// A value that an input may have.
pub(crate) fn typical(input: &Variable) -> f64 {
    let middle = 0.5 * (input.min + input.max);
    let middle = if middle.is_finite() { middle } else { 0.0 };
    input.start.or(input.nominal).unwrap_or(middle)
}

/// Where fixed steps are so long that the method itself grows, if it is seen to.
pub(crate) fn hasty(prepared: &Prepared<'_>, made: &Blueprint) -> Option<String> {
    let Method::Rk4(Step::AtMost(step)) = made.method() else {
        return None;
    };
    let longest = LONGEST * needed(prepared, made)?;
    (step > longest).then(|| {
        format!(
            "not for these steps: they are {} at most, and beyond about {} the fastest mode at the start makes the method itself grow",
            short(step),
            short(longest)
        )
    })
}

/// The step that the fastest mode at the start needs.
fn needed(prepared: &Prepared<'_>, made: &Blueprint) -> Option<f64> {
    let known = prepared.plant().inputs.iter();
    let known: Vec<(&str, f64)> = known.map(|i| (i.name.as_str(), typical(i))).collect();
    needed_step(made, &known)
}

/// Fixed steps in words.
pub(crate) fn steps(method: Method) -> Option<String> {
    match method {
        Method::Rk4(Step::AtMost(h)) => Some(format!("steps of {h:?} at most")),
        Method::Rk4(Step::Substeps(n)) => Some(format!("{n} steps from sample to sample")),
        _ => None,
    }
}
