//! The hash-consed arena: an expression built twice is one node.

mod limits;
mod reach;
mod systems;

use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::Hash;

pub use systems::{ImplicitCall, LinearSystem, Solution};

use crate::facts::Facts;
use crate::{Binary, Budget, Expr, Op, Unary, real};
use reach::Marks;

/// A node of a [`Graph`]: cheap to copy, meaningful only with its graph.
/// Arguments of a node are always smaller than the node itself.
#[derive(Clone, Copy, PartialEq, Eq, Hash, PartialOrd, Ord, Debug)]
pub struct Node(pub(crate) u32);

impl Node {
    /// Position of the node in the order of construction.
    pub fn index(self) -> usize {
        self.0 as usize
    }
}

#[derive(Clone, PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
    Symbol(u32),
    Unary(Unary, Node),
    Powi(Node, i32),
    Binary(Binary, Node, Node),
    Select(Node, Node, Node),
    Entry(Node, u32),
}

#[derive(Clone, Default)]
struct Inner {
    ops: Vec<Op>,
    known: HashMap<Key, Node>,
    names: Vec<String>,
    by_name: HashMap<String, Node>,
    systems: Vec<LinearSystem>,
    known_systems: HashMap<LinearSystem, Node>,
    implicits: Vec<ImplicitCall>,
    known_implicits: HashMap<ImplicitCall, Node>,
    budget: Budget,
    /// nodes made, to look at the clock now and then
    made: u32,
}

impl Inner {
    fn push(&mut self, op: Op) -> Node {
        let node = Node(self.ops.len() as u32);
        self.ops.push(op);
        node
    }

    fn intern(&mut self, key: Key, op: Op) -> Node {
        if let Some(&node) = self.known.get(&key) {
            return node;
        }
        if !matches!(op, Op::Constant(_) | Op::Symbol(_)) && self.is_spent() {
            return self.nothing();
        }
        let node = self.push(op);
        self.known.insert(key, node);
        node
    }
}

/// A growing set of expressions in which equal expressions are one node.
///
/// ```
/// let g = lynkeus_expr::Graph::new();
/// let x = g.symbol("x");
/// assert_eq!(((x + 1.0) * x).node(), (x * (1.0 + x)).node());
/// ```
///
/// A graph is `Send` and not `Sync`: every thread works on its own clone. The nodes of a graph
/// mean the same in its clones; those that are built after the cloning do not.
#[derive(Clone, Default)]
pub struct Graph {
    inner: RefCell<Inner>,
    facts: RefCell<Facts>,
    marks: RefCell<Marks>,
}

impl std::fmt::Debug for Graph {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Graph({} nodes)", self.len())
    }
}

impl Graph {
    /// An empty graph.
    pub fn new() -> Self {
        Self::default()
    }

    /// Number of distinct nodes.
    pub fn len(&self) -> usize {
        self.inner.borrow().ops.len()
    }

    /// True before the first node.
    pub fn is_empty(&self) -> bool {
        self.len() == 0
    }

