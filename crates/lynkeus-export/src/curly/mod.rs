//! Estimators as source text for other machines: C, JavaScript, Rust and Structured Text.
//!
//! Everything is drafted once, in C whose type of numbers is called `real`: the functions of the
//! graph, what is done with them from `runtime/*.c`, of which only
//! what is called is taken. C exchanges words of the draft; every other language prints its tree (`syntax`).
//! A frame ([`c`], [`javascript`], [`rust`], [`structured`]) makes files of it. Equations alone ([`Ode`]), of a plant or
//! of an observer, are drafted likewise and become an [`Exchange`].

pub mod c;
mod credible;
mod description;
mod device;
mod dialect;
mod exchange;
pub mod fmu;
mod function;
pub mod javascript;
mod kalman;
mod language;
mod linear;
mod machine;
mod observer;
mod ode;
pub mod rust;
pub mod structured;
mod syntax;
mod tables;
mod template;
mod tuning;
mod words;

pub use device::{Device, FirstReading, Tunable};
pub use exchange::Exchange;
pub use function::Entry;
pub use ode::{Ode, State};
