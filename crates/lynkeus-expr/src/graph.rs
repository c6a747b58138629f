//! The hash-consed arena: an expression built twice is one node.

mod operators;
mod systems;

use std::any::{Any, TypeId};
use std::cell::RefCell;
use std::collections::HashMap;
use std::hash::Hash;
use std::sync::Arc;

use crate::code::System;
use crate::{Algebra, Binary, Budget, Implicit, Node, Op, Reals, Spent, Unary};

/// Nodes between two looks at the clock.
const OFTEN: u32 = 64;
/// Bytes that a node takes, in the arena and in the table that finds it.
const NODE: usize = size_of::<Op>() + 2 * (size_of::<Key>() + size_of::<Node>());
/// Most answers of one kind that are kept; later ones are not.
const MOST: usize = 20_000;

#[derive(Clone, PartialEq, Eq, Hash)]
enum Key {
    Constant(u64),
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
    systems: Vec<Call>,
    known_systems: HashMap<Call, Node>,
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
        if !matches!(op, Op::Constant(_)) && self.is_spent() {
            return self.nothing();
        }
        let node = self.push(op);
        self.known.insert(key, node);
        node
    }

    /// Whether no more nodes are made.
    fn is_spent(&mut self) -> bool {
        self.made = self.made.wrapping_add(1);
        // the arena and its table double when they are full
        if self.ops.len() == self.ops.capacity() {
            return !self.budget.affords(self.ops.len() * NODE);
        }
        match self.made.is_multiple_of(OFTEN) {
            true => self.budget.spent().is_some(),
            false => self.budget.marked().is_some(),
        }
    }

    /// What stands for every node that is not made any more. Its value is none.
    fn nothing(&mut self) -> Node {
        let none = f64::NAN;
        self.intern(Key::Constant(none.to_bits()), Op::Constant(none))
    }

    /// Hands over the arguments of a node.
    fn each_argument(&self, node: Node, mut give: impl FnMut(Node)) {
        match self.ops[node.index()] {
            Op::Constant(_) | Op::Symbol(_) => {}
            Op::Unary(_, a) | Op::Powi(a, _) | Op::Entry(a, _) => give(a),
            Op::Binary(_, a, b) => [a, b].into_iter().for_each(give),
            Op::Select(c, a, b) => [c, a, b].into_iter().for_each(give),
            Op::System(system) => {
                let arguments = &self.systems[system as usize].arguments;
                arguments.iter().copied().for_each(give);
            }
        }
    }
}

/// Nodes that were met in a walk: those with the stamp of that walk, so that no walk has to
/// clear what another one left.
#[derive(Clone, Default)]
struct Marks {
    walk: u32,
    stamps: Vec<u32>,
}

impl Marks {
    fn begin(&mut self, nodes: usize) {
        self.walk = self.walk.wrapping_add(1);
        if self.walk == 0 {
            self.stamps.clear();
            self.walk = 1;
        }
        if self.stamps.len() < nodes {
            self.stamps.resize(nodes, 0);
        }
    }

    /// Whether the node is met for the first time.
    fn meet(&mut self, node: Node) -> bool {
        let stamp = &mut self.stamps[node.index()];
        let first = *stamp != self.walk;
        *stamp = self.walk;
        first
    }
}

/// What was found out about nodes, by the types of question and answer. A clone shares the answers
/// until either learns more.
type Facts = HashMap<TypeId, Arc<dyn Any + Send + Sync>>;

