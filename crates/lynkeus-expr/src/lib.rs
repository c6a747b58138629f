//! Hash-consed expression graphs, their derivatives, and tapes evaluated over many algebras.
//!
//! A [`Graph`] holds expressions, each distinct one once. A [`Tape`] is a graph
//! compiled to straight-line code; it is evaluated over any [`Algebra`]: numbers,
//! intervals, Taylor series, and the nodes of a graph itself.
//!
//! ```
//! use lynkeus_expr::{Graph, Tape, jacobian};
//!
//! let g = Graph::new();
//! let (x, u) = (g.symbol("x"), g.symbol("u"));
//! let f = u - 0.5 * x.sqrt();
//!
//! let tape = Tape::new(&g, &[x.node(), u.node()], &[f.node()])?;
//! let mut out = [0.0];
//! tape.evaluator().eval(&[4.0, 3.0], &mut out);
//! assert_eq!(out, [2.0]);
//!
//! let df = jacobian::forward(&g, &[f.node()], &[x.node()]);
//! let slope = Tape::new(&g, &[x.node()], &[df.get(0, 0).unwrap()])?;
//! slope.evaluator().eval(&[4.0], &mut out);
//! assert_eq!(out, [-0.125]);
//! # Ok::<(), lynkeus_expr::MissingInput>(())
//! ```
#![cfg_attr(test, allow(clippy::unwrap_used))]

mod algebra;
mod budget;
mod code;
mod components;
pub mod flow;
mod fuse;
mod graph;
mod implicit;
pub mod interval;
pub mod jacobian;
mod jet;
pub mod lanes;
mod linear;
pub mod modular;
mod op;
mod partials;
pub mod real;
mod rebuild;
mod render;
mod tape;

pub use algebra::Algebra;
pub use budget::{Budget, Memory, Spent};
pub use code::{Implicit, Tape};
pub use components::components;
pub use graph::{Call, Expr, Graph, Nodes, Solution};
pub use implicit::ImplicitUnknown;
pub use interval::Interval;
pub use jet::{Jet, Jets};
pub use op::{Binary, Fused, Node, Op, Unary};
pub use real::Reals;
pub use rebuild::Hoisted;
pub use tape::{Evaluator, MissingInput};
