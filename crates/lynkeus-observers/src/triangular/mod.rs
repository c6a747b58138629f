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

use lynkeus_structure::{AugmentedPlant, Region};

use crate::design::Found;
use crate::family::Stages;
use crate::{
    Assumptions, Certificate, Design, DesignError, KeySpec, Tuning, TuningError, guarantee,
};
use form::{Form, Gains, NAME};
use observer::observer;
pub use said::{Hammouri, Loose, Said};
use settings::Settings;
use theorem::BASIS;

/// The family `triangular`.
#[derive(Clone, Copy, Debug)]
pub struct Triangular;

impl Stages for Triangular {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Form;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Hammouri, Targui, Armanet 2002, doi:10.1002/rnc.638";
    const BASIS: &'static str = BASIS;
    const KEYS: &'static [&'static [KeySpec]] = settings::KEYS;

    fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(augmented, tuning)
    }

    fn deferred(settings: &Settings) -> Result<(), TuningError> {
        settings.deferred()
    }

    fn form(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        region: &Region,
    ) -> Result<Found<Form>, DesignError> {
        conditions::form(augmented, settings, region)
    }

    fn design(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Form>,
    ) -> Result<Design, DesignError> {
        if let Some(lmi) = settings.lmi.clone() {
            let examination = found.examination;
            return guarantee::design_lmi(augmented, &settings.common, lmi, NAME, examination);
        }
        if settings.remedies.low_power {
            return Ok(observer::low_power(augmented, settings, found)?);
        }
        let Found { form, examination } = found;
        let gains = Gains::new(&form, settings)?;
        Ok(observer(augmented, settings, &form, &gains, examination)?)
    }

    fn theorem(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Form>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(augmented, settings, found, assumptions)
    }
}
