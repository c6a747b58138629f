//! Germani and Manes, *State observers for nonlinear systems with smooth/bounded
//! input*, Kybernetika 35 (1999) 393–413.
//!
//! x' = f(x) + g(x)u, y = h(x) without any canonical form: it is enough that the
//! output and its derivatives determine the state. With Φ = (h, L_f h, …), Q = ∂Φ/∂x
//! and, along the flow with its input, Φ̄(x, U), Q̄ = ∂Φ̄/∂x, Q̄_a = ∂Φ̄/∂U:
//!
//! bounded       x̂' = f + gu + Q⁻¹(x̂) K (y − h(x̂))                               (3.1)
//! theoretical   x̂' = f + gu + Q̄⁻¹(x̂, U) K (y − h(x̂)),  U = (u, u', …) exact      (4.1)
//! practical     x̂' = f + g x̂_a1 + Q̄⁻¹(x̂, x̂_a)(K₁(y − h(x̂)) − Q̄_a K₂(u − x̂_a1)),
//!               x̂_a' = A x̂_a + K₂(u − x̂_a1)                                      (4.22)
//!
//! Corrections to the print: Remark 4.2 must read r ≥ n − 1 (then no derivative of
//! the input is needed); (3.20) needs ‖V⁻¹‖²; Theorem 3.3's bound is u_M ≤ β λ_min(P); (4.22) holds
//! no n̄(ẑ, x̂_a)w, so the error of the practical observer is driven by n̄(z, x_a)w.
//! Beyond the print: several inputs, each with a filter of its own order, and
//! several outputs with the indices of Krener and Respondek.

mod form;
mod indices;
mod lipschitz;
mod observer;
mod said;
mod settings;
mod theorem;
mod together;

use crate::Family;
use crate::paper::{self, Paper};
pub use said::{Germani, Known, Others, Said};
use settings::Settings;

const PAPER: &str = "Germani, Manes 1999, http://dml.cz/dmlcz/135297";

/// The family `drift-observable`.
pub const DRIFT_OBSERVABLE: &dyn Family = &Paper {
    name: "drift-observable",
    paper: PAPER,
    basis: PAPER,
    form_on_assumed_box: true,
    keys: &[&settings::KEYS],
    speeds: &[],
    read: Settings::read,
    deferred: |_| Ok(()),
    form: indices::form,
    design: observer::design,
    theorem: theorem::certificate,
};

impl paper::Settings for Settings {
    type Form<'e> = form::Form;
    const FAMILY: &'static dyn Family = DRIFT_OBSERVABLE;
}
