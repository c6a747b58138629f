//! Fixed steps: those that are asked for, and what is told of them.

use lynkeus_run::System;

use crate::Error;

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
