//! Every node of some expressions on one cell: its values, whether they exist, and
//! whether it can jump there.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::interval::Intervals;
use lynkeus_expr::{Algebra, Binary, Graph, Interval, MissingInput, Node, Op, Tape, Unary};

use super::glue::meets;
use crate::Region;

/// What is known of a node on a cell.
#[derive(Clone, Copy, Debug)]
pub(super) struct Known {
    /// encloses its values, and says whether it has one everywhere
    pub values: Interval,
    /// it does not jump as the moving symbols do
    pub continuous: bool,
}

/// Expressions in the order of their evaluation.
pub(super) struct Walk<'g> {
    graph: &'g Graph,
    nodes: Vec<Node>,
    place: HashMap<Node, usize>,
    /// side of the region of a symbol
    sides: HashMap<Node, usize>,
    /// depends on a symbol that moves
    moves: Vec<bool>,
    /// a selection whose branches agree where it changes from one to the other
    glued: HashSet<Node>,
    known: Vec<Known>,
    /// the systems on this cell: enclosures of their entries, of a linear one also of the
    /// condition estimate, which comes last
    solved: HashMap<Node, Vec<Interval>>,
}

impl<'g> Walk<'g> {
    /// # Errors
    /// [`MissingInput`] where an expression reads a symbol outside the region.
    pub fn new(
        graph: &'g Graph,
        roots: &[Node],
        moving: &[Node],
        region: &Region,
    ) -> Result<Self, MissingInput> {
        let nodes = graph.reachable(roots);
        let place: HashMap<Node, usize> = nodes.iter().enumerate().map(|(i, &n)| (n, i)).collect();
        let sides: HashMap<Node, usize> = region
            .dimensions
            .iter()
            .enumerate()
            .map(|(i, d)| (d.symbol, i))
            .collect();
        // refuses symbols outside the region
        Tape::new(graph, &region.symbols(), roots)?;
        let moving: HashSet<Node> = moving.iter().copied().collect();
        let mut moves: Vec<bool> = vec![];
        for &node in &nodes {
            let arguments = graph.arguments(node);
            let one = moving.contains(&node) || arguments.iter().any(|a| moves[place[a]]);
            moves.push(one);
        }
        let glued = nodes
            .iter()
            .copied()
            .filter(|&node| meets(graph, node, region));
        Ok(Self {
            glued: glued.collect(),
            known: Vec::with_capacity(nodes.len()),
            solved: HashMap::new(),
            graph,
            nodes,
            place,
            sides,
            moves,
        })
    }

    /// The first node that may lack a value or jump on the cell, with what is known of it;
    /// none where every root has a value everywhere and does not jump.
    pub fn trouble(&mut self, roots: &[Node], cell: &[Interval]) -> Option<(Node, Known)> {
        self.known.clear();
        self.solved.clear();
        for i in 0..self.nodes.len() {
            let known = self.one(i, cell);
            self.known.push(known);
            // one cell may take long where systems are large
            if self.graph.op(self.nodes[i]).is_system() && self.graph.spent().is_none() {
                let system = self.nodes[i];
                let solved = self.solve(system);
                self.solved.insert(system, solved);
            }
        }
        let fails = |k: Known| !(k.continuous && k.values.is_defined());
        let bad = roots.iter().any(|root| fails(self.known[self.place[root]]));
        if !bad {
            return None;
        }
        let needed = self.needed(roots);
        let first = (0..self.nodes.len()).find(|&i| needed[i] && fails(self.known[i]))?;
        Some((self.nodes[first], self.known[first]))
    }

    /// The nodes behind the roots' troubles: a branch that is not taken is none.
    fn needed(&self, roots: &[Node]) -> Vec<bool> {
        let mut needed = vec![false; self.nodes.len()];
        for root in roots {
            needed[self.place[root]] = true;
        }
        for i in (0..self.nodes.len()).rev() {
            if !needed[i] {
                continue;
            }
            let untaken = match self.graph.op(self.nodes[i]) {
                Op::Select(c, a, b) => match decided(self.of(c).values) {
                    Some(true) => Some(b),
                    Some(false) => Some(a),
                    None => None,
                },
                _ => None,
            };
            for argument in self.graph.arguments(self.nodes[i]) {
                needed[self.place[&argument]] |= Some(argument) != untaken;
            }
        }
        needed
    }

