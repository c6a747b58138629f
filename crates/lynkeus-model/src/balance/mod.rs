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
mod order;
mod reduce;
mod system;

use std::collections::HashMap;

use lynkeus_expr::Node;

pub(crate) use system::{FlatEquation, System, Unknown};

use crate::diagnostic::{Problem, Result, Span};
use system::Incidence;

/// An expression for every unknown, free of unknowns.
pub(crate) fn solve(system: &System<'_>, source: &str, model: Span) -> Result<HashMap<Node, Node>> {
    let found = solved(system, source, model);
    let is_balanced = system.equations.len() == system.unknowns.len();
    let Err(Unsolved {
        problem,
        is_singular: true,
    }) = found
    else {
        return found.map_err(|unsolved| unsolved.problem);
    };
    if !is_balanced {
        return Err(problem);
    }
    // As many equations as unknowns, but some say only how states hang together.
    let Some(reduced) = reduce::reduced(system)? else {
        return Err(problem);
    };
    let system = System {
        equations: &reduced.equations,
        unknowns: &reduced.unknowns,
        ..*system
    };
    solved(&system, source, model).map_err(|unsolved| unsolved.problem)
}

struct Unsolved {
    problem: Problem,
    /// some equation has no unknown of its own
    is_singular: bool,
}

fn solved(
    system: &System<'_>,
    source: &str,
    model: Span,
) -> std::result::Result<HashMap<Node, Node>, Unsolved> {
    let incidence = Incidence::new(system);
    let matching = matching::maximum(system, &incidence.of_equation);
    let matched = diagnose::Balance {
        system,
        incidence: &incidence,
        matching: &matching,
        source,
    };
    let unsolved = |is_singular| {
        move |problem| Unsolved {
            problem,
            is_singular,
        }
    };
    matched.check(model).map_err(unsolved(true))?;
    let blocks = order::blocks(&incidence.of_equation, &matching);
    let solver = blocks::Solver::new(system, &incidence, source);
    solver.solve(&blocks, &matching).map_err(unsolved(false))
}
