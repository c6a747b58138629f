//! Lee, Yee and Park, *Nonlinear observer design for multi-output systems in
//! block-triangular form* (2000).
//!
//! x_i' = A_i x_i + g_i(x_1, …, x_i; u; y_{i+1}, …, y_p), y_i = C_i x_i (2), or its
//! generalisation in Remark 3 with ∂f_ij/∂x_{i,j+1} ≠ 1. With F_i = ∂f_i/∂x_i,
//! the observer (7)
//!
//! x̂_i' = f_i(x̂_1, …, x̂_i; u; y_{i+1}, …, y_p) + M_i⁻¹ [L_i + Δ_θi⁻¹ K_i] (y_i − C_i x̂_i)
//!
//! or, with M = I and L = 0, the classical observer (3).
//!
//! The rule for θ. Lemma 2 bounds θ_k^m/θ_j^l for every block k before j with
//! 1 ≤ m ≤ n_k, 1 ≤ l ≤ n_j; its worst case is m = n_k, l = 1, so for chains of any
//! lengths it asks for 1 ≤ θ_i and θ_{i−1}^{n_{i−1}} ≤ θ_i. The rule between
//! neighbours suffices: θ_k^{n_k} ≤ θ_{k+1} ≤ θ_{k+1}^{n_{k+1}} ≤ θ_{k+2} ≤ ….

mod form;
mod observer;
mod said;
mod settings;
mod theorem;
mod transformed;

use lynkeus_structure::{AugmentedPlant, Region};

use crate::design::Found;
use crate::family::Stages;
use crate::{
    Assumptions, Certificate, Design, DesignError, KeySpec, Tuning, TuningError, guarantee,
};
use form::{Form, NAME};
use observer::observer;
pub use said::{Correction, Lee, Said};
use settings::Settings;
use theorem::BASIS;

/// The family `block-triangular`.
#[derive(Clone, Copy, Debug)]
pub struct BlockTriangular;

impl Stages for BlockTriangular {
    type Settings = Settings;
    type Form<'e, 'p: 'e> = Form;
    const NAME: &'static str = NAME;
    const PAPER: &'static str = "Lee, Yee, Park 2000, observers (3) and (7)";
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
        form::form(augmented, settings, region)
    }

    fn design(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Form>,
    ) -> Result<Design, DesignError> {
        match (settings.lmi.clone()?, settings.remedies.low_power) {
            (Some(lmi), _) => {
                let examination = found.examination;
                guarantee::design_lmi(augmented, &settings.common, lmi, NAME, examination)
            }
            (None, true) => observer::low_power(augmented, settings, found),
            (None, false) => observer(augmented, settings, found),
        }
    }

    fn theorem(
        augmented: &AugmentedPlant<'_>,
        settings: &Settings,
        found: Found<Form>,
        assumptions: &Assumptions,
    ) -> Result<Certificate, DesignError> {
        theorem::certificate(augmented, settings, &found.form.blocks, assumptions)
    }
}
