//! From a plant's equations and a few sensors to estimates of what nobody measures.
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod error;
mod files;
mod near;
pub mod study;
pub mod table;

pub use error::{Error, ErrorKind};
pub use study::Study;
pub use table::Table;

pub use lynkeus_expr as expr;
pub use lynkeus_gain as gain;
pub use lynkeus_model as model;
pub use lynkeus_observers as observers;
pub use lynkeus_run as run;
pub use lynkeus_structure as structure;
