//! What depends on some symbols alone, taken out of expressions.

use std::collections::{BTreeSet, HashMap};

use crate::{Graph, Node, Op};

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

/// On what a node depends.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
enum Reads {
    Nothing,
    /// some of the symbols
    Own,
    /// other symbols, too
    Others,
}

impl Graph {
    /// Takes out of the roots every expression that depends on some of the `symbols` and on nothing
    /// else, as large as it can be, so that it is computed once where it would be again and again.
    pub fn hoisted(&self, roots: &[Node], symbols: &[Node]) -> Hoisted {
        let mut reads: HashMap<Node, Reads> = HashMap::new();
        let mut largest: BTreeSet<Node> = BTreeSet::new();
        for node in self.reachable(roots) {
            let arguments = self.arguments(node);
            let found = match self.op(node) {
                Op::Symbol(_) if symbols.contains(&node) => Reads::Own,
                Op::Symbol(_) => Reads::Others,
                _ => {
                    let each = arguments.iter().map(|argument| reads[argument]);
                    each.max().unwrap_or(Reads::Nothing)
                }
            };
            if found == Reads::Others {
                largest.extend(arguments.into_iter().filter(|a| reads[a] == Reads::Own));
            }
            reads.insert(node, found);
        }
        largest.extend(roots.iter().filter(|root| reads[root] == Reads::Own));
        let part = |value: Node| HoistedPart {
            symbol: self.fresh(self.render(value, 60)).node(),
            value,
        };
        let parts: Vec<HoistedPart> = largest.into_iter().map(part).collect();
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
