//! What can be known of a model from its outputs: local observability of states,
//! identifiability of parameters, and reconstruction of unknown inputs.
//!
//! A quantity is *locally observable* if, near a generic point, no other value of it gives the
//! same outputs. The outputs' power series in time depends on the unknowns; a quantity
//! is observable exactly if its gradient is a combination of the gradients of the series'
//! coefficients (Hermann and Krener 1977; Sedoglavic, *A probabilistic algorithm to test
//! local algebraic observability in polynomial time*, J. Symb. Comp. 33 (2002)). The rank
//! is taken at a random point of a prime field, in exact arithmetic: for rational
//! models "observable" is certain, and "unobservable" is wrong with a probability
//! near degree/2⁶¹.
//!
//! ```
//! use lynkeus_model::{LoadOptions, Plant};
//! use lynkeus_observability::{Question, Verdict, analyse};
//!
//! let text = "model Decay
//!   parameter Real k; parameter Real c;
//!   Real x;
//!   output Real y = c*x;
//! equation
//!   der(x) = -k*x;
//! end Decay;";
//! let options = LoadOptions { symbolic_parameters: true, ..LoadOptions::default() };
//! let plant = Plant::from_modelica(text, "decay.mo", &options)?;
//! let answer = analyse(&plant, &Question { parameters: true, ..Question::default() })?;
//! assert_eq!(answer.verdict("k"), Some(Verdict::Observable));
//! assert_eq!(answer.verdict("c"), Some(Verdict::Unobservable));
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod analysis;
mod branches;
mod combined;
mod expansion;
mod hidden;
mod hull;
mod lie;
mod model;
pub mod precision;
mod question;
mod search;
mod series;
mod settled;
mod switched;

pub use combined::analyse;
pub use question::{
    Answer, Asked, Kind, Note, Partial, Quantity, Question, QuestionError, Symmetry, Verdict,
};
