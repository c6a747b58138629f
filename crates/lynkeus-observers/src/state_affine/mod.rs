//! Ltaief, Maatoug, Farza, Ménard, M'Saad and Koubaa, *High gain observer design for a
//! class of MIMO non uniformly observable uncertain systems*.
//!
//! x' = F(u, x) x + φ(u, x) + Bε, y = C(u) x (1)–(2) with rectangular blocks
//! F_k(u, x¹, …, x^k) above the diagonal that need not have full rank at any
//! instant; ε acts on the last block. Observer (7) with the Lyapunov ODE (8):
//!
//! x̂' = F(u, x̂) x̂ + φ(u, x̂) − θ Δ_θ⁻¹ S⁻¹ Cᵀ(u) (C(u) x̂ − y),
//! S' = −θ (S + Fᵀ(u, x̂) S + S F(u, x̂) − Cᵀ(u) C(u)).
//!
//! S is integrated in factors, its smallest eigenvalue watched (`observer`).
//!
//! Corrections to the print: B has the sign of (29), + in the last block; the
//! inputs of Theorem 1's remark satisfy A4, not A3; the error decays like
//! e^{−θμ_θt} with μ_θ → ½, as (24) and (26) have it, not e^{−μ_θt} with μ_θ → 1.
//! Beyond the print: C(u) need not be square, and y = C(u)x + d(u) is understood.

mod form;
mod observer;
mod said;
mod settings;
mod theorem;

use lynkeus_structure::{AugmentedPlant, Region};

use crate::design::Found;
use crate::family::Stages;
use crate::{Assumptions, Certificate, Design, DesignError, KeySpec, Tuning, TuningError};
use form::{Form, NAME};
pub use said::{Ltaief, Said};
use settings::Settings;
use theorem::BASIS;

/// The family `state-affine`.
#[derive(Clone, Copy, Debug)]
pub struct StateAffine;

impl Stages for StateAffine {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Form;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Ltaief, Maatoug, Farza, Ménard, M'Saad, Koubaa, observer (7)–(8)";
    const BASIS: &'static str = BASIS;
    const KEYS: &'static [&'static [KeySpec]] = &[&settings::KEYS];

    fn read(augmented: &AugmentedPlant<'_>, tuning: &Tuning) -> Result<Settings, TuningError> {
        Settings::read(augmented, tuning)
    }

    fn deferred(settings: &Settings) -> Result<(), TuningError> {
        settings.deferred()
    }

    fn form(
        augmented: &AugmentedPlant<'_>,
        _: &Settings,
        region: &Region,
    ) -> Result<Found<Form>, DesignError> {
        form::form(augmented, region)
    }

    fn design(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Form>,
    ) -> Result<Design, DesignError> {
        observer::assemble(augmented, settings, found)
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