    fn of(&self, node: Node) -> Known {
        self.known[self.place[&node]]
    }

    fn one(&self, i: usize, cell: &[Interval]) -> Known {
        let node = self.nodes[i];
        let op = self.graph.op(node);
        let values = self.values(op, node, cell);
        // whatever it is made of: a constant does not jump
        let constant = values.is_defined() && values.is_point();
        Known {
            values,
            continuous: constant || !self.moves[i] || self.continuous(op, node, values),
        }
    }

    fn values(&self, op: Op, node: Node, cell: &[Interval]) -> Interval {
        let of = |n: Node| self.of(n).values;
        match op {
            Op::Constant(x) => Interval::point(x),
            Op::Symbol(_) => cell[self.sides[&node]],
            Op::Unary(op, a) => Intervals.unary(op, &of(a)),
            Op::Powi(a, n) => Intervals.powi(&of(a), n),
            Op::Binary(op, a, b) => Intervals.binary(op, &of(a), &of(b)),
            Op::Select(c, a, b) => Intervals.select(&of(c), &of(a), &of(b)),
            // a system has no value of its own, and must not pass for a constant
            Op::Solve(_) | Op::Implicit(_) => Interval::ENTIRE,
            Op::Entry(system, i) => self.entry(system, i as usize),
        }
    }

    fn entry(&self, system: Node, i: usize) -> Interval {
        let entries = self.solved.get(&system);
        let entry = entries.and_then(|entries| entries.get(i).copied());
        entry.unwrap_or(Interval::UNKNOWN)
    }

    fn solve(&self, system: Node) -> Vec<Interval> {
        let arguments = self.graph.arguments(system);
        let values: Vec<Interval> = arguments.iter().map(|&a| self.of(a).values).collect();
        if let Some(call) = self.graph.implicit_call(system) {
            return Intervals.implicit(&call.function, &values);
        }
        let n = self.unknowns(system);
        let (A, b) = values.split_at(n * n);
        let (mut x, condition) = Intervals.solve(A, b);
        x.push(condition);
        x
    }

    /// Number of unknowns of a linear system.
    fn unknowns(&self, system: Node) -> usize {
        self.graph.system(system).map_or(0, |system| system.size())
    }

    fn continuous(&self, op: Op, node: Node, values: Interval) -> bool {
        let of = |n: Node| self.of(n);
        match op {
            Op::Constant(_) | Op::Symbol(_) => true,
            // they step where their values differ
            Op::Unary(Unary::Sign | Unary::Floor | Unary::Not, _)
            | Op::Binary(
                Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or,
                ..,
            ) => false,
            Op::Binary(Binary::Atan2, y, x) => {
                let cut = of(y).values.contains_zero() && of(x).values.lo() < 0.0;
                of(y).continuous && of(x).continuous && !(cut && self.moves[self.place[&y]])
            }
            Op::Binary(Binary::Pow, x, y) => {
                // 0^0 is 1, and every number from 0 to 1 is near it
                let corner = of(x).values.contains_zero()
                    && of(y).values.contains_zero()
                    && !of(y).values.is_point();
                of(x).continuous && of(y).continuous && !corner
            }
            Op::Select(c, a, b) => match decided(of(c).values) {
                Some(true) => of(a).continuous,
                Some(false) => of(b).continuous,
                None => {
                    let still = !self.moves[self.place[&c]] || self.glued.contains(&node);
                    still && of(a).continuous && of(b).continuous
                }
            },
            // the condition estimate steps with the pivots; a root that is the only one of
            // equations that do not jump moves with them
            Op::Entry(system, i) => {
                let linear = matches!(self.graph.op(system), Op::Solve(_));
                let last = linear && i as usize == self.unknowns(system);
                of(system).continuous && values.is_defined() && !last
            }
            Op::Unary(..) | Op::Powi(..) | Op::Binary(..) | Op::Solve(_) | Op::Implicit(_) => {
                let arguments = self.graph.arguments(node);
                arguments.into_iter().all(|a| of(a).continuous)
            }
        }
    }
}

/// The one truth value of a condition.
fn decided(condition: Interval) -> Option<bool> {
    match (condition.is_empty(), condition.contains_zero()) {
        (false, false) => Some(true),
        (false, true) if condition.is_point() => Some(false),
        _ => None,
    }
}
