//! Tapes of `lynkeus-expr` as machine code.
//!
//! A [`Function`] computes what a [`Tape`](lynkeus_expr::Tape) computes, to the last bit (a NaN is
//! a NaN, whatever its payload): the interpreter is the oracle. There are three shapes, made by one
//! emitter: one number per value ([`Function<1>`]), which is the tape over
//! [`Reals`](lynkeus_expr::Reals), and four or eight numbers side by side in vector registers
//! ([`Function<4>`], [`Function<8>`]), the tape over [`Lanes`](lynkeus_expr::lanes::Lanes), whose
//! elementary functions are written for lanes. [`Function::sweep`] does many groups of lanes with one call.
//!
//! Compiling is one more evaluation of the tape, over the algebra of instructions (`record`);
//! these are put into a better order (`schedule`), values are then placed in registers
//! (`registers`), operation by operation (`emit`), in one pass, and encoded (`assemble`). Only x86-64 with
//! AVX2 and FMA is compiled for, eight lanes with AVX-512, whose registers serve single numbers, too;
//! elsewhere [`Function::compile`] gives none and the interpreter does the work.
//!
//! The engine's only crate with `unsafe`: to call the code that it wrote, and for the instructions
//! of the functions in lanes.
//!
//! ```
//! use lynkeus_expr::{Graph, Tape};
//! use lynkeus_native::Function;
//!
//! let g = Graph::new();
//! let x = g.symbol("x");
//! let tape = Tape::new(&g, &[x.node()], &[(x.sin() * x + 1.0).node()])?;
//! if let Some(mut function) = Function::<1>::compile(&tape) {
//!     let mut y = [[0.0]];
//!     function.eval(&[[0.3]], &mut y);
//!     assert_eq!(y, [[0.3_f64.sin() * 0.3 + 1.0]]);
//! }
//! # Ok::<(), lynkeus_expr::MissingInput>(())
//! ```

mod function;
mod record;

#[cfg(target_arch = "x86_64")]
mod assemble;
#[cfg(target_arch = "x86_64")]
mod emit;
#[cfg(target_arch = "x86_64")]
mod library;
#[cfg(target_arch = "x86_64")]
mod memory;
#[cfg(target_arch = "x86_64")]
mod registers;
#[cfg(target_arch = "x86_64")]
mod schedule;
#[cfg(target_arch = "x86_64")]
mod vectors;

pub use function::{Buffer, Function, widest};
