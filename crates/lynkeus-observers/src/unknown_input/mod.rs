//! Farza, M'Saad, Liu and Targui, *State and unknown inputs estimation for a class
//! of nonlinear systems* (2005).
//!
//! x' = f̃(u, x) + G(u, s) v, y = x¹, in layers x = (x¹, …, x^q) where f̃^k reads
//! x¹ … x^{k+1} (1), (H3); v is unknown, s(t) a known signal: here the measured outputs
//! and time. With x¹ split into x₁¹ and x₂¹ (H4), the observer (14)
//!
//! x̂₁¹' = f̃₁¹ + G₁¹ v̂ − 2θ₁ (x̂₁¹ − y₁)
//! v̂'   =            − θ₁² (G₁¹)⁺ (x̂₁¹ − y₁)
//! X̂²'  = f̃²_X + G²_X v̂ − θ₂ Λ₂⁺ Δ₂⁻¹ S₂⁻¹C₂ᵀ (x̂₂¹ − y₂) − 2θ₁ D (x̂₁¹ − y₁)
//!
//! with f̃ at the estimate, G and D at the measured s, and Λ₂ at y₁ and
//! X̃² = X̂² − D (x̂₁¹ − y₁).
//!
//! Corrections to the print: the first term of V̇₂ in (24) is −(θ₂ − c₄) V₂.
//! Lemma 1 holds for m₁ = m only. For m₁ > m the columns that (ii) asks for may
//! come from f̃₁¹ alone, as with f̃₁¹ = (0, x²), G₁¹ = (1, 0), f̃₂¹ = 0, G₂¹ = 0:
//! (ii) holds, ∂f̄₁²/∂x² = 0. So (11) is a condition of its own here; together with (i)
//! it implies (ii).

mod constants;
mod form;
mod observer;
mod said;
mod settings;
mod theorem;

use crate::Family;
use crate::paper::{self, Paper, usable};
pub use said::{Farza, Said, Shape};
use settings::Settings;

/// The family `unknown-input`.
pub const UNKNOWN_INPUT: &dyn Family = &Paper {
    name: "unknown-input",
    paper: "Farza, M'Saad, Liu, Targui 2005, observer (14)",
    basis: theorem::BASIS,
    form_on_assumed_box: true,
    keys: &[&settings::KEYS],
    // θ₁ is four times θ₂, as in the paper's example
    speeds: &[4.0, 1.0],
    read: Settings::read,
    deferred: |settings| usable(settings.thetas()),
    form: form::search,
    design: observer::design,
    theorem: theorem::certificate,
};

impl paper::Settings for Settings {
    type Form<'e> = form::Form<'e, 'e>;
    const FAMILY: &'static dyn Family = UNKNOWN_INPUT;
}
