//! Estimators as source text for other machines: C, JavaScript, Rust and Structured Text.
//!
//! Everything is drafted once, in C whose type of numbers is called `real`: the functions of the
//! graph, what is done with them from `runtime/*.c`, of which only
//! what is called is taken. C exchanges words of the draft; every other language prints its tree (`syntax`).
//! A frame ([`c`], [`javascript`], [`rust`], [`structured`]) makes files of it. Equations alone ([`Ode`]), of a plant or
//! of an observer, are drafted likewise and become an [`Exchange`].

pub mod c;
mod description;
mod device;
mod draft;
mod estimator;
mod events;
pub mod fmu;
pub mod javascript;
mod machine;
mod ode;
mod pass;
pub mod rust;
pub mod structured;
mod syntax;
mod template;

pub use device::{Device, Entry, FirstReading, Tunable};
pub use ode::{Exchange, Ode, State};
