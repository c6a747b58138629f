//! Linear systems and implicit functions as nodes.

use std::collections::HashSet;

use super::{Graph, ImplicitCall, Inner, Key, LinearSystem, Solution};
use crate::{Implicit, Node, Nodes, Op};

impl ImplicitCall {
    /// (z, p): the results of the node and its arguments.
    pub fn at(&self, graph: &Graph, node: Node) -> Vec<Node> {
        let z = (0..self.function.size() as u32).map(|i| graph.entry(node, i));
        z.chain(self.arguments.iter().copied()).collect()
    }
}

impl Inner {
    /// The node of a system, made by `make` where it is new; none where the budget is spent.
    fn system_node(
        &mut self,
        known: Option<Node>,
        make: impl FnOnce(&mut Self) -> Op,
    ) -> Option<Node> {
        if known.is_some() || self.is_spent() {
            return known;
        }
        let op = make(self);
        Some(self.push(op))
    }
}

impl Graph {
    /// The linear system, where the node is an [`Op::Solve`].
    pub fn system(&self, node: Node) -> Option<LinearSystem> {
        let Op::Solve(index) = self.op(node) else {
            return None;
        };
        self.inner.borrow().systems.get(index as usize).cloned()
    }

    /// The solution of A x = b; `a` is n×n row by row, `b` has n entries.
    ///
    /// # Panics
    /// If `a.len() != b.len()²`.
    pub fn solve(&self, a: &[Node], b: &[Node]) -> Solution {
        let n = b.len();
        assert_eq!(a.len(), n * n, "A must be n×n for the n entries of b");
        let system = LinearSystem {
            arguments: a.iter().chain(b).copied().collect(),
            n,
        };
        let mut inner = self.inner.borrow_mut();
        let known = inner.known_systems.get(&system).copied();
        let node = inner.system_node(known, |inner| {
            inner.systems.push(system.clone());
            Op::Solve(inner.systems.len() as u32 - 1)
        });
        let Some(node) = node else {
            let nothing = inner.nothing();
            return Solution {
                x: vec![nothing; n],
                rcond: nothing,
            };
        };
        inner.known_systems.insert(system, node);
        let mut entry = |i: usize| {
            let i = i as u32;
            inner.intern(Key::Entry(node, i), Op::Entry(node, i))
        };
        Solution {
            x: (0..n).map(&mut entry).collect(),
            rcond: entry(n),
        }
    }

    /// The implicit function and its arguments, where the node is an [`Op::Implicit`].
    pub fn implicit_call(&self, node: Node) -> Option<ImplicitCall> {
        let Op::Implicit(index) = self.op(node) else {
            return None;
        };
        self.inner.borrow().implicits.get(index as usize).cloned()
    }

    /// The entries of z with g(z, p) = 0.
    ///
    /// # Panics
    /// If `p` has not the function's number of entries.
    pub fn implicit(&self, function: &Implicit, p: &[Node]) -> Vec<Node> {
        assert_eq!(p.len(), function.parameters(), "one node per entry of p");
        let call = ImplicitCall {
            function: function.clone(),
            arguments: p.to_vec(),
        };
        let mut inner = self.inner.borrow_mut();
        let known = inner.known_implicits.get(&call).copied();
        let node = inner.system_node(known, |inner| {
            inner.implicits.push(call.clone());
            Op::Implicit(inner.implicits.len() as u32 - 1)
        });
        let Some(node) = node else {
            return vec![inner.nothing(); function.size()];
        };
        inner.known_implicits.insert(call, node);
        let entries = (0..function.size() as u32)
            .map(|i| inner.intern(Key::Entry(node, i), Op::Entry(node, i)));
        entries.collect()
    }

    /// Whether the value of a node may jump where its arguments do not.
    pub fn jumps(&self, node: Node) -> bool {
        match self.op(node) {
            Op::Unary(op, _) => op.jumps(),
            Op::Binary(op, ..) => op.jumps(),
            Op::Implicit(_) => self
                .implicit_call(node)
                .is_some_and(|call| call.function.steps()),
            _ => false,
        }
    }

    /// The roots, and of every implicit function below them what it makes zero, there: what
    /// happens inside is then seen among the nodes.
    pub fn with_residuals(&self, roots: &[Node]) -> Vec<Node> {
        let (mut all, mut seen) = (roots.to_vec(), HashSet::new());
        loop {
            let nodes = self.reachable(&all).into_iter();
            // a loop within a loop may be a node that was made before those seen so far
            let calls = nodes.filter_map(|node| Some((node, self.implicit_call(node)?)));
            let calls: Vec<(Node, ImplicitCall)> =
                calls.filter(|(node, _)| seen.insert(*node)).collect();
            if calls.is_empty() {
                return all;
            }
            for (node, call) in calls {
                let at = call.at(self, node);
                all.extend(call.function.residual(&Nodes(self), &at));
            }
        }
    }

    /// One result of a `Solve` or an `Implicit` node built before.
    pub(crate) fn entry(&self, solve: Node, i: u32) -> Node {
        self.inner
            .borrow_mut()
            .intern(Key::Entry(solve, i), Op::Entry(solve, i))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_system_tells_its_matrix() {
        let g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name).node());
        let x = g.solve(&[a, b, c, a], &[b, c]).x[0];
        let Op::Entry(solve, 0) = g.op(x) else {
            panic!()
        };
        let system = g.system(solve).unwrap();
        assert_eq!((system.size(), system.right()), (2, &[b, c][..]));
        assert_eq!(system.matrix(), [a, b, c, a]);
        assert_eq!(g.system(x), None);
    }
}
