//! Guaranteed decay of e' = (A(θ) − KC) e for every θ(t) in a box: quadratic Lyapunov
//! functions V = eᵀPe with V' ≤ −2·rate·V, found by linear matrix inequalities and
//! accepted by interval arithmetic.
//!
//! A(θ) = A₀ + Σ_k θ_k b_k e_{s_k}ᵀ has one uncertain number per nonlinear term and
//! state. With θ_k = m_k + δ_k h_k, |δ_k| ≤ 1 and one multiplier t_k > 0 for each, the
//! S-procedure gives one inequality of polynomial size,
//!
//! [ He(PA_m) + 2·rate·P + Σ t_k e_{s_k} e_{s_k}ᵀ   P B ]
//! [ BᵀP                                            −T ] < 0,    B = (h_k b_k), T = diag t
//!
//! (Boyd, El Ghaoui, Feron and Balakrishnan 1994, section 5.1: the diagonal norm-bound
//! inclusion). What multiplies several terms at once, such as a flow rate, is not made
//! an uncertain number but a list of models, one per vertex of its range, with one P
//! for all.

mod analysis;
mod check;
mod extent;
mod frame;
mod growth;
mod inequalities;
mod model;
mod scale;
mod synthesis;

pub use analysis::{fastest, prove};
pub use check::holds;
pub use growth::is_unstable;
pub use model::{ErrorModel, Sector, expanded};
pub use synthesis::{Aim, Gain, NoGain, Request, design, is_reachable};

use nalgebra::{DMatrix, DVector};

/// A Lyapunov function with its multipliers: what has to be checked.
#[derive(Clone, Debug, PartialEq)]
pub struct Proof {
    /// V' ≤ −2·rate·V
    pub rate: f64,
    /// V = eᵀPe
    pub P: DMatrix<f64>,
    /// per model: one multiplier per sector
    pub multipliers: Vec<DVector<f64>>,
}
