//! Nodes built again over other arguments: substitution, copies in another graph, and what depends
//! on some symbols alone, taken out.

use std::collections::{HashMap, HashSet};

use crate::{Graph, Node, Op};

impl Graph {
    /// The roots with every node that is a key of `map` replaced by its value
    /// (values are not searched again).
    pub fn substitute(&self, roots: &[Node], map: &HashMap<Node, Node>) -> Vec<Node> {
        let mut new: HashMap<Node, Node> = HashMap::new();
        for node in self.reachable(roots) {
            let image = match map.get(&node) {
                Some(&image) => Some(image),
                None => self.rebuilt(self, node, |argument| new[&argument]),
            };
            if let Some(image) = image {
                new.insert(node, image);
            }
        }
        roots.iter().map(|root| new[root]).collect()
    }

    /// Copies everything below `roots` of another graph into this one, symbols by their
    /// names, fresh ones as fresh ones; the images of all nodes but linear systems.
    pub fn copied(&self, from: &Graph, roots: &[Node]) -> HashMap<Node, Node> {
        let mut images: HashMap<Node, Node> = HashMap::new();
        for node in from.reachable(roots) {
            if let Some(image) = self.rebuilt(from, node, |argument| images[&argument]) {
                images.insert(node, image);
            }
        }
        images
    }

    /// A node of `from` (this graph, or another) over the images of its arguments, in this
    /// graph. None for a [system](Op::is_system), which has no value: the images of its
    /// arguments are asked for where an [`Op::Entry`] of it is rebuilt.
    pub fn rebuilt(&self, from: &Graph, node: Node, image: impl Fn(Node) -> Node) -> Option<Node> {
        Some(match from.op(node) {
            Op::Constant(_) | Op::Symbol(_) if std::ptr::eq(self, from) => node,
            Op::Constant(value) => self.constant(value).node(),
            Op::Symbol(_) => {
                let name = from.symbol_name(node)?;
                match from.is_named(node) {
                    true => self.symbol(&name).node(),
                    false => self.fresh(name).node(),
                }
            }
            Op::Unary(op, a) => self.unary(op, image(a)),
            Op::Powi(a, n) => self.powi(image(a), n),
            Op::Binary(op, a, b) => self.binary(op, image(a), image(b)),
            Op::Select(c, a, b) => self.select(image(c), image(a), image(b)),
            Op::System(_) => return None,
            Op::Entry(system, entry) => {
                let mut call = from.system(system)?;
                call.arguments = call.arguments.iter().map(|&n| image(n)).collect();
                return self.results(call).get(entry as usize).copied();
            }
        })
    }
}

/// Expressions that read values made elsewhere in place of some symbols.
#[derive(Clone, Debug, PartialEq)]
pub struct Hoisted {
    /// the expressions, in the order in which they were given
    pub roots: Vec<Node>,
    /// what they read instead, each made of the symbols alone
    pub parts: Vec<HoistedPart>,
}

/// A value made elsewhere.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct HoistedPart {
    /// the [fresh](Graph::fresh) symbol that stands for it
    pub symbol: Node,
    /// what it is
    pub value: Node,
}

/// Characters of the value that a fresh symbol is named after.
const SHOWN: usize = 60;

impl Graph {
    /// Takes out of the roots every expression that depends on some of the `symbols` and on nothing
    /// else, as large as it can be, so that it is computed once where it would be again and again.
    pub fn hoisted(&self, roots: &[Node], symbols: &[Node]) -> Hoisted {
        let mut values = self.largest(roots, |symbol| symbols.contains(symbol));
        values.sort_unstable();
        self.replaced(roots, values)
    }

    /// The expressions below the roots that read symbols, all of them own ones, as large as they
    /// can be, in the order in which the roots need them.
    pub(crate) fn largest(&self, roots: &[Node], is_own: impl Fn(&Node) -> bool) -> Vec<Node> {
        // whether others are read; none where no symbol is
        let mut reads: HashMap<Node, Option<bool>> = HashMap::new();
        let (mut found, mut seen) = (vec![], HashSet::new());
        for node in self.reachable(roots) {
            let arguments = self.arguments(node);
            let own = match self.op(node) {
                Op::Symbol(_) => Some(!is_own(&node)),
                _ => arguments.iter().filter_map(|a| reads[a]).max(),
            };
            if own == Some(true) {
                let largest = arguments.into_iter().filter(|a| reads[a] == Some(false));
                found.extend(largest.filter(|&a| seen.insert(a)));
            }
            reads.insert(node, own);
        }
        let whole = roots.iter().filter(|root| reads[root] == Some(false));
        found.extend(whole.filter(|root| seen.insert(**root)));
        found
    }

