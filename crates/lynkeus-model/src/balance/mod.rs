//! Scalar equations to one expression for every unknown: matching, sorting, solving.
//!
//! The unknowns are the derivatives of the states and all other variables but the inputs. A
//! maximum matching pairs equations with unknowns; what it leaves over is the missing or the
//! surplus equation. The strongly connected components of the matched system are then solved
//! one after the other. They do not depend on which perfect matching was found.

mod blocks;
mod diagnose;
mod incidence;
mod linear;
mod loops;
mod matching;
mod order;
mod singular;

use std::collections::HashMap;

use lynkeus_expr::{Graph, Interval, Node};

use crate::syntax::{Result, Span};
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
}

/// An expression for every unknown, free of unknowns.
pub(crate) fn solve(
    system: &System<'_>,
    inputs: &[Node],
    source: &str,
    model: Span,
) -> Result<HashMap<Node, Node>> {
    let incidence = Incidence::new(system);
    let matching = matching::maximum(system, &incidence.of_equation);
    let matched = diagnose::Balance {
        system,
        incidence: &incidence,
        matching: &matching,
        source,
    };
    matched.check(inputs, model)?;
    let blocks = order::blocks(&incidence.of_equation, &matching);
    blocks::Solver::new(system, &incidence, source).solve(&blocks, &matching)
}
