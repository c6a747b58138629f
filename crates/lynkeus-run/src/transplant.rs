//! A private copy of some expressions, so that a system owns what it needs to
//! name an operation and nothing else can grow under it.

use std::collections::HashMap;

use lynkeus_expr::{Graph, Node, Op};

/// Copies everything below `roots` into `into`; the map gives the images.
pub(crate) fn transplant(from: &Graph, roots: &[Node], into: &Graph) -> HashMap<Node, Node> {
    let mut images: HashMap<Node, Node> = HashMap::new();
    for node in from.reachable(roots) {
        if let Some(image) = image(from, node, into, &images) {
            images.insert(node, image);
        }
    }
    images
}

/// The node over the images of its arguments; none for a linear system, which
/// is rebuilt through its entries.
fn image(from: &Graph, node: Node, into: &Graph, images: &HashMap<Node, Node>) -> Option<Node> {
    Some(match from.op(node) {
        Op::Constant(value) => into.constant(value).node(),
        Op::Symbol(_) => into.symbol(&from.symbol_name(node)?).node(),
        Op::Unary(op, a) => into.unary(op, images[&a]),
        Op::Powi(a, n) => into.powi(images[&a], n),
        Op::Binary(op, a, b) => into.binary(op, images[&a], images[&b]),
        Op::Select(c, a, b) => into.select(images[&c], images[&a], images[&b]),
        Op::Solve(_) => return None,
        Op::Entry(system, entry) => {
            let arguments = from.arguments(system);
            let n = (0..)
                .find(|n| n * (n + 1) >= arguments.len())
                .unwrap_or_default();
            let copied: Vec<Node> = arguments.iter().map(|a| images[a]).collect();
            let (a, b) = copied.split_at(n * n);
            let solution = into.solve(a, b);
            *solution.x.get(entry as usize).unwrap_or(&solution.rcond)
        }
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::Tape;

    #[test]
    fn a_copy_computes_the_same() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let system = [x.exp(), y, y, x + 3.0].map(|e| e.node());
        let solution = g.solve(&system, &[x.node(), y.powi(3).node()]);
        let root = (g.expr(solution.x[1]) + x.less(y).select(x.sin(), y.max(x))).node();
        let copy = Graph::new();
        let image = transplant(&g, &[root, x.node(), y.node()], &copy);
        let value = |graph: &Graph, inputs: [Node; 2], root: Node| {
            let mut out = [0.0];
            let tape = Tape::new(graph, &inputs, &[root]).unwrap();
            tape.evaluator().eval(&[0.3, 0.9], &mut out);
            out[0]
        };
        let copied = value(&copy, [image[&x.node()], image[&y.node()]], image[&root]);
        assert_eq!(copied, value(&g, [x.node(), y.node()], root));
    }
}
