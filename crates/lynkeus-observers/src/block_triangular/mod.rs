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

use crate::Family;
use crate::paper::{self, Paper, usable};
pub use said::{Correction, Lee, Said};
use settings::Settings;

/// The family `block-triangular`.
pub const BLOCK_TRIANGULAR: &dyn Family = &Paper {
    name: "block-triangular",
    paper: "Lee, Yee, Park 2000, observers (3) and (7)",
    basis: theorem::BASIS,
    form_on_assumed_box: false,
    keys: settings::KEYS,
    speeds: &[],
    read: Settings::read,
    deferred: |settings| usable(settings.θ()).and(usable(settings.lmi())),
    form: form::form,
    design: observer::design,
    theorem: theorem::certificate,
};

impl paper::Settings for Settings {
    type Form<'e> = form::Form;
    const FAMILY: &'static dyn Family = BLOCK_TRIANGULAR;
}
