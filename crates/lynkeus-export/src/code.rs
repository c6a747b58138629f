//! A tape as a list of operations that languages have.

use std::cell::RefCell;
use std::ops::Range;

use lynkeus_expr::{Algebra, Binary, Graph, Implicit, Node, Nodes, Op, Tape, Unary, jacobian};

use crate::factorise::{LARGEST, factorised};
use crate::{Refusal, dialect};

/// Operations over a graph of their own, for some outputs as functions of some inputs.
///
/// Linear systems remain operations, except where their condition is read: these are spelled
/// out, since what a language's own solver answers near singularity is another matter.
#[derive(Clone, Debug)]
pub struct Code {
    graph: Graph,
    inputs: Vec<Node>,
    outputs: Vec<Node>,
}

/// Some outputs of a tape.
#[derive(Clone, Debug)]
pub struct Part<'t> {
    /// its inputs are those of the code
    pub tape: &'t Tape,
    /// which outputs
    pub outputs: Range<usize>,
}

impl<'t> Part<'t> {
    /// All outputs.
    pub fn all(tape: &'t Tape) -> Self {
        Self {
            tape,
            outputs: 0..tape.outputs(),
        }
    }
}

/// What a language's solver of linear systems tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Solver {
    /// the solution alone
    Plain,
    /// the reciprocal condition as well, and bounded answers near singularity
    Conditioned,
}

impl Code {
    /// What a tape computes, for a language whose solver tells the solution alone.
    ///
    /// # Errors
    /// [`Refusal::Loop`] and [`Refusal::LargeSystem`].
    pub fn of(tape: &Tape) -> Result<Self, Refusal> {
        Self::of_parts(&[Part::all(tape)], Solver::Plain)
    }

    /// What tapes with the same inputs compute, one after the other.
    ///
    /// # Errors
    /// [`Refusal::Loop`] and [`Refusal::LargeSystem`].
    pub fn of_parts(parts: &[Part<'_>], solver: Solver) -> Result<Self, Refusal> {
        let (first, conditions) = Self::lowered(parts, &[])?;
        if solver == Solver::Conditioned {
            return Ok(first);
        }
        let needed = first.operations();
        let is_read = |rcond: &Node| needed.binary_search(rcond).is_ok();
        let read: Vec<bool> = conditions.iter().map(is_read).collect();
        match read.contains(&true) {
            true => Ok(Self::lowered(parts, &read)?.0),
            false => Ok(first),
        }
    }

    /// The code and the conditions of its linear systems, in the order of the tapes; those marked
    /// are spelled out.
    fn lowered(parts: &[Part<'_>], spelled: &[bool]) -> Result<(Self, Vec<Node>), Refusal> {
        let graph = Graph::new();
        let symbol = |i| graph.fresh(format!("input {i}")).node();
        let count = parts.first().map_or(0, |part| part.tape.inputs());
        let inputs: Vec<Node> = (0..count).map(symbol).collect();
        let lowering = Lowering {
            nodes: Nodes(&graph),
            spelled,
            found: RefCell::default(),
        };
        let outputs = parts.iter().flat_map(|part| {
            let all = part.tape.eval_in(&lowering, &inputs).into_iter();
            all.skip(part.outputs.start).take(part.outputs.len())
        });
        let outputs = outputs.collect();
        let Found {
            conditions,
            refusal,
        } = lowering.found.into_inner();
        match refusal {
            Some(refusal) => Err(refusal),
            None => Ok((
                Self {
                    graph,
                    inputs,
                    outputs,
                },
                conditions,
            )),
        }
    }

    /// How the outputs change along a direction: the product of their Jacobian with it, by the rules
    /// of differentiation. Its inputs are those of the code, then the direction, an entry for each of
    /// the first `moving` of them; the others stay. The condition of a linear system counts as constant where it is not spelled out.
    #[must_use]
    pub fn along(&self, moving: usize) -> Self {
        let graph = self.graph.clone();
        let part = |i| graph.fresh(format!("direction {i}")).node();
        let moving = &self.inputs[..moving.min(self.inputs.len())];
        let direction: Vec<Node> = (0..moving.len()).map(part).collect();
        Self {
            outputs: jacobian::along(&graph, &self.outputs, moving, &direction),
            inputs: [&self.inputs[..], &direction].concat(),
            graph,
        }
    }

    /// Which inputs each output depends on, in their order.
    pub fn dependencies(&self) -> Vec<Vec<usize>> {
        jacobian::pattern(&self.graph, &self.outputs, &self.inputs)
    }

    /// The operations.
    pub fn graph(&self) -> &Graph {
        &self.graph
    }

    /// The symbols that stand for the inputs.
    pub fn inputs(&self) -> &[Node] {
        &self.inputs
    }

    /// The outputs.
    pub fn outputs(&self) -> &[Node] {
        &self.outputs
    }

    /// Everything that the outputs need, arguments first.
    pub fn operations(&self) -> Vec<Node> {
        self.graph.reachable(&self.outputs)
    }

    /// Whether a linear system is left to the language.
    pub fn has_systems(&self) -> bool {
        let operations = self.operations();
        let mut ops = operations.iter().map(|&node| self.graph.op(node));
        ops.any(Op::is_system)
    }
}

#[derive(Default)]
struct Found {
    /// of the linear systems met
    conditions: Vec<Node>,
    refusal: Option<Refusal>,
}

/// The nodes of a graph, but for what no language has.
struct Lowering<'g> {
    nodes: Nodes<'g>,
    /// by linear system, in order
    spelled: &'g [bool],
    found: RefCell<Found>,
}

impl Algebra for Lowering<'_> {
    type Value = Node;