    /// The free variable of this name; the same name is the same node.
    pub fn symbol(&self, name: &str) -> Expr<'_> {
        let mut inner = self.inner.borrow_mut();
        if let Some(&node) = inner.by_name.get(name) {
            return Expr::new(self, node);
        }
        let index = inner.names.len() as u32;
        inner.names.push(name.to_owned());
        let node = inner.intern(Key::Symbol(index), Op::Symbol(index));
        inner.by_name.insert(name.to_owned(), node);
        Expr::new(self, node)
    }

    /// A free variable that is no other's: no name finds it, whatever it is called. The label
    /// is for people, in messages and rendered expressions.
    pub fn fresh(&self, label: impl Into<String>) -> Expr<'_> {
        let mut inner = self.inner.borrow_mut();
        let index = inner.names.len() as u32;
        inner.names.push(label.into());
        let node = inner.intern(Key::Symbol(index), Op::Symbol(index));
        Expr::new(self, node)
    }

    /// Whether a node is the symbol that its name finds, and no [fresh](Graph::fresh) one.
    pub(crate) fn is_named(&self, node: Node) -> bool {
        let inner = self.inner.borrow();
        match inner.ops[node.index()] {
            Op::Symbol(index) => inner.by_name.get(&inner.names[index as usize]) == Some(&node),
            _ => false,
        }
    }

    /// A number.
    pub fn constant(&self, value: f64) -> Expr<'_> {
        let key = Key::Constant(value.to_bits());
        let node = self.inner.borrow_mut().intern(key, Op::Constant(value));
        Expr::new(self, node)
    }

    /// The handle with operators for a node of this graph.
    pub fn expr(&self, node: Node) -> Expr<'_> {
        Expr::new(self, node)
    }

    /// What a node is.
    ///
    /// # Panics
    /// If `node` belongs to a larger graph.
    pub fn op(&self, node: Node) -> Op {
        self.inner.borrow().ops[node.index()]
    }

    /// The number, where the node is one.
    pub fn constant_value(&self, node: Node) -> Option<f64> {
        match self.op(node) {
            Op::Constant(value) => Some(value),
            _ => None,
        }
    }

    /// The name or the label, where the node is a symbol.
    pub fn symbol_name(&self, node: Node) -> Option<String> {
        match self.op(node) {
            Op::Symbol(index) => Some(self.inner.borrow().names[index as usize].clone()),
            _ => None,
        }
    }

    /// Arguments of a node, in order.
    pub fn arguments(&self, node: Node) -> Vec<Node> {
        let mut arguments = vec![];
        let inner = self.inner.borrow();
        inner.each_argument(node, |argument| arguments.push(argument));
        arguments
    }

    /// What was [noted](Graph::note) about a question that names nodes of this graph.
    pub fn noted<K, V>(&self, question: &K) -> Option<V>
    where
        K: Eq + Hash + Send + Sync + 'static,
        V: Clone + Send + Sync + 'static,
    {
        self.facts.borrow().get(question)
    }

    /// Keeps the answer to a question about nodes, such as a range on a box, with the graph
    /// and its clones. Nodes never change, so that it stays true.
    pub fn note<K, V>(&self, question: K, answer: V)
    where
        K: Clone + Eq + Hash + Send + Sync + 'static,
        V: Clone + Send + Sync + 'static,
    {
        // what was found after a limit struck need not be true
        if !self.is_spent() {
            self.facts.borrow_mut().insert(question, answer);
        }
    }

    /// A function of one node.
    pub fn unary(&self, op: Unary, a: Node) -> Node {
        if let Some(x) = self.constant_value(a)
            && let Some(folded) = self.fold(real::unary(op, x))
        {
            return folded;
        }
        if let (Unary::Neg, Op::Unary(Unary::Neg, inner)) = (op, self.op(a)) {
            return inner;
        }
        self.inner
            .borrow_mut()
            .intern(Key::Unary(op, a), Op::Unary(op, a))
    }

    /// An integer power.
    pub fn powi(&self, a: Node, n: i32) -> Node {
        if n == 1 {
            return a;
        }
        if let Some(x) = self.constant_value(a)
            && let Some(folded) = self.fold(x.powi(n))
        {
            return folded;
        }
        self.inner
            .borrow_mut()
            .intern(Key::Powi(a, n), Op::Powi(a, n))
    }

    /// A function of two nodes. A power with a constant whole exponent becomes
    /// [`Graph::powi`]: the same domain, and derivatives that exist at zero.
    pub fn binary(&self, op: Binary, a: Node, b: Node) -> Node {
        let (x, y) = (self.constant_value(a), self.constant_value(b));
        if let (Some(x), Some(y)) = (x, y)
            && let Some(folded) = self.fold(real::binary(op, x, y))
        {
            return folded;
        }
        if let (Binary::Pow, Some(n)) = (op, y.and_then(whole)) {
            return self.powi(a, n);
        }
        if let Some(same) = self.identity(op, a, b, x, y) {
            return same;
        }
        let (a, b) = if op.commutes() && b < a {
            (b, a)
        } else {
            (a, b)
        };
        self.inner
            .borrow_mut()
            .intern(Key::Binary(op, a, b), Op::Binary(op, a, b))
    }

    /// Identities that hold for every `f64`, NaN, infinities and −0 included:
    /// x·1, x/1, x·(−1), x/(−1), x − 0 and x + (−0). Notably x + 0 is not one
    /// (−0 + 0 = +0) and neither are 0·x, x − x and x/x.
    fn identity(
        &self,
        op: Binary,
        a: Node,
        b: Node,
        x: Option<f64>,
        y: Option<f64>,
    ) -> Option<Node> {
        let is =
            |value: Option<f64>, number: f64| value.map(f64::to_bits) == Some(number.to_bits());
        match op {
            Binary::Mul | Binary::Div if is(y, 1.0) => Some(a),
            Binary::Mul | Binary::Div if is(y, -1.0) => Some(self.unary(Unary::Neg, a)),
            Binary::Mul if is(x, 1.0) => Some(b),
            Binary::Mul if is(x, -1.0) => Some(self.unary(Unary::Neg, b)),
            Binary::Sub if is(y, 0.0) => Some(a),
            Binary::Add if is(y, -0.0) => Some(a),
            Binary::Add if is(x, -0.0) => Some(b),
            _ => None,
        }
    }

    /// A folded value as a constant. Values that are not finite stay unfolded,
    /// so that the operation that makes them can be named when it is evaluated.
    fn fold(&self, value: f64) -> Option<Node> {
        value.is_finite().then(|| self.constant(value).node())
    }

    /// `if condition then a else b`.
    pub fn select(&self, condition: Node, a: Node, b: Node) -> Node {
        match self.constant_value(condition) {
            Some(c) if !c.is_nan() => return if c != 0.0 { a } else { b },
            _ => {}
        }
        self.inner
            .borrow_mut()
            .intern(Key::Select(condition, a, b), Op::Select(condition, a, b))
    }

    /// The symbols that the roots depend on, in order of creation.
    pub fn symbols_of(&self, roots: &[Node]) -> Vec<Node> {
        let mut symbols = self.reachable(roots);
        symbols.retain(|&node| matches!(self.op(node), Op::Symbol(_)));
        symbols
    }
}

