//! Which products of some expressions are rounded together with the sums that read them.

use std::collections::{HashMap, HashSet};

use crate::{Binary, Fused, Graph, Node, Op};

/// Sums with a product in them. What is fused follows from the expressions alone.
#[derive(Default)]
pub(crate) struct Fusion {
    sums: HashMap<Node, (Fused, [Node; 3])>,
    /// products that nothing else reads
    parts: HashSet<Node>,
}

impl Fusion {
    /// Of all products below the outputs that nothing but sums read: each of these sums takes one, the one that
    /// is made of more operations where there are two.
    pub fn new(graph: &Graph, outputs: &[Node]) -> Self {
        let nodes = graph.reachable(outputs);
        let depths = depths(graph, &nodes);
        let mut open = open_products(graph, &nodes, outputs);
        // who does not take a product makes it one that has to be there: others then take theirs
        loop {
            let taken = sums(graph, &nodes, &open, &depths);
            let before = open.len();
            for &sum in &nodes {
                let Some(terms) = terms(graph, sum) else {
                    continue;
                };
                let own = taken.get(&sum).map(|(_, product, _)| *product);
                for term in terms.into_iter().filter(|term| Some(*term) != own) {
                    open.remove(&term);
                }
            }
            if open.len() == before {
                let sums = taken.into_iter().map(|(sum, (op, product, z))| {
                    let [x, y] = open[&product];
                    (sum, (op, [x, y, z]))
                });
                return Self {
                    sums: sums.collect(),
                    parts: open.into_keys().collect(),
                };
            }
        }
    }

    /// The product and the term of a sum, where it has one.
    pub fn sum(&self, node: Node) -> Option<(Fused, [Node; 3])> {
        self.sums.get(&node).copied()
    }

    /// Whether a node is a product that is computed in sums alone.
    pub fn is_part(&self, node: Node) -> bool {
        self.parts.contains(&node)
    }
}

/// Operations on the longest way to each.
fn depths(graph: &Graph, nodes: &[Node]) -> HashMap<Node, usize> {
    let mut depths: HashMap<Node, usize> = HashMap::new();
    for &node in nodes {
        let deepest = graph.arguments(node).iter().map(|a| depths[a] + 1).max();
        depths.insert(node, deepest.unwrap_or(0));
    }
    depths
}

/// The two terms of a sum or a difference.
fn terms(graph: &Graph, node: Node) -> Option<[Node; 2]> {
    match graph.op(node) {
        Op::Binary(Binary::Add | Binary::Sub, x, y) => Some([x, y]),
        _ => None,
    }
}

/// The factors of all products that sums alone read.
fn open_products(graph: &Graph, nodes: &[Node], outputs: &[Node]) -> HashMap<Node, [Node; 2]> {
    let products = nodes.iter().filter_map(|&node| match graph.op(node) {
        Op::Binary(Binary::Mul, x, y) => Some((node, [x, y])),
        Op::Powi(x, 2) => Some((node, [x, x])),
        _ => None,
    });
    let mut open: HashMap<Node, [Node; 2]> = products.collect();
    for output in outputs {
        open.remove(output);
    }
    for &node in nodes.iter().filter(|&&node| terms(graph, node).is_none()) {
        for argument in graph.arguments(node) {
            open.remove(&argument);
        }
    }
    open
}

/// For each sum that reads such a product: how, which one, and the other term.
fn sums(
    graph: &Graph,
    nodes: &[Node],
    open: &HashMap<Node, [Node; 2]>,
    depths: &HashMap<Node, usize>,
) -> HashMap<Node, (Fused, Node, Node)> {
    let mut taken = HashMap::new();
    for &sum in nodes {
        let Some([x, y]) = terms(graph, sum).filter(|[x, y]| x != y) else {
            continue;
        };
        let is_first = match [x, y].map(|term| open.contains_key(&term)) {
            [true, true] => depths[&x] >= depths[&y],
            [first, second] if first || second => first,
            _ => continue,
        };
        let is_difference = matches!(graph.op(sum), Op::Binary(Binary::Sub, ..));
        let (op, product, term) = match (is_first, is_difference) {
            (true, false) => (Fused::Add, x, y),
            (true, true) => (Fused::Sub, x, y),
            (false, false) => (Fused::Add, y, x),
            (false, true) => (Fused::From, y, x),
        };
        taken.insert(sum, (op, product, term));
    }
    taken
}

#[cfg(test)]
mod tests {
    use crate::{Graph, Tape};

    /// Products that are rounded by themselves show what was fused.
    #[test]
    fn a_product_that_only_sums_read_is_part_of_them() {
        let g = Graph::new();
        let [x, y, z] = ["x", "y", "z"].map(|name| g.symbol(name));
        let inputs = [x, y, z].map(|e| e.node());
        let (a, b, c) = (1.0_f64 + 1e-9, 1.0 - 3e-9, -1.0_f64);
        let product = x * y;
        let square = z.powi(2);
        let cases = [
            // (expression, its value, instructions)
            (product + z, a.mul_add(b, c), 1),
            (product - z, a.mul_add(b, -c), 1),
            (z - product, (-a).mul_add(b, c), 1),
            (z + product, a.mul_add(b, c), 1),
            (square - x, c.mul_add(c, -a), 1),
            // read by something else, too
            ((product + z) * product, (a * b + c) * (a * b), 3),
            // read by two sums
            (
                (product + z) * (product - x),
                a.mul_add(b, c) * a.mul_add(b, -a),
                3,
            ),
            // of two products the one that is made of more
            (x * z + (x + z) * y, (a + c).mul_add(b, a * c), 3),
            (product + product, a * b + a * b, 2),
        ];
        for (expression, expected, instructions) in cases {
            let tape = Tape::fused(&g, &inputs, &[expression.node()]).unwrap();
            let mut found = [0.0];
            tape.evaluator().eval(&[a, b, c], &mut found);
            assert_eq!(
                (found[0], tape.len()),
                (expected, instructions),
                "{expression:?}"
            );
        }
    }

    /// One that a sum has beside a deeper one has to be there; the others that read it take it no more.
    #[test]
    fn a_product_that_has_to_be_there_is_in_no_sum() {
        let g = Graph::new();
        let [x, y, z] = ["x", "y", "z"].map(|name| g.symbol(name));
        let inputs = [x, y, z].map(|e| e.node());
        let shared = x * y;
        let outputs = [shared + (x + z) * z, shared + z].map(|e| e.node());
        let tape = Tape::fused(&g, &inputs, &outputs).unwrap();
        let (a, b, c) = (1.0_f64 + 1e-9, 1.0 - 3e-9, -1.0_f64);
        let mut found = [0.0; 2];
        tape.evaluator().eval(&[a, b, c], &mut found);
        assert_eq!(found, [(a + c).mul_add(c, a * b), a * b + c]);
        // the product, x + z, a sum with the other product, a sum
        assert_eq!(tape.len(), 4);
        // an output is rounded
        let tape = Tape::fused(&g, &inputs, &[(shared + z).node(), shared.node()]).unwrap();
        tape.evaluator().eval(&[a, b, c], &mut found);
        assert_eq!(found, [a * b + c, a * b]);
    }
}