/// The system of an [`Op::System`] node, and where it is taken.
#[derive(Clone, PartialEq, Eq, Hash, Debug)]
pub struct Call {
    pub(crate) system: System,
    /// of a linear system A row by row (n²), then b (n); p of an implicit function
    pub arguments: Vec<Node>,
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
        let known = self.inner.borrow().by_name.get(name).copied();
        if let Some(node) = known {
            return Expr::new(self, node);
        }
        let symbol = self.fresh(name);
        let by_name = &mut self.inner.borrow_mut().by_name;
        by_name.insert(name.to_owned(), symbol.node);
        symbol
    }

    /// A free variable that is no other's: no name finds it, whatever it is called. The label
    /// is for people, in messages and rendered expressions.
    pub fn fresh(&self, label: impl Into<String>) -> Expr<'_> {
        let mut inner = self.inner.borrow_mut();
        let index = inner.names.len() as u32;
        inner.names.push(label.into());
        let node = inner.push(Op::Symbol(index));
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
        let node = self.intern(key, Op::Constant(value));
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
        let facts = self.facts.borrow();
        let kind = facts.get(&TypeId::of::<(K, V)>())?;
        let answers: &HashMap<K, V> = kind.downcast_ref()?;
        answers.get(question).cloned()
    }

    /// Keeps the answer to a question about nodes, such as a range on a box, with the graph
    /// and its clones. Nodes never change, so that it stays true.
    pub fn note<K, V>(&self, question: K, answer: V)
    where
        K: Clone + Eq + Hash + Send + Sync + 'static,
        V: Clone + Send + Sync + 'static,
    {
        // what was found after a limit struck need not be true
        if self.is_spent() {
            return;
        }
        let kind = TypeId::of::<(K, V)>();
        let mut facts = self.facts.borrow_mut();
        let known = facts.remove(&kind);
        let known = known.and_then(|kind| kind.downcast::<HashMap<K, V>>().ok());
        let mut answers = known.unwrap_or_default();
        if answers.len() < MOST {
            Arc::make_mut(&mut answers).insert(question, answer);
        }
        facts.insert(kind, answers);
    }

    fn intern(&self, key: Key, op: Op) -> Node {
        self.inner.borrow_mut().intern(key, op)
    }

    /// A function of one node.
    pub fn unary(&self, op: Unary, a: Node) -> Node {
        if let Some(x) = self.constant_value(a)
            && let Some(folded) = self.fold(Reals.unary(op, &x))
        {
            return folded;
        }
        if let (Unary::Neg, Op::Unary(Unary::Neg, inner)) = (op, self.op(a)) {
            return inner;
        }
        self.intern(Key::Unary(op, a), Op::Unary(op, a))
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
        self.intern(Key::Powi(a, n), Op::Powi(a, n))
    }

    /// A function of two nodes. A power with a constant whole exponent becomes
    /// [`Graph::powi`]: the same domain, and derivatives that exist at zero.
    pub fn binary(&self, op: Binary, a: Node, b: Node) -> Node {
        let (x, y) = (self.constant_value(a), self.constant_value(b));
        if let (Some(x), Some(y)) = (x, y)
            && let Some(folded) = self.fold(Reals.binary(op, &x, &y))
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
        self.intern(Key::Binary(op, a, b), Op::Binary(op, a, b))
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
        self.intern(Key::Select(condition, a, b), Op::Select(condition, a, b))
    }

    /// Every node that the roots need, arguments before their users. The work is that of what
    /// they need, not of the whole graph.
    pub fn reachable(&self, roots: &[Node]) -> Vec<Node> {
        let inner = self.inner.borrow();
        let mut marks = self.marks.borrow_mut();
        marks.begin(inner.ops.len());
        let mut found: Vec<Node> = vec![];
        for &root in roots {
            if marks.meet(root) {
                found.push(root);
            }
        }
        let mut next = 0;
        while let Some(&node) = found.get(next) {
            next += 1;
            inner.each_argument(node, |argument| {
                if marks.meet(argument) {
                    found.push(argument);
                }
            });
        }
        found.sort_unstable();
        found
    }

    /// The symbols that the roots depend on, in order of creation.
    pub fn symbols_of(&self, roots: &[Node]) -> Vec<Node> {
        let mut symbols = self.reachable(roots);
        symbols.retain(|&node| matches!(self.op(node), Op::Symbol(_)));
        symbols
    }
}

/// A graph under a budget of time and memory.
impl Graph {
    /// Puts the work on this graph, and on clones made from now on, under a budget.
    pub fn set_budget(&self, budget: Budget) {
        self.inner.borrow_mut().budget = budget;
    }

    /// The budget of the work on this graph.
    pub fn budget(&self) -> Budget {
        self.inner.borrow().budget.clone()
    }

    /// Whether the budget is spent, looking at the clock: ask it in every long loop. After
    /// that no nodes are made, nothing is [noted](Graph::note), and results do not count.
    pub fn spent(&self) -> Option<Spent> {
        self.inner.borrow().budget.spent()
    }

    /// Whether somebody noticed that the budget is spent.
    pub(crate) fn is_spent(&self) -> bool {
        self.inner.borrow().budget.marked().is_some()
    }

    /// Works under a budget of its own. What was found counts only where the budget lasted:
    /// a graph whose budget is spent makes no more nodes, and something else stands for them.
    ///
    /// # Errors
    /// What ended the work.
    pub fn budgeted<T>(&self, budget: Budget, work: impl FnOnce() -> T) -> Result<T, Spent> {
        let before = self.budget();
        self.set_budget(budget.clone());
        let done = match budget.spent() {
            Some(spent) => Err(spent),
            None => Ok(work()),
        };
        self.set_budget(before);
        match budget.marked() {
            Some(spent) => Err(spent),
            None => done,
        }
    }
}

