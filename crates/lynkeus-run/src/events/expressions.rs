//! Clauses as expressions, for code that is printed.

use lynkeus_expr::{Graph, Node, jacobian};

use super::when::{ClauseShape, WhenRoots};
use crate::grid::Grid;

/// The clauses by which a system's state jumps, with their slopes.
#[derive(Clone, Debug)]
pub struct WhenExpressions<'s> {
    /// symbols: those of the system, then the states before the event, then a truth for each timer
    pub inputs: Vec<Node>,
    /// of each clause what it changes, in order of the text
    pub clauses: &'s [ClauseShape],
    /// all of them, clause by clause
    pub conditions: &'s [Node],
    /// of each condition the relations that it is made of
    pub needs: &'s [Vec<usize>],
    /// new values, clause by clause
    pub values: &'s [Node],
    /// ∂value/∂(states, states before, time) where it is not 0: row, column, entry
    pub slopes: Vec<(usize, usize, Node)>,
    /// what is decided as the state moves, over the symbols of the system
    pub relations: &'s [Node],
    /// of each relation what vanishes where it changes, and is positive where it holds
    pub quantities: &'s [Node],
    /// ∂quantity/∂(states, time) where it is not 0: row, column, entry
    pub gradient: Vec<(usize, usize, Node)>,
    /// what is told by time alone
    pub timers: Vec<Instants>,
    /// states that clauses alone change, to values that depend on no other states and not on time
    pub discrete: &'s [usize],
}

/// The instants (first + k·step)/scale of a timer, of which first and step are whole numbers where the
/// model's are decimal ones.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Instants {
    /// in units of 1/scale
    pub first: f64,
    /// in units of 1/scale
    pub step: f64,
    /// 1 where they are no decimal numbers
    pub scale: f64,
    /// there is none but the start of a run
    pub is_initial: bool,
}

impl WhenRoots {
    /// Of a system with these inputs: time and so many states first.
    pub fn expressions(
        &self,
        graph: &Graph,
        inputs: &[Node],
        states: usize,
    ) -> WhenExpressions<'_> {
        let [conditions, values, relations, quantities] = self.parts();
        let own = &inputs[1..=states];
        let slopes = |of: &[Node], by: &[Node]| jacobian::forward(graph, of, by).entries;
        let shape = self.shape();
        let timers = shape.timers.iter().map(|timer| {
            let [first, step, scale] = Grid::new(timer.start, timer.interval).whole();
            Instants {
                first,
                step,
                scale,
                is_initial: timer.is_initial,
            }
        });
        WhenExpressions {
            inputs: [inputs, &self.aside].concat(),
            clauses: &shape.clauses,
            conditions,
            needs: &shape.needs,
            values,
            slopes: slopes(values, &[own, &self.aside[..states], &inputs[..1]].concat()),
            relations,
            quantities,
            gradient: slopes(quantities, &[own, &inputs[..1]].concat()),
            timers: timers.collect(),
            discrete: &shape.discrete,
        }
    }
}
