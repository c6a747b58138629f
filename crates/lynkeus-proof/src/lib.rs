//! What certificates trust: a small base of interval linear algebra, free of plants, graphs
//! and papers.
//!
//! Numerical search proposes, an interval check disposes. What a certificate says rests on
//! the right column alone, every operation of which is outward rounded; a wrong proposal
//! costs a proof but never makes one.
//!
//! | question | proposed by | decided by |
//! |---|---|---|
//! | is a symmetric interval matrix definite? | | [`definite`]: interval Cholesky |
//! | does e' = A(θ)e decay for every θ(t) in a box? | [`decay::prove`], [`decay::fastest`], [`decay::design`] | [`decay::holds`] |
//! | does z = Φ(x) of which ∂Φ/∂x is known, and what is left of x? | [`decay::fastest_implicit`] | [`decay::holds_implicit`], [`decay::Reach`] |
//! | has every A of an interval matrix an unstable eigenvalue? | [`lyapunov`], a Schur form | [`decay::is_unstable`] |
//! | does a chain with bounded partials decay? | [`lyapunov::of_chain`] | [`chain::Chain::decay`], [`elimination`] |
//! | do coupled chains decay, and to where? | | [`chain::Comparison`], [`chain::ultimate`], by [`metzler`] matrices |
//! | what does random noise leave, in mean square and in probability? | | [`noise`] |
//! | does a filter bear a Lipschitz remainder? | Newton's method | [`riccati`] |
//! | how large are the inverses of an interval matrix? | floating point | [`inverse`] |
//! | are all zeros of a polynomial stable? | | [`hurwitz`]: Routh's table |
//! | where is every solution from a start set? | Picard's iteration, floating point | [`tube`]: Taylor models, zonotopes |
//! | which eigenvalues and singular values? | bounded sweeps, floating point | [`spectrum`] |
//!
//! [`search`] only repeats such decisions along one number; [`vertices`] lists where convex
//! ones have to be taken.
//!
//! ```
//! use lynkeus_expr::{Budget, Interval};
//! use lynkeus_proof::decay::{ErrorModel, Proof, fastest, holds};
//!
//! // e₁' = e₂ − 2e₁, e₂' = θe₁ − e₂ with θ(t) in [−1, 1]
//! let point = Interval::point;
//! let model = |θ: f64| ErrorModel {
//!     constant: vec![vec![point(-2.0), point(1.0)], vec![point(θ), point(-1.0)]],
//!     sectors: vec![],
//! };
//! let models = [model(-1.0), model(1.0)];
//! let found = fastest(&models, &[1.0, 1.0], 1.0, &Budget::default()).unwrap();
//! // at θ = 1 the slow eigenvalue is −(3 − √5)/2
//! assert!(found.rate > 0.35 && found.rate < 0.382);
//! // no one's word is taken for it
//! assert!(holds(&models, &found));
//! assert!(!holds(&models, &Proof { rate: 0.4, ..found }));
//! ```
#![cfg_attr(test, allow(clippy::unwrap_used))]

pub mod chain;
pub mod decay;
pub mod definite;
pub mod elimination;
pub mod ellipsoid;
pub mod hurwitz;
pub mod inverse;
mod lmi;
pub mod lyapunov;
pub mod magnitude;
pub mod matrix;
pub mod metzler;
pub mod noise;
pub mod riccati;
pub mod search;
pub mod spectrum;
pub mod tube;
mod vertices;

pub use vertices::{Bounds, varying, vertices};