    fn constant(&self, value: f64) -> Node {
        self.nodes.constant(value)
    }

    fn unary(&self, op: Unary, x: &Node) -> Node {
        self.nodes.unary(op, x)
    }

    fn powi(&self, x: &Node, n: i32) -> Node {
        self.nodes.powi(x, n)
    }

    fn binary(&self, op: Binary, x: &Node, y: &Node) -> Node {
        self.nodes.binary(op, x, y)
    }

    /// A condition that is a number may be NaN: then nobody knows.
    fn select(&self, condition: &Node, x: &Node, y: &Node) -> Node {
        let graph = self.nodes.0;
        let chosen = self.nodes.select(condition, x, y);
        let op = graph.op(*condition);
        if dialect::is_truth(op) || matches!(op, Op::Constant(_)) {
            return chosen;
        }
        let is_known = graph.binary(Binary::Equal, *condition, *condition);
        graph.select(is_known, chosen, graph.constant(f64::NAN).node())
    }

    fn solve(&self, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
        let found = &mut *self.found.borrow_mut();
        let is_spelled = self.spelled.get(found.conditions.len());
        let (x, rcond) = match is_spelled {
            Some(true) if b.len() > LARGEST => {
                found.refusal = Some(Refusal::LargeSystem {
                    size: b.len(),
                    most: LARGEST,
                });
                self.nodes.solve(a, b)
            }
            Some(true) => factorised(self.nodes.0, a, b),
            _ => self.nodes.solve(a, b),
        };
        found.conditions.push(rcond);
        (x, rcond)
    }

    fn implicit(&self, function: &Implicit, _: &[Node]) -> Vec<Node> {
        let unknowns = function.names().to_vec();
        self.found.borrow_mut().refusal = Some(Refusal::Loop { unknowns });
        vec![self.constant(f64::NAN); function.size()]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::{ImplicitUnknown, Interval};

    #[test]
    fn a_loop_is_refused_with_its_unknowns() {
        let g = Graph::new();
        let (a, x) = (g.symbol("a"), g.symbol("x"));
        let unknown = ImplicitUnknown {
            symbol: a.node(),
            start: 0.0,
            range: Interval::ENTIRE,
        };
        let root = Implicit::solve(&g, &[unknown], &[(a + a.exp() - x).node()]).unwrap()[0];
        let tape = Tape::new(&g, &[x.node()], &[root]).unwrap();
        let refusal = Code::of(&tape).unwrap_err();
        assert_eq!(
            refusal,
            Refusal::Loop {
                unknowns: vec!["a".into()]
            }
        );
    }

    #[test]
    fn a_system_is_spelled_out_where_its_condition_is_read() {
        let g = Graph::new();
        let [a, b, c] = ["a", "b", "c"].map(|name| g.symbol(name));
        let inputs = [a, b, c].map(|e| e.node());
        let solution = g.solve(&[a, b, c, a * b].map(|e| e.node()), &[inputs[0], inputs[1]]);
        let plain = Tape::new(&g, &inputs, &solution.x).unwrap();
        assert!(Code::of(&plain).unwrap().has_systems());
        let read = Tape::new(&g, &inputs, &[solution.x[0], solution.rcond]).unwrap();
        let code = Code::of(&read).unwrap();
        assert!(!code.has_systems());
        let again = Tape::new(code.graph(), code.inputs(), code.outputs()).unwrap();
        let at = [0.7, -1.3, 0.4];
        let (mut ours, mut spelled) = ([0.0; 2], [0.0; 2]);
        read.evaluator().eval(&at, &mut ours);
        again.evaluator().eval(&at, &mut spelled);
        for (x, y) in ours.iter().zip(&spelled) {
            assert!((x - y).abs() <= 1e-15 * x.abs(), "{x} {y}");
        }
    }
}
