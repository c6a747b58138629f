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

use lynkeus_expr::{Node, components};

pub(crate) use system::{FlatEquation, System, Unknown};

use crate::diagnostic::{Result, Span};
use matching::Matching;
use system::Incidence;

/// An expression for every unknown, free of unknowns.
pub(crate) fn solve(system: &System<'_>, source: &str, model: Span) -> Result<HashMap<Node, Node>> {
    let incidence = Incidence::new(system);
    let problem = match matched(system, &incidence, source, model) {
        Ok(matching) => return in_order(system, &incidence, &matching, source),
        Err(problem) => problem,
    };
    if system.equations.len() != system.unknowns.len() {
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
    let incidence = Incidence::new(&system);
    let matching = matched(&system, &incidence, source, model)?;
    in_order(&system, &incidence, &matching, source)
}

/// The matching that gives each equation an unknown of its own.
fn matched(
    system: &System<'_>,
    incidence: &Incidence,
    source: &str,
    model: Span,
) -> Result<Matching> {
    let matching = matching::maximum(system, &incidence.of_equation);
    let balance = diagnose::Balance {
        system,
        incidence,
        matching: &matching,
        source,
    };
    balance.check(model)?;
    Ok(matching)
}

/// Solves blocks of equations that need each other, each behind those it needs.
fn in_order(
    system: &System<'_>,
    incidence: &Incidence,
    matching: &Matching,
    source: &str,
) -> Result<HashMap<Node, Node>> {
    // an equation needs those that give its unknowns
    let needs = |unknowns: &Vec<usize>| {
        let given = unknowns.iter().filter_map(|&u| matching.of_unknown[u]);
        given.collect()
    };
    let needs: Vec<Vec<usize>> = incidence.of_equation.iter().map(needs).collect();
    let blocks = components(&needs);
    blocks::Solver::new(system, incidence, source).solve(&blocks, matching)
}
