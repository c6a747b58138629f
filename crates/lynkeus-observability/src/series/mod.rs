//! Power series of a model's solution with their sensitivities.
//!
//! The coefficients of every quantity are computed order by order: those of a product are a
//! convolution, those of x follow from x' = f. Each carries its derivatives with respect
//! to the unknowns. Functions that are not rational enter by the differential equation
//! they satisfy (e^a, for instance, by y' = y·a') with a random first
//! coefficient: where no algebraic relation ties them to the rest, that is a generic point;
//! the usual relations among functions of the same kind are kept (see `functions`).

mod functions;
mod program;
mod run;

pub(crate) use functions::Functions;
pub(crate) use program::Program;
pub(crate) use run::{Run, Stop};
