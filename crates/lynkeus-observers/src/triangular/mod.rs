//! Hammouri, Targui and Armanet, *High gain observer based on a triangular
//! structure*, Int. J. Robust Nonlinear Control 12 (2002) 497–518.
//!
//! x' = f(x, u) in one chain (4) or two (8), y_i = x^i_1, observer (9) (more chains: `docs/triangular.md`):
//!
//! x̂^i' = f^i(x̂, u) − r_i Δ_{θ^δi} S_i⁻¹ Cᵀ (x̂^i_1 − y_i),  Δ_{θ^δ} = diag(θ^δ, …, θ^{nδ}).
//!
//! Corrections to the print: the correction has the minus sign of (9) with
//! r = ρ/2 > 0 throughout; the signs of Remark 2 multiply along the chain,
//! ε_{j+1} = ε_j·sign(∂f_j/∂x_{j+1}), with ε_1 = 1 because y is measured.

mod conditions;
mod form;
mod observer;
mod said;
mod settings;
mod theorem;

use crate::Family;
use crate::paper::{self, Paper, usable};
pub use said::{Hammouri, Loose, Said};
use settings::Settings;

/// The family `triangular`.
pub const TRIANGULAR: &dyn Family = &Paper {
    name: "triangular",
    paper: "Hammouri, Targui, Armanet 2002, doi:10.1002/rnc.638",
    basis: theorem::BASIS,
    form_on_assumed_box: false,
    keys: settings::KEYS,
    speeds: &[],
    read: Settings::read,
    deferred: |settings| usable(settings.θ()),
    form: conditions::form,
    design: observer::design,
    theorem: theorem::certificate,
};

impl paper::Settings for Settings {
    type Form<'e> = form::Form;
    const FAMILY: &'static dyn Family = TRIANGULAR;
}
