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

use crate::Family;
use crate::paper::{self, Paper};
pub use said::{Ltaief, Said};
use settings::Settings;

/// The family `state-affine`.
pub const STATE_AFFINE: &dyn Family = &Paper {
    name: "state-affine",
    paper: "Ltaief, Maatoug, Farza, Ménard, M'Saad, Koubaa, observer (7)–(8)",
    basis: theorem::BASIS,
    form_on_assumed_box: false,
    keys: &[&settings::KEYS],
    speeds: &[],
    read: Settings::read,
    deferred: Settings::deferred,
    form: form::form,
    design: observer::design,
    theorem: theorem::certificate,
};

impl paper::Settings for Settings {
    type Form<'e> = form::Form;
    const FAMILY: &'static dyn Family = STATE_AFFINE;
}
