//! Linear systems as nodes.

use super::{Graph, Key, Node};
use crate::Op;

/// The linear system A x = b of an [`Op::Solve`] node.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct LinearSystem {
    /// A row by row (n²), then b (n)
    pub(super) arguments: Vec<Node>,
    n: usize,
}

impl LinearSystem {
    /// Number of unknowns n.
    pub fn size(&self) -> usize {
        self.n
    }

    /// A, n×n, row by row.
    pub fn matrix(&self) -> &[Node] {
        &self.arguments[..self.n * self.n]
    }

    /// b, n entries.
    pub fn right(&self) -> &[Node] {
        &self.arguments[self.n * self.n..]
    }
}

/// The result of [`Graph::solve`].
#[derive(Clone, Debug)]
pub struct Solution {
    /// the n components of x with A x = b
    pub x: Vec<Node>,
    /// estimate of 1/cond(A) in [0, 1]; near 0 where A is close to singular and
    /// `x` is the bounded answer of a truncated factorisation. Its derivative
    /// is taken as zero: it is a diagnostic, not part of the solution.
    pub rcond: Node,
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
        let node = match inner.known_systems.get(&system).copied() {
            Some(node) => node,
            None if inner.is_spent() => {
                let nothing = inner.nothing();
                return Solution {
                    x: vec![nothing; n],
                    rcond: nothing,
                };
            }
            None => {
                let index = inner.systems.len() as u32;
                inner.systems.push(system.clone());
                let node = inner.push(Op::Solve(index));
                inner.known_systems.insert(system, node);
                node
            }
        };
        let mut entry = |i: usize| {
            let i = i as u32;
            inner.intern(Key::Entry(node, i), Op::Entry(node, i))
        };
        Solution {
            x: (0..n).map(&mut entry).collect(),
            rcond: entry(n),
        }
    }

    /// One result of a `Solve` node built before.
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
