//! Equations of a block as sparse linear rows, with what is not linear apart.

use std::collections::{BTreeMap, BTreeSet, HashMap, HashSet};

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
    /// unknowns that stand in `rest`, where it is not linear in them
    pub nonlinear: BTreeSet<usize>,
}

impl Row {
    /// Number of unknowns.
    pub(super) fn len(&self) -> usize {
        self.coefficients.len() + self.nonlinear.len()
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
    /// factor on.
    pub(super) fn row(&self, residual: Node, span: Span) -> Result<Row> {
        let graph = self.linear.graph;
        let below = self.linear.below(residual, span)?;
        let mut holds: HashSet<Node> = HashSet::new();
        for &node in &below {
            let below = arguments(graph.op(node)).any(|argument| holds.contains(&argument));
            if below || self.place.contains_key(&node) {
                holds.insert(node);
            }
        }
        let one = graph.constant(1.0).node();
        let mut walk = Walk {
            graph,
            holds,
            factors: HashMap::new(),
            row: Row::default(),
        };
        walk.pass(residual, one);
        for &node in below.iter().rev() {
            let Some(factor) = walk.factors.remove(&node) else {
                continue;
            };
            match self.place.get(&node) {
                Some(&place) => {
                    walk.row.coefficients.insert(place, factor);
                }
                None => {
                    if !walk.through(node, factor) {
                        walk.add_rest(node, factor);
                        self.collect(node, &walk.holds, &mut walk.row.nonlinear);
                    }
                }
            }
        }
        let is_zero = |factor: &Node| graph.constant_value(*factor) == Some(0.0);
        walk.row.coefficients.retain(|_, factor| !is_zero(factor));
        Ok(walk.row)
    }

    /// Places of the unknowns in an expression.
    fn collect(&self, root: Node, holds: &HashSet<Node>, into: &mut BTreeSet<usize>) {
        let mut seen: HashSet<Node> = HashSet::new();
        let mut stack = vec![root];
        while let Some(node) = stack.pop() {
            if !holds.contains(&node) || !seen.insert(node) {
                continue;
            }
            into.extend(self.place.get(&node));
            stack.extend(arguments(self.linear.graph.op(node)));
        }
    }
}

struct Walk<'g> {
    graph: &'g Graph,
    /// nodes that contain an unknown of the block
    holds: HashSet<Node>,
    factors: HashMap<Node, Node>,
    row: Row,
}

impl Walk<'_> {
    fn pass(&mut self, node: Node, factor: Node) {
        if !self.holds.contains(&node) {
            return self.add_rest(node, factor);
        }
        let sum = match self.factors.get(&node) {
            Some(&before) => self.graph.binary(Binary::Add, before, factor),
            None => factor,
        };
        self.factors.insert(node, sum);
    }

    fn add_rest(&mut self, node: Node, factor: Node) {
        let graph = self.graph;
        if graph.constant_value(node) == Some(0.0) || graph.constant_value(factor) == Some(0.0) {
            return;
        }
        let negative = graph.constant_value(factor) == Some(-1.0);
        let term = match graph.constant_value(factor) {
            Some(1.0) | Some(-1.0) => node,
            _ => graph.binary(Binary::Mul, factor, node),
        };
        self.row.rest = Some(match (self.row.rest, negative) {
            (Some(rest), false) => graph.binary(Binary::Add, rest, term),
            (Some(rest), true) => graph.binary(Binary::Sub, rest, term),
            (None, false) => term,
            (None, true) => graph.unary(Unary::Neg, term),
        });
    }

    /// Passes the factor of an operation on to its arguments; false where it is not linear.
    fn through(&mut self, node: Node, factor: Node) -> bool {
        let graph = self.graph;
        let free = |node: Node| !self.holds.contains(&node);
        match graph.op(node) {
            Op::Unary(Unary::Neg, a) => self.pass(a, graph.unary(Unary::Neg, factor)),
            Op::Binary(Binary::Add, a, b) => {
                self.pass(a, factor);
                self.pass(b, factor);
            }
            Op::Binary(Binary::Sub, a, b) => {
                self.pass(a, factor);
                self.pass(b, graph.unary(Unary::Neg, factor));
            }
            Op::Binary(Binary::Mul, a, b) if free(b) => {
                self.pass(a, graph.binary(Binary::Mul, factor, b));
            }
            Op::Binary(Binary::Mul, a, b) if free(a) => {
                self.pass(b, graph.binary(Binary::Mul, factor, a));
            }
            Op::Binary(Binary::Div, a, b) if free(b) => {
                self.pass(a, graph.binary(Binary::Div, factor, b));
            }
            Op::Select(c, a, b) if free(c) => {
                let zero = graph.constant(0.0).node();
                self.pass(a, graph.select(c, factor, zero));
                self.pass(b, graph.select(c, zero, factor));
            }
            _ => return false,
        }
        true
    }
}