    /// The roots with a fresh symbol for each of the values.
    pub(crate) fn replaced(&self, roots: &[Node], values: Vec<Node>) -> Hoisted {
        let part = |value: Node| HoistedPart {
            symbol: self.fresh(self.render(value, SHOWN)).node(),
            value,
        };
        let parts: Vec<HoistedPart> = values.into_iter().map(part).collect();
        let images = parts.iter().map(|part| (part.value, part.symbol)).collect();
        Hoisted {
            roots: self.substitute(roots, &images),
            parts,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::Tape;

    #[test]
    fn a_copy_computes_the_same() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let system = [x.exp(), y, y, x + 3.0].map(|e| e.node());
        let solution = g.solve(&system, &[x.node(), y.powi(3).node()]);
        let root = (g.expr(solution.x[1]) + x.less(y).select(x.sin(), y.max(x))).node();
        let copy = Graph::new();
        let image = copy.copied(&g, &[root, x.node(), y.node()]);
        let value = |graph: &Graph, inputs: [Node; 2], root: Node| {
            let mut out = [0.0];
            let tape = Tape::new(graph, &inputs, &[root]).unwrap();
            tape.evaluator().eval(&[0.3, 0.9], &mut out);
            out[0]
        };
        let copied = value(&copy, [image[&x.node()], image[&y.node()]], image[&root]);
        assert_eq!(copied, value(&g, [x.node(), y.node()], root));
    }

    #[test]
    fn no_name_finds_a_fresh_symbol() {
        let g = Graph::new();
        let before = g.symbol("estimate of a");
        let [first, second] = [g.fresh("estimate of a"), g.fresh("estimate of a")];
        assert_ne!(first.node(), second.node());
        assert_eq!(g.symbol("estimate of a").node(), before.node());
        assert_eq!(g.render((first * 2.0).node(), 40), "estimate of a*2");
        // not in another graph either
        let other = Graph::new();
        let sum = ((before + first) * second).node();
        let copies = other.copied(&g, &[sum]);
        assert_eq!(other.symbols_of(&[copies[&sum]]).len(), 3);
        assert_eq!(copies[&before.node()], other.symbol("estimate of a").node());
        assert_ne!(copies[&first.node()], copies[&before.node()]);
    }

    #[test]
    fn only_what_depends_on_the_symbols_alone_is_taken_out_and_whole() {
        let g = Graph::new();
        let [a, b, x] = ["a", "b", "x"].map(|name| g.symbol(name));
        let gain = (a / 2.0).powi(3) * 5.0 + b;
        let roots = [
            (gain * x).node(),
            (x + a).node(),
            x.node(),
            (a * b).node(),
            (a * x * b).node(),
        ];
        let found = g.hoisted(&roots, &[a.node(), b.node()]);
        let values: Vec<Node> = found.parts.iter().map(|part| part.value).collect();
        let mut expected = vec![gain.node(), a.node(), b.node(), (a * b).node()];
        expected.sort_unstable();
        assert_eq!(values, expected);
        let symbols: Vec<Node> = found.parts.iter().map(|part| part.symbol).collect();
        let read = g.symbols_of(&found.roots);
        assert!(read.iter().all(|s| *s == x.node() || symbols.contains(s)));
        let back = found.parts.iter().map(|part| (part.symbol, part.value));
        assert_eq!(g.substitute(&found.roots, &back.collect()), roots);
    }

    #[test]
    fn a_system_is_taken_out_by_its_entries() {
        let g = Graph::new();
        let [a, x] = ["a", "x"].map(|name| g.symbol(name));
        let solved = g.solve(&[(a + 1.0).node()], &[g.constant(3.0).node()]);
        let root = (g.expr(solved.x[0]) * x).node();
        let found = g.hoisted(&[root], &[a.node()]);
        assert_eq!(found.parts.len(), 1);
        assert_eq!(found.parts[0].value, solved.x[0]);
        // without the symbol nothing changes
        assert_eq!(g.hoisted(&[root], &[]).roots, [root]);
    }
}