/// A node together with its graph.
///
/// # Panics
/// Operators panic where the two sides come from different graphs.
#[derive(Clone, Copy)]
pub struct Expr<'g> {
    graph: &'g Graph,
    node: Node,
}

impl std::fmt::Debug for Expr<'_> {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        f.write_str(&self.graph.render(self.node, 200))
    }
}

impl<'g> Expr<'g> {
    pub(crate) fn new(graph: &'g Graph, node: Node) -> Self {
        Self { graph, node }
    }

    /// The node.
    pub fn node(self) -> Node {
        self.node
    }

    /// The graph the node lives in.
    pub fn graph(self) -> &'g Graph {
        self.graph
    }
}

/// The nodes of a graph: evaluation builds expressions.
#[derive(Clone, Copy, Debug)]
pub struct Nodes<'g>(pub &'g Graph);

impl Algebra for Nodes<'_> {
    type Value = Node;

    fn constant(&self, value: f64) -> Node {
        self.0.constant(value).node()
    }

    fn unary(&self, op: Unary, x: &Node) -> Node {
        self.0.unary(op, *x)
    }

    fn powi(&self, x: &Node, n: i32) -> Node {
        self.0.powi(*x, n)
    }

    fn binary(&self, op: Binary, x: &Node, y: &Node) -> Node {
        self.0.binary(op, *x, *y)
    }

    fn select(&self, condition: &Node, x: &Node, y: &Node) -> Node {
        self.0.select(*condition, *x, *y)
    }

    fn solve(&self, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
        let solution = self.0.solve(a, b);
        (solution.x, solution.rcond)
    }

    fn implicit(&self, function: &Implicit, p: &[Node]) -> Vec<Node> {
        self.0.implicit(function, p)
    }

    fn is_spent(&self) -> bool {
        self.0.is_spent()
    }
}

/// The exponent of an integer power.
fn whole(exponent: f64) -> Option<i32> {
    (exponent == exponent.trunc() && exponent.abs() <= 1024.0).then_some(exponent as i32)
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

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

    #[test]
    fn arguments_come_first_and_nothing_else_comes() {
        let g = Graph::new();
        let [x, y] = ["x", "y"].map(|name| g.symbol(name));
        let aside = (x * y).cos();
        let solution = g.solve(&[(x + 2.0).node()], &[y.node()]);
        let root = (g.expr(solution.x[0]) * x).sin();
        for _ in 0..3 {
            let found = g.reachable(&[root.node(), x.node()]);
            assert!(found.is_sorted() && found.contains(&y.node()));
            assert!(!found.contains(&aside.node()));
            // x, y, 2, x + 2, the system, its entry, the product, the sine
            assert_eq!(found.len(), 8);
        }
        assert_eq!(g.reachable(&[]), []);
    }

    #[test]
    fn nothing_is_made_or_noted_after_the_end_and_everything_again_later() {
        let g = Graph::new();
        let x = g.symbol("x");
        let sum = (x + 1.0).node();
        let budget = Budget::new(Some(Duration::from_secs(60)), None);
        let found = g.budgeted(budget.clone(), || {
            budget.cancel();
            let made = (x * 3.0).sin().node();
            g.note(sum, 1.0_f64);
            assert!(g.constant_value(made).is_some_and(f64::is_nan));
            assert_eq!((x + 1.0).node(), sum);
            let b = (x * 7.0).node();
            let solved = g.solve(&[b], &[b]);
            assert_eq!(solved.x, [solved.rcond]);
        });
        assert_eq!(found, Err(Spent::Cancelled));
        assert_eq!(g.noted::<Node, f64>(&sum), None);
        assert!(matches!(g.op((x * 3.0).node()), Op::Binary(..)));
    }

    #[test]
    fn a_graph_that_grows_ends_in_time() {
        let g = Graph::new();
        let started = std::time::Instant::now();
        let grown = g.budgeted(Budget::default().within(Duration::from_millis(20)), || {
            let mut sum = g.symbol("x");
            while g.spent().is_none() {
                for _ in 0..10_000 {
                    sum = (sum + 1.5).sin();
                }
            }
        });
        assert!(grown.is_err());
        assert!(started.elapsed() < Duration::from_secs(20));
    }

    #[test]
    fn a_clone_shares_the_budget() {
        let g = Graph::new();
        let budget = Budget::new(None, None);
        g.set_budget(budget.clone());
        let copy = g.clone();
        budget.cancel();
        assert_eq!(copy.spent(), Some(Spent::Cancelled));
    }
}
