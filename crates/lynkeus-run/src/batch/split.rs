//! What all trajectories of a batch have in common, computed once.

use std::cell::{Cell, RefCell};
use std::collections::HashMap;

use lynkeus_expr::lanes::{self, Portable};
use lynkeus_expr::{Algebra, Binary, Graph, Implicit, MissingInput, Node, Nodes, Tape, Unary};

/// A tape in two: what follows from the shared inputs alone, and the rest.
#[derive(Debug)]
pub(crate) struct Divided {
    /// shared inputs → the values that the rest reads
    pub common: Tape,
    /// these values, then all other inputs → the outputs
    pub own: Tape,
    /// whether there is a function that lanes round in their own way
    pub has_functions: bool,
}

impl Divided {
    /// Divides a tape; `is_shared` says of each input whether all trajectories have the same.
    ///
    /// # Errors
    /// None with a tape that reads its own inputs.
    pub fn new(tape: &Tape, is_shared: impl Fn(usize) -> bool) -> Result<Self, MissingInput> {
        let g = Graph::new();
        let inputs: Vec<Value> = (0..tape.inputs())
            .map(|i| Value {
                node: g.fresh("w").node(),
                is_shared: is_shared(i),
            })
            .collect();
        let division = Division {
            graph: &g,
            frontier: RefCell::default(),
            known: RefCell::default(),
            has_functions: Cell::default(),
        };
        let outputs = tape.eval_in(&division, &inputs);
        let outputs: Vec<Node> = outputs.iter().map(|v| division.own(v)).collect();
        let frontier = division.frontier.take();
        let of = |shared: bool| inputs.iter().filter(move |v| v.is_shared == shared);
        let shared: Vec<Node> = of(true).map(|v| v.node).collect();
        let (values, symbols): (Vec<Node>, Vec<Node>) = frontier.into_iter().unzip();
        let rest: Vec<Node> = symbols
            .into_iter()
            .chain(of(false).map(|v| v.node))
            .collect();
        Ok(Self {
            common: Tape::new(&g, &shared, &values)?,
            own: Tape::new(&g, &rest, &outputs)?,
            has_functions: division.has_functions.get(),
        })
    }
}

/// A node, and whether it follows from the shared inputs alone.
#[derive(Clone, Copy, Debug)]
struct Value {
    node: Node,
    is_shared: bool,
}

/// The nodes of a graph where shared values end in symbols.
struct Division<'g> {
    graph: &'g Graph,
    /// shared values that others read, each with its symbol
    frontier: RefCell<Vec<(Node, Node)>>,
    known: RefCell<HashMap<Node, Node>>,
    has_functions: Cell<bool>,
}

impl Division<'_> {
    /// The value as others read it.
    fn own(&self, value: &Value) -> Node {
        let Value { node, is_shared } = *value;
        if !is_shared || self.graph.constant_value(node).is_some() {
            return node;
        }
        let new = || {
            let symbol = self.graph.fresh("shared").node();
            self.frontier.borrow_mut().push((node, symbol));
            symbol
        };
        *self.known.borrow_mut().entry(node).or_insert_with(new)
    }

    fn made<T>(&self, arguments: &[Value], make: impl FnOnce(&[Node]) -> T) -> (T, bool) {
        let is_shared = arguments.iter().all(|v| v.is_shared);
        let nodes: Vec<Node> = match is_shared {
            true => arguments.iter().map(|v| v.node).collect(),
            false => arguments.iter().map(|v| self.own(v)).collect(),
        };
        (make(&nodes), is_shared)
    }

    /// Takes note of a function of lanes.
    fn see<F>(&self, function: Option<F>) {
        if function.is_some() {
            self.has_functions.set(true);
        }
    }

    fn one(&self, arguments: &[Value], make: impl FnOnce(&[Node]) -> Node) -> Value {
        let (node, is_shared) = self.made(arguments, make);
        Value { node, is_shared }
    }
}

impl Algebra for Division<'_> {
    type Value = Value;

    fn constant(&self, value: f64) -> Value {
        Value {
            node: self.graph.constant(value).node(),
            is_shared: true,
        }
    }

    fn unary(&self, op: Unary, x: &Value) -> Value {
        self.see(lanes::unary::<Portable<1>>(op));
        self.one(&[*x], |a| self.graph.unary(op, a[0]))
    }

    fn powi(&self, x: &Value, n: i32) -> Value {
        self.one(&[*x], |a| self.graph.powi(a[0], n))
    }

    fn binary(&self, op: Binary, x: &Value, y: &Value) -> Value {
        self.see(lanes::binary::<Portable<1>>(op));
        self.one(&[*x, *y], |a| self.graph.binary(op, a[0], a[1]))
    }

    fn select(&self, condition: &Value, x: &Value, y: &Value) -> Value {
        self.one(&[*condition, *x, *y], |a| {
            self.graph.select(a[0], a[1], a[2])
        })
    }

    fn solve(&self, a: &[Value], b: &[Value]) -> (Vec<Value>, Value) {
        let all = [a, b].concat();
        let solve = |n: &[Node]| {
            let (a, b) = n.split_at(a.len());
            Nodes(self.graph).solve(a, b)
        };
        let ((x, rcond), is_shared) = self.made(&all, solve);
        let value = |node: Node| Value { node, is_shared };
        (x.into_iter().map(value).collect(), value(rcond))
    }

    fn implicit(&self, function: &Implicit, p: &[Value]) -> Vec<Value> {
        let (z, is_shared) = self.made(p, |p| self.graph.implicit(function, p));
        z.into_iter()
            .map(|node| Value { node, is_shared })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_depends_on_time_alone_is_computed_once() {
        let g = Graph::new();
        let [t, x, p] = ["t", "x", "p"].map(|name| g.symbol(name));
        let u = (t * 3.0).sin() * 2.0;
        let dx = x * u + u.exp() * p - x.sin();
        let tape = Tape::new(&g, &[t, x, p].map(|e| e.node()), &[dx.node(), u.node()]).unwrap();
        let divided = Divided::new(&tape, |i| i == 0).unwrap();
        // u and eᵘ
        assert_eq!((divided.common.inputs(), divided.common.outputs()), (1, 2));
        assert_eq!((divided.own.inputs(), divided.own.len()), (4, 5));
        let common = divided.common.eval_in(&lynkeus_expr::Reals, &[0.7]);
        let inputs = [&common[..], &[0.3, -1.5]].concat();
        let mut expected = [0.0; 2];
        tape.evaluator().eval(&[0.7, 0.3, -1.5], &mut expected);
        assert_eq!(divided.own.eval_in(&lynkeus_expr::Reals, &inputs), expected);
    }
}
