//! Estimators as source text in languages with braces: C and JavaScript.
//!
//! Everything is drafted once, in C whose type of numbers is called `real`: the functions of the
//! graph, what is done with them from `runtime/*.c`, of which only
//! what is called is taken. A [`Language`] renders the draft; a frame ([`c`]) makes files of it.

pub mod c;
mod description;
mod device;
mod dialect;
pub mod fmu;
mod function;
pub mod javascript;
mod kalman;
mod language;
mod linear;
mod machine;
mod observer;
mod tables;
mod template;
mod tuning;

pub use device::{Device, FirstReading, Tunable};
pub use function::Entry;
pub use language::Language;
