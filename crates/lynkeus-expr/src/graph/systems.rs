//! Linear systems and implicit functions as nodes.

use std::collections::HashSet;

use super::{Call, Graph, Key, Solution};
use crate::code::System;
use crate::{Implicit, Node, Nodes, Op};

impl Call {
    /// Number of unknowns.
    pub fn size(&self) -> usize {
        match &self.system {
            System::Linear(n) => *n,
            System::Implicit(function) => function.size(),
        }
    }

    /// A row by row and b, where it is the linear system A x = b.
    pub fn linear(&self) -> Option<(&[Node], &[Node])> {
        match self.system {
            System::Linear(n) => Some(self.arguments.split_at(n * n)),
            System::Implicit(_) => None,
        }
    }

    /// z as a function of p, where it is that.
    pub fn function(&self) -> Option<&Implicit> {
        match &self.system {
            System::Linear(_) => None,
            System::Implicit(function) => Some(function),
        }
    }

    /// (z, p): the unknowns, results of the node, and its arguments.
    pub fn at(&self, graph: &Graph, node: Node) -> Vec<Node> {
        let z = (0..self.size() as u32).map(|i| graph.entry(node, i));
        z.chain(self.arguments.iter().copied()).collect()
    }

    /// The slopes of the equations by the unknowns, n×n, row by row.
    pub fn matrix(&self, graph: &Graph, node: Node) -> Vec<Node> {
        match &self.system {
            System::Linear(n) => self.arguments[..n * n].to_vec(),
            System::Implicit(function) => function.matrix(&Nodes(graph), &self.at(graph, node)),
        }
    }

    /// The slopes of the equations by the arguments where they are not zero everywhere: (row,
    /// argument, slope); none stands for −1.
    pub(crate) fn slopes(&self, graph: &Graph, node: Node) -> Vec<(usize, Node, Option<Node>)> {
        match &self.system {
            System::Linear(n) => {
                let (a, b) = self.arguments.split_at(n * n);
                let row = |(i, &b): (usize, &Node)| {
                    let factors = a[i * n..][..*n].iter().zip(0..);
                    let factors = factors.map(move |(&a, j)| (i, a, Some(graph.entry(node, j))));
                    [(i, b, None)].into_iter().chain(factors)
                };
                b.iter().enumerate().flat_map(row).collect()
            }
            System::Implicit(function) => {
                let slopes = function.sensitivities(graph, &self.at(graph, node));
                let slopes = slopes.into_iter();
                slopes
                    .map(|(row, p, slope)| (row, self.arguments[p], Some(slope)))
                    .collect()
            }
        }
    }
}

impl Graph {
    /// The system and its arguments, where the node is an [`Op::System`].
    pub fn system(&self, node: Node) -> Option<Call> {
        let Op::System(index) = self.op(node) else {
            return None;
        };
        self.inner.borrow().systems.get(index as usize).cloned()
    }

    /// The results of a system: its unknowns, of a linear one also the condition estimate.
    pub(crate) fn results(&self, call: Call) -> Vec<Node> {
        let count = call.size() + usize::from(call.function().is_none());
        let inner = &mut *self.inner.borrow_mut();
        let node = match inner.known_systems.get(&call).copied() {
            Some(node) => node,
            None if inner.is_spent() => return vec![inner.nothing(); count],
            None => {
                inner.systems.push(call.clone());
                let node = inner.push(Op::System(inner.systems.len() as u32 - 1));
                inner.known_systems.insert(call, node);
                node
            }
        };
        let entry = |i| inner.intern(Key::Entry(node, i), Op::Entry(node, i));
        (0..count as u32).map(entry).collect()
    }

    /// The solution of A x = b; `a` is n×n row by row, `b` has n entries.
    ///
    /// # Panics
    /// If `a.len() != b.len()²`.
    pub fn solve(&self, a: &[Node], b: &[Node]) -> Solution {
        let n = b.len();
        assert_eq!(a.len(), n * n, "A must be n×n for the n entries of b");
        let call = Call {
            system: System::Linear(n),
            arguments: [a, b].concat(),
        };
        let mut x = self.results(call);
        let rcond = x.remove(n);
        Solution { x, rcond }
    }

    /// The entries of z with g(z, p) = 0.
    ///
    /// # Panics
    /// If `p` has not the function's number of entries.
    pub fn implicit(&self, function: &Implicit, p: &[Node]) -> Vec<Node> {
        assert_eq!(p.len(), function.parameters(), "one node per entry of p");
        let call = Call {
            system: System::Implicit(function.clone()),
            arguments: p.to_vec(),
        };
        self.results(call)
    }

    /// Whether the value of a node may jump where its arguments do not.
    pub fn jumps(&self, node: Node) -> bool {
        match self.op(node) {
            Op::Unary(op, _) => op.jumps(),
            Op::Binary(op, ..) => op.jumps(),
            Op::System(_) => {
                let call = self.system(node);
                call.is_some_and(|call| call.function().is_some_and(Implicit::steps))
            }
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
            let calls = nodes.filter_map(|node| Some((node, self.system(node)?)));
            let is_new =
                |(node, call): &(Node, Call)| call.function().is_some() && seen.insert(*node);
            let calls: Vec<(Node, Call)> = calls.filter(is_new).collect();
            if calls.is_empty() {
                return all;
            }
            for (node, call) in &calls {
                let residual =
                    |function: &Implicit| function.residual(&Nodes(self), &call.at(self, *node));
                all.extend(call.function().into_iter().flat_map(residual));
            }
        }
    }

    /// One result of a system built before.
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
        assert_eq!(system.size(), 2);
        assert_eq!(system.linear(), Some((&[a, b, c, a][..], &[b, c][..])));
        assert_eq!(g.system(x), None);
    }
}
