//! θ0: from where on the decay is proved.

use super::words::shown;
use crate::statement::{proved, undecided};
use crate::{Check, Hammouri};

/// The hypothesis θ ≥ θ0; `holds`: the inequality is proved at θ itself.
pub(crate) fn reached(θ: f64, θ0: Option<f64>, holds: bool) -> Check {
    let name = Hammouri::Theta { θ };
    match (θ0, holds) {
        (Some(θ0), true) => proved(name, format!("θ0 = {}", shown(θ0))),
        (Some(θ0), false) => undecided(
            name,
            format!(
                "θ0 = {}: the theorem proves the decay from there on and says nothing below; it is sufficient, not necessary",
                shown(θ0)
            ),
        ),
        (None, true) => proved(name, "no θ0 was found, but the inequality holds at this θ"),
        (None, false) => undecided(name, "no θ0 was found up to 1e12 times the study's θ"),
    }
}
