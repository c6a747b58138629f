//! Replacing symbols, or any nodes, by expressions.

use std::collections::HashMap;

use crate::{Algebra, Graph, Node, Nodes, Op};

impl Graph {
    /// The roots with every node that is a key of `map` replaced by its value
    /// (values are not searched again).
    pub fn substitute(&self, roots: &[Node], map: &HashMap<Node, Node>) -> Vec<Node> {
        let mut new: HashMap<Node, Node> = HashMap::new();
        for node in self.reachable(roots) {
            let image = match map.get(&node) {
                Some(&image) => Some(image),
                None => self.rebuilt(node, &new),
            };
            if let Some(image) = image {
                new.insert(node, image);
            }
        }
        roots.iter().map(|root| new[root]).collect()
    }

    /// The node over the images of its arguments; none for a `Solve` node, which
    /// is rebuilt through its entries.
    fn rebuilt(&self, node: Node, new: &HashMap<Node, Node>) -> Option<Node> {
        let nodes = Nodes(self);
        Some(match self.op(node) {
            Op::Constant(_) | Op::Symbol(_) => node,
            Op::Unary(op, a) => nodes.unary(op, &new[&a]),
            Op::Powi(a, n) => nodes.powi(&new[&a], n),
            Op::Binary(op, a, b) => nodes.binary(op, &new[&a], &new[&b]),
            Op::Select(c, a, b) => nodes.select(&new[&c], &new[&a], &new[&b]),
            Op::Solve(_) => return None,
            Op::Entry(solve, entry) => {
                let arguments = self.arguments(solve);
                let images: Vec<Node> = arguments.iter().map(|a| new[a]).collect();
                let n = (0..).find(|n| n * n + n >= images.len()).unwrap_or(0);
                let (a, b) = images.split_at(n * n);
                let solution = self.solve(a, b);
                *solution.x.get(entry as usize).unwrap_or(&solution.rcond)
            }
        })
    }
}
