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

/// One operation, its arguments by their places.
struct Step {
    node: Node,
    op: Op,
    arguments: Vec<usize>,
    /// of a symbol: its side of the region
    side: usize,
    /// depends on a symbol that moves
    moves: bool,
    /// a selection whose branches agree where it changes from one to the other
    glued: bool,
}

/// Expressions in the order of their evaluation.
pub(super) struct Walk<'g> {
    graph: &'g Graph,
    steps: Vec<Step>,
    /// places of the roots
    roots: Vec<usize>,
    known: Vec<Known>,
    /// per step, for the systems on this cell: enclosures of their entries, of a linear one also
    /// of the condition estimate, which comes last
    solved: Vec<Vec<Interval>>,
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
        let mut steps: Vec<Step> = vec![];
        for &node in &nodes {
            let arguments: Vec<usize> = graph.arguments(node).iter().map(|a| place[a]).collect();
            let moves = moving.contains(&node) || arguments.iter().any(|&a| steps[a].moves);
            steps.push(Step {
                node,
                op: graph.op(node),
                arguments,
                side: sides.get(&node).copied().unwrap_or_default(),
                moves,
                glued: meets(graph, node, region),
            });
        }
        Ok(Self {
            graph,
            roots: roots.iter().map(|root| place[root]).collect(),
            known: Vec::with_capacity(steps.len()),
            solved: vec![vec![]; steps.len()],
            steps,
        })
    }

    /// The first node that may lack a value or jump on the cell, with what is known of it;
    /// none where every root has a value everywhere and does not jump.
    pub fn trouble(&mut self, cell: &[Interval]) -> Option<(Node, Known)> {
        self.known.clear();
        for i in 0..self.steps.len() {
            let known = self.one(i, cell);
            self.known.push(known);
            // one cell may take long where systems are large
            if self.steps[i].op.is_system() {
                self.solved[i] = match self.graph.spent() {
                    None => self.solve(i),
                    Some(_) => vec![],
                };
            }
        }
        let fails = |k: Known| !(k.continuous && k.values.is_defined());
        if !self.roots.iter().any(|&root| fails(self.known[root])) {
            return None;
        }
        let needed = self.needed();
        let first = (0..self.steps.len()).find(|&i| needed[i] && fails(self.known[i]))?;
        Some((self.steps[first].node, self.known[first]))
    }

    /// Whether every operation is needed wherever the roots are: none is chosen.
    pub fn needs_all(&self) -> bool {
        !self
            .steps
            .iter()
            .any(|step| matches!(step.op, Op::Select(..)))
    }

    /// The nodes behind the roots' troubles: a branch that is not taken is none.
    fn needed(&self) -> Vec<bool> {
        let mut needed = vec![false; self.steps.len()];
        for &root in &self.roots {
            needed[root] = true;
        }
        for (i, step) in self.steps.iter().enumerate().rev() {
            if !needed[i] {
                continue;
            }
            let untaken = match (step.op, &step.arguments[..]) {
                (Op::Select(..), &[c, a, b]) => match decided(self.known[c].values) {
                    Some(true) => Some(b),
                    Some(false) => Some(a),
                    None => None,
                },
                _ => None,
            };
            for &argument in &step.arguments {
                needed[argument] |= Some(argument) != untaken;
            }
        }
        needed
    }

    fn one(&self, i: usize, cell: &[Interval]) -> Known {
        let step = &self.steps[i];
        let values = self.values(step, cell);
        // whatever it is made of: a constant does not jump
        let constant = values.is_defined() && values.is_point();
        Known {
            values,
            continuous: constant || !step.moves || self.continuous(step, values),
        }
    }

    /// What is known of an argument.
    fn of(&self, step: &Step, argument: usize) -> Known {
        self.known[step.arguments[argument]]
    }

    fn values(&self, step: &Step, cell: &[Interval]) -> Interval {
        let of = |argument: usize| self.of(step, argument).values;
        match step.op {
            Op::Constant(x) => Interval::point(x),
            Op::Symbol(_) => cell[step.side],
            Op::Unary(op, _) => Intervals.unary(op, &of(0)),
            Op::Powi(_, n) => Intervals.powi(&of(0), n),
            Op::Binary(op, ..) => Intervals.binary(op, &of(0), &of(1)),
            Op::Select(..) => Intervals.select(&of(0), &of(1), &of(2)),
            // a system has no value of its own, and must not pass for a constant
            Op::Solve(_) | Op::Implicit(_) => Interval::ENTIRE,
            Op::Entry(_, i) => {
                let entry = self.solved[step.arguments[0]].get(i as usize);
                entry.copied().unwrap_or(Interval::UNKNOWN)
            }
        }
    }

    fn solve(&self, i: usize) -> Vec<Interval> {
        let step = &self.steps[i];
        let arguments = step.arguments.iter();
        let values: Vec<Interval> = arguments.map(|&a| self.known[a].values).collect();
        if let Some(call) = self.graph.implicit_call(step.node) {
            return Intervals.implicit(&call.function, &values);
        }
        let n = self.unknowns(step.node);
        let (A, b) = values.split_at(n * n);
        let (mut x, condition) = Intervals.solve(A, b);
        x.push(condition);
        x
    }

    /// Number of unknowns of a linear system.
    fn unknowns(&self, system: Node) -> usize {
        self.graph.system(system).map_or(0, |system| system.size())
    }

    fn continuous(&self, step: &Step, values: Interval) -> bool {
        let of = |argument: usize| self.of(step, argument);
        let moves = |argument: usize| self.steps[step.arguments[argument]].moves;
        match step.op {
            Op::Constant(_) | Op::Symbol(_) => true,
            // they step where their values differ
            Op::Unary(Unary::Sign | Unary::Floor | Unary::Not, _)
            | Op::Binary(
                Binary::Less | Binary::LessEq | Binary::Equal | Binary::And | Binary::Or,
                ..,
            ) => false,
            Op::Binary(Binary::Atan2, ..) => {
                let cut = of(0).values.contains_zero() && of(1).values.lo() < 0.0;
                of(0).continuous && of(1).continuous && !(cut && moves(0))
            }
            Op::Binary(Binary::Pow, ..) => {
                // 0^0 is 1, and every number from 0 to 1 is near it
                let corner = of(0).values.contains_zero()
                    && of(1).values.contains_zero()
                    && !of(1).values.is_point();
                of(0).continuous && of(1).continuous && !corner
            }
            Op::Select(..) => match decided(of(0).values) {
                Some(true) => of(1).continuous,
                Some(false) => of(2).continuous,
                None => (!moves(0) || step.glued) && of(1).continuous && of(2).continuous,
            },
            // the condition estimate steps with the pivots; a root that is the only one of
            // equations that do not jump moves with them
            Op::Entry(system, i) => {
                let linear = matches!(self.steps[step.arguments[0]].op, Op::Solve(_));
                let last = linear && i as usize == self.unknowns(system);
                of(0).continuous && values.is_defined() && !last
            }
            Op::Unary(..) | Op::Powi(..) | Op::Binary(..) | Op::Solve(_) | Op::Implicit(_) => {
                let mut arguments = step.arguments.iter();
                arguments.all(|&a| self.known[a].continuous)
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