/// The exponent of an integer power.
fn whole(exponent: f64) -> Option<i32> {
    (exponent == exponent.trunc() && exponent.abs() <= 1024.0).then_some(exponent as i32)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_expression_built_twice_is_one_node() {
        let g = Graph::new();
        let build = || ((g.symbol("x") + g.symbol("y")).sin() * 2.0).node();
        let (first, size) = (build(), g.len());
        assert_eq!((build(), g.len()), (first, size));
        assert_eq!((2.0 * (g.symbol("y") + g.symbol("x")).sin()).node(), first);
    }

    #[test]
    fn unsafe_identities_do_not_fold() {
        let g = Graph::new();
        let x = g.symbol("x");
        for kept in [x * 0.0, x - x, x / x, x + 0.0, g.constant(0.0) * x] {
            assert!(matches!(g.op(kept.node()), Op::Binary(..)), "{kept:?}");
        }
        let infinite = g.constant(1.0) / g.constant(0.0);
        assert!(matches!(g.op(infinite.node()), Op::Binary(..)));
        for same in [x * 1.0, 1.0 * x, x / 1.0, x - 0.0, -(-x), x + (-0.0)] {
            assert_eq!(same.node(), x.node());
        }
        assert_eq!((x * -1.0).node(), (-x).node());
    }

    #[test]
    fn a_clone_in_another_thread_knows_the_same_nodes_and_facts() {
        let g = Graph::new();
        let sum = (g.symbol("x") + 1.0).node();
        g.note(sum, 2.5_f64);
        let copy = g.clone();
        let built = std::thread::spawn(move || {
            let again = (copy.symbol("x") + 1.0).node();
            let beyond = (copy.symbol("x") + 2.0).node();
            copy.note(beyond, 3.5_f64);
            (again, copy.noted::<Node, f64>(&again), copy.len())
        });
        let (again, fact, length) = built.join().unwrap();
        assert_eq!((again, fact), (sum, Some(2.5)));
        assert!(length > g.len());
        let other = (g.symbol("x") * 7.0).node();
        assert_eq!(g.noted::<Node, f64>(&other), None);
    }

    #[test]
    fn equal_systems_share_their_solution() {
        let g = Graph::new();
        let [a, b] = ["a", "b"].map(|name| g.symbol(name).node());
        assert_eq!(g.solve(&[a], &[b]).x, g.solve(&[a], &[b]).x);
    }
}
