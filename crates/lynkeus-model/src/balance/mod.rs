//! Scalar equations to one expression for every unknown: matching, sorting, solving.
//!
//! The unknowns are the derivatives of the states and all other variables but the inputs. A
//! maximum matching pairs equations with unknowns; what it leaves over is the missing or the
//! surplus equation. The strongly connected components of the matched system are then solved
//! one after the other. They do not depend on which perfect matching was found.

mod blocks;
mod diagnose;
mod eliminate;
mod incidence;
mod linear;
mod loops;
mod matching;
mod reduce;
mod rows;
mod singular;

use std::collections::HashMap;

use lynkeus_expr::{Graph, Interval, Node, components};

use crate::syntax::{Problem, Result, Span};
use incidence::Incidence;

/// An equation between two expressions.
#[derive(Clone, Debug)]
pub(crate) struct FlatEquation {
    pub left: Node,
    pub right: Node,
    pub span: Span,
    /// which element of an array equation this is, as `[2]`
    pub element: Option<String>,
}

/// Something that the equations must determine.
#[derive(Clone, Debug)]
pub(crate) struct Unknown {
    pub symbol: Node,
    /// name of the variable; of the state, where the unknown is its derivative
    pub name: String,
    /// where the variable is declared
    pub span: Span,
    /// the state, where the unknown is its derivative
    pub state: Option<Node>,
    /// how much it is wanted as a state, where there is a choice
    pub rank: i32,
    /// where the search begins, if its equation has to be solved by one
    pub start: f64,
    /// where it may lie
    pub range: Interval,
}

impl Unknown {
    /// Whether something is known of where its value lies.
    fn is_declared(&self) -> bool {
        self.start != 0.0 || self.range.lo().is_finite() || self.range.hi().is_finite()
    }

    /// `` `x` `` or `` `der(x)` ``
    fn quoted(&self) -> String {
        match self.state {
            Some(_) => format!("`der({})`", self.name),
            None => format!("`{}`", self.name),
        }
    }
}

/// `` `a`, `b`, … ``
fn listed<'a>(unknowns: impl Iterator<Item = &'a Unknown>) -> String {
    let mut names: Vec<String> = unknowns.take(9).map(Unknown::quoted).collect();
    let more = if names.len() > 8 { ", …" } else { "" };
    names.truncate(8);
    format!("{}{more}", names.join(", "))
}

/// The equations and what they must determine.
pub(crate) struct System<'a> {
    pub graph: &'a Graph,
    pub equations: &'a [FlatEquation],
    pub unknowns: &'a [Unknown],
    pub inputs: &'a [Node],
    pub time: Node,
}

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
    // an equation needs those that give its unknowns
    let needs = |unknowns: &Vec<usize>| {
        let given = unknowns.iter().filter_map(|&u| matching.of_unknown[u]);
        given.collect()
    };
    let needs: Vec<Vec<usize>> = incidence.of_equation.iter().map(needs).collect();
    let blocks = components(&needs);
    let solver = blocks::Solver::new(system, &incidence, source);
    solver.solve(&blocks, &matching).map_err(unsolved(false))
}
