//! What lies below some nodes.

use super::{Graph, Inner, Node};
use crate::Op;

/// Nodes that were met in a walk: those with the stamp of that walk, so that no walk has to
/// clear what another one left.
#[derive(Clone, Default)]
pub(super) struct Marks {
    walk: u32,
    stamps: Vec<u32>,
}

impl Marks {
    fn begin(&mut self, nodes: usize) {
        self.walk = self.walk.wrapping_add(1);
        if self.walk == 0 {
            self.stamps.clear();
            self.walk = 1;
        }
        if self.stamps.len() < nodes {
            self.stamps.resize(nodes, 0);
        }
    }

    /// Whether the node is met for the first time.
    fn meet(&mut self, node: Node) -> bool {
        let stamp = &mut self.stamps[node.index()];
        let first = *stamp != self.walk;
        *stamp = self.walk;
        first
    }
}

impl Inner {
    /// Hands over the arguments of a node.
    pub(super) fn each_argument(&self, node: Node, mut give: impl FnMut(Node)) {
        match self.ops[node.index()] {
            Op::Constant(_) | Op::Symbol(_) => {}
            Op::Unary(_, a) | Op::Powi(a, _) | Op::Entry(a, _) => give(a),
            Op::Binary(_, a, b) => {
                give(a);
                give(b);
            }
            Op::Select(c, a, b) => {
                give(c);
                give(a);
                give(b);
            }
            Op::Solve(system) => {
                let arguments = &self.systems[system as usize].arguments;
                arguments.iter().copied().for_each(give);
            }
            Op::Implicit(call) => {
                let arguments = &self.implicits[call as usize].arguments;
                arguments.iter().copied().for_each(give);
            }
        }
    }
}

impl Graph {
    /// Every node that the roots need, arguments before their users. The work is that of what
    /// they need, not of the whole graph.
    pub fn reachable(&self, roots: &[Node]) -> Vec<Node> {
        let inner = self.inner.borrow();
        let mut marks = self.marks.borrow_mut();
        marks.begin(inner.ops.len());
        let mut found: Vec<Node> = vec![];
        for &root in roots {
            if marks.meet(root) {
                found.push(root);
            }
        }
        let mut next = 0;
        while let Some(&node) = found.get(next) {
            next += 1;
            inner.each_argument(node, |argument| {
                if marks.meet(argument) {
                    found.push(argument);
                }
            });
        }
        found.sort_unstable();
        found
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn arguments_come_first_and_nothing_else_comes() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let aside = (x * y).cos();
        let solution = g.solve(&[(x + 2.0).node()], &[y.node()]);
        let root = (g.expr(solution.x[0]) * x).sin();
        for _ in 0..3 {
            let found = g.reachable(&[root.node(), x.node()]);
            assert!(found.is_sorted() && found.contains(&y.node()));
            assert!(!found.contains(&aside.node()));
            // x, y, 2, x + 2, the system, its entry, the product, the sine
            assert_eq!(found.len(), 8);
        }
        assert_eq!(g.reachable(&[]), []);
    }
}
