//! Equations of a block as sparse linear rows.

use std::collections::{BTreeMap, HashMap, HashSet};

use lynkeus_expr::{Binary, Graph, Node, Op, Unary};

use super::incidence::arguments;
use super::linear::Linear;
use crate::syntax::{Result, Span};

/// Σ coefficient · unknown + rest = 0.
#[derive(Clone, Debug, Default)]
pub(super) struct Row {
    /// by place of the unknown in the block
    pub coefficients: BTreeMap<usize, Node>,
    pub rest: Option<Node>,
}

impl Row {
    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.coefficients.len()
    }
}

/// Takes residuals apart.
pub(super) struct Rows<'a> {
    pub linear: Linear<'a>,
    /// places of the unknowns of the block
    pub place: HashMap<Node, usize>,
}

impl Rows<'_> {
    /// The row of a residual, in one walk from the root to the unknowns: every node passes its
    /// factor on. None where it is not linear.
    pub(super) fn row(&self, residual: Node, span: Span) -> Result<Option<Row>> {
        let graph = self.linear.graph;
        let below = self.linear.below(residual, span)?;
        let mut holds: HashSet<Node> = HashSet::new();
        for &node in &below {
            let below = arguments(graph.op(node)).any(|argument| holds.contains(&argument));
            if below || self.place.contains_key(&node) {
                holds.insert(node);
            }
        }
        let mut walk = Walk {
            graph,
            holds,
            passed: HashMap::new(),
            row: Row::default(),
        };
        walk.pass(residual, Passed::whole(graph));
        for &node in below.iter().rev() {
            let Some(passed) = walk.passed.remove(&node) else {
                continue;
            };
            match self.place.get(&node) {
                Some(&place) => {
                    let coefficient = passed.guarded(graph, passed.factor);
                    walk.row.coefficients.insert(place, coefficient);
                }
                None => {
                    if !walk.through(node, passed) {
                        return Ok(None);
                    }
                }
            }
        }
        let is_zero = |factor: &Node| graph.constant_value(*factor) == Some(0.0);
        walk.row.coefficients.retain(|_, factor| !is_zero(factor));
        Ok(Some(walk.row))
    }
}

/// What a node is multiplied with, and the condition under which it counts: what stands in a
/// branch may have no value where the branch is not taken.
#[derive(Clone, Copy)]
struct Passed {
    factor: Node,
    guard: Option<Node>,
}

impl Passed {
    fn whole(graph: &Graph) -> Self {
        Self {
            factor: graph.constant(1.0).node(),
            guard: None,
        }
    }

    fn with_factor(self, factor: Node) -> Self {
        Self { factor, ..self }
    }

    fn under(self, graph: &Graph, condition: Node) -> Self {
        let guard = match self.guard {
            Some(guard) => graph.binary(Binary::And, guard, condition),
            None => condition,
        };
        Self {
            guard: Some(guard),
            ..self
        }
    }

    /// The value where it counts, else 0.
    fn guarded(self, graph: &Graph, value: Node) -> Node {
        match self.guard {
            Some(guard) => graph.select(guard, value, graph.constant(0.0).node()),
            None => value,
        }
    }

    /// Both factors of one node, which counts where either does.
    fn plus(self, graph: &Graph, other: Self) -> Self {
        let (one, two) = match (self.guard, other.guard) {
            (Some(one), Some(two)) => (one, two),
            (None, None) => {
                return self.with_factor(graph.binary(Binary::Add, self.factor, other.factor));
            }
            _ => {
                let (one, two) = (
                    self.guarded(graph, self.factor),
                    other.guarded(graph, other.factor),
                );
                return Self {
                    factor: graph.binary(Binary::Add, one, two),
                    guard: None,
                };
            }
        };
        if graph.unary(Unary::Not, one) == two {
            return Self {
                factor: graph.select(one, self.factor, other.factor),
                guard: None,
            };
        }
        let (a, b) = (
            self.guarded(graph, self.factor),
            other.guarded(graph, other.factor),
        );
        Self {
            factor: graph.binary(Binary::Add, a, b),
            guard: Some(graph.binary(Binary::Or, one, two)),
        }
    }
}

struct Walk<'g> {
    graph: &'g Graph,
    /// nodes that contain an unknown of the block
    holds: HashSet<Node>,
    passed: HashMap<Node, Passed>,
    row: Row,
}

impl Walk<'_> {
    fn pass(&mut self, node: Node, passed: Passed) {
        if !self.holds.contains(&node) {
            return self.add_rest(node, passed);
        }
        let sum = match self.passed.get(&node) {
            Some(before) => before.plus(self.graph, passed),
            None => passed,
        };
        self.passed.insert(node, sum);
    }

    fn add_rest(&mut self, node: Node, passed: Passed) {
        let graph = self.graph;
        let factor = graph.constant_value(passed.factor);
        if graph.constant_value(node) == Some(0.0) || factor == Some(0.0) {
            return;
        }
        let negative = factor == Some(-1.0);
        let term = match factor {
            Some(1.0) | Some(-1.0) => node,
            _ => graph.binary(Binary::Mul, passed.factor, node),
        };
        let term = passed.guarded(graph, term);
        self.row.rest = Some(match (self.row.rest, negative) {
            (Some(rest), false) => graph.binary(Binary::Add, rest, term),
            (Some(rest), true) => graph.binary(Binary::Sub, rest, term),
            (None, false) => term,
            (None, true) => graph.unary(Unary::Neg, term),
        });
    }

    /// Passes the factor of an operation on to its arguments; false where it is not linear.
    fn through(&mut self, node: Node, passed: Passed) -> bool {
        let graph = self.graph;
        let free = |node: Node| !self.holds.contains(&node);
        let negative = || passed.with_factor(graph.unary(Unary::Neg, passed.factor));
        let times = |operation: Binary, by: Node| {
            passed.with_factor(graph.binary(operation, passed.factor, by))
        };
        match graph.op(node) {
            Op::Unary(Unary::Neg, a) => self.pass(a, negative()),
            Op::Binary(Binary::Add, a, b) => {
                self.pass(a, passed);
                self.pass(b, passed);
            }
            Op::Binary(Binary::Sub, a, b) => {
                self.pass(a, passed);
                self.pass(b, negative());
            }
            Op::Binary(Binary::Mul, a, b) if free(b) => self.pass(a, times(Binary::Mul, b)),
            Op::Binary(Binary::Mul, a, b) if free(a) => self.pass(b, times(Binary::Mul, a)),
            Op::Binary(Binary::Div, a, b) if free(b) => self.pass(a, times(Binary::Div, b)),
            Op::Select(c, a, b) if free(c) => {
                self.pass(a, passed.under(graph, c));
                self.pass(b, passed.under(graph, graph.unary(Unary::Not, c)));
            }
            _ => return false,
        }
        true
    }
}
