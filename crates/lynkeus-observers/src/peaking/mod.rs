//! Remedies against peaking and noise that families share: a limit on the
//! innovation, another θ in the transient, the low-power form.

mod departure;
mod innovation;
mod low_power;
mod settings;
pub(crate) mod transient;

pub(crate) use departure::Departure;
pub(crate) use innovation::InnovationLimit;
pub(crate) use low_power::{Part, Run, factor_rows, nominal, variation};
pub(crate) use settings::KEYS;
pub(crate) use settings::Remedies;
pub(crate) use transient::Transient;
