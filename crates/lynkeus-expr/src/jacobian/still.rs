//! Along which directions nothing moves.

use std::collections::{BTreeSet, HashMap};

use crate::partials::Variation;
use crate::{Binary, Graph, Node, Unary};

/// When each node stays what it is along a direction, whatever its slopes: where the direction has
/// no part in anything that the node depends on there. (That a product with a slope is 0 is not
/// enough: √(x²) has no derivative at 0, although that of x² is 0.)
pub(super) struct Still<'g> {
    graph: &'g Graph,
    /// by node, what has to hold; nodes that are left out never move
    conditions: HashMap<Node, BTreeSet<Node>>,
}

impl<'g> Still<'g> {
    /// Inputs are still where their entry of the direction is 0.
    pub fn of(graph: &'g Graph, inputs: &[Node], direction: &[Node]) -> Self {
        let zero = graph.constant(0.0).node();
        let is_zero = |part: Node| BTreeSet::from([graph.binary(Binary::Equal, part, zero)]);
        let pairs = inputs.iter().zip(direction);
        Self {
            graph,
            conditions: pairs
                .map(|(input, part)| (*input, is_zero(*part)))
                .collect(),
        }
    }

    /// The next node, after its arguments. An input stays one, also where it is an expression.
    pub fn visit(&mut self, node: Node, variation: &Variation) {
        let conditions = match variation {
            Variation::Sum(terms) => self.all(terms.iter().map(|(argument, _)| argument)),
            Variation::Choice(condition, a, b) => self.chosen(*condition, *a, *b),
            Variation::Entry { system, .. } => self.all(&self.graph.arguments(*system)),
        };
        if !conditions.is_empty() {
            self.conditions.entry(node).or_insert(conditions);
        }
    }

    /// 1 where the node is still; none where it always is.
    pub fn condition(&self, node: Node) -> Option<Node> {
        let conditions = self.conditions.get(&node)?.iter().copied();
        conditions.reduce(|a, b| self.graph.binary(Binary::And, a, b))
    }

    fn all<'n>(&self, nodes: impl IntoIterator<Item = &'n Node>) -> BTreeSet<Node> {
        let conditions = nodes
            .into_iter()
            .filter_map(|node| self.conditions.get(node));
        conditions.flatten().copied().collect()
    }

    /// Of a branch that is not taken nothing is asked.
    fn chosen(&self, condition: Node, a: Node, b: Node) -> BTreeSet<Node> {
        if self.conditions.get(&a) == self.conditions.get(&b) {
            return self.all([&a]);
        }
        let and = |x, y| self.graph.binary(Binary::And, x, y);
        let not = || self.graph.unary(Unary::Not, condition);
        let (first, second) = match (self.condition(a), self.condition(b)) {
            (Some(a), Some(b)) => (and(condition, a), and(not(), b)),
            (Some(a), None) => (not(), a),
            (None, Some(b)) => (condition, b),
            (None, None) => return BTreeSet::new(),
        };
        BTreeSet::from([self.graph.binary(Binary::Or, first, second)])
    }
}
