//! Events: instants and surfaces at which a right-hand side jumps or bends.
//!
//! Some are decided by time alone, others by the state. Both are found in the expressions of a
//! system, what jumps is taken out of them, and integrators are told of them by
//! [`Events`](crate::Events). At an event the state goes on as it is.

mod clock;
mod expressions;
mod extract;
mod filippov;
mod guards;
mod memory;
mod occur;
mod rounds;
mod time;
mod when;

pub(crate) use clock::by_the_clock;
pub use expressions::{Instants, WhenExpressions};
pub use extract::first_jump;
pub(crate) use extract::{bends, state_events, time_events};
pub(crate) use filippov::{Filippov, Jump, Sides, Span};
pub use guards::Guards;
pub(crate) use guards::{Ahead, COEFFICIENTS, Poly, Surface};
pub use memory::Memory;
pub(crate) use occur::{occur, saltation};
pub use rounds::JumpSlopes;
pub(crate) use time::TimeEvents;
pub(crate) use when::WhenRoots;
pub use when::{Cause, ClauseShape, Clauses, Seen};
