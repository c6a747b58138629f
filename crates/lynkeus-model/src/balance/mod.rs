//! Scalar equations to one expression for every unknown: matching, sorting, solving.
//!
//! The unknowns are the derivatives of the states and all other variables but the inputs. A
//! maximum matching pairs equations with unknowns; what it leaves over is the missing or the
//! surplus equation. The strongly connected components of the matched system are then solved
//! one after the other. They do not depend on which perfect matching was found.

mod blocks;
mod diagnose;
mod linear;
mod loops;
mod matching;
mod reduce;
mod system;

use std::collections::HashMap;

use lynkeus_expr::Node;

pub(crate) use reduce::total_derivative;
pub(crate) use system::{FlatEquation, System, Unknown};

use crate::diagnostic::{Result, Span};

/// An expression for every unknown, free of unknowns.
pub(crate) fn solve(mut system: System<'_>, model: Span) -> Result<HashMap<Node, Node>> {
    if let Err(problem) = system.check_balance(model) {
        if system.equations.len() != system.unknowns.len() {
            return Err(problem);
        }
        // As many equations as unknowns, but some say only how states hang together.
        system = reduce::reduced(system)?.ok_or(problem)?;
        system.check_balance(model)?;
    }
    blocks::solve(&system)
}
