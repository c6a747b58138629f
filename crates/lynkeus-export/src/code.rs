//! A tape as a list of operations that languages have.

use std::cell::RefCell;
use std::ops::Range;

use lynkeus_expr::{
    Algebra, Binary, Expr, Graph, Implicit, Node, Nodes, Op, Tape, Unary, jacobian,
};

use crate::Refusal;

/// Operations over a graph of their own, for some outputs as functions of some inputs.
///
/// Linear systems remain operations, except where their condition is read: these are spelled
/// out, since what a language's own solver answers near singularity is another matter.
#[derive(Clone, Debug)]
pub(crate) struct Code {
    graph: Graph,
    inputs: Vec<Node>,
    outputs: Vec<Node>,
}

/// Some outputs of a tape.
#[derive(Clone, Debug)]
pub(crate) struct Part<'t> {
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
pub(crate) enum Solver {
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
            conditions: RefCell::default(),
            refusal: RefCell::default(),
        };
        let outputs = parts.iter().flat_map(|part| {
            let all = part.tape.eval_in(&lowering, &inputs).into_iter();
            all.skip(part.outputs.start).take(part.outputs.len())
        });
        let outputs = outputs.collect();
        if let Some(refusal) = lowering.refusal.into_inner() {
            return Err(refusal);
        }
        let conditions = lowering.conditions.into_inner();
        let code = Self {
            graph,
            inputs,
            outputs,
        };
        Ok((code, conditions))
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

/// Whether an operation gives a truth value.
pub(crate) fn is_truth(op: Op) -> bool {
    match op {
        Op::Unary(op, _) => op == Unary::Not,
        Op::Binary(op, ..) => {
            use Binary::{And, Equal, Less, LessEq, Or};
            matches!(op, Less | LessEq | Equal | And | Or)
        }
        _ => false,
    }
}

/// The nodes of a graph, but for what no language has.
struct Lowering<'g> {
    nodes: Nodes<'g>,
    /// by linear system, in order
    spelled: &'g [bool],
    /// of the linear systems met
    conditions: RefCell<Vec<Node>>,
    refusal: RefCell<Option<Refusal>>,
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
        if is_truth(op) || matches!(op, Op::Constant(_)) {
            return chosen;
        }
        let is_known = graph.binary(Binary::Equal, *condition, *condition);
        graph.select(is_known, chosen, graph.constant(f64::NAN).node())
    }

    fn solve(&self, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
        let conditions = &mut *self.conditions.borrow_mut();
        let is_spelled = self.spelled.get(conditions.len());
        let (x, rcond) = match is_spelled {
            Some(true) if b.len() > LARGEST => {
                let (size, most) = (b.len(), LARGEST);
                *self.refusal.borrow_mut() = Some(Refusal::LargeSystem { size, most });
                self.nodes.solve(a, b)
            }
            Some(true) => factorised(self.nodes.0, a, b),
            _ => self.nodes.solve(a, b),
        };
        conditions.push(rcond);
        (x, rcond)
    }

    fn implicit(&self, function: &Implicit, _: &[Node]) -> Vec<Node> {
        let unknowns = function.names().to_vec();
        *self.refusal.borrow_mut() = Some(Refusal::Loop { unknowns });
        vec![self.constant(f64::NAN); function.size()]
    }
}

/// Unknowns of the largest system that is spelled out: the text grows with the cube.
const LARGEST: usize = 12;
/// Pivots smaller than this fraction of the largest count as zero, as in `lynkeus-expr`.
const RANK_TOLERANCE: f64 = 1e-13;

/// (x, reciprocal condition estimate); `a` is n×n row by row.
fn factorised(graph: &Graph, a: &[Node], b: &[Node]) -> (Vec<Node>, Node) {
    let n = b.len();
    let expr = |&node: &Node| graph.expr(node);
    let mut system = System {
        graph,
        a: a.chunks(n.max(1))
            .map(|row| row.iter().map(expr).collect())
            .collect(),
        b: b.iter().map(expr).collect(),
    };
    let swaps: Vec<_> = (0..n)
        .map(|k| {
            let swap = system.pivot(k);
            system.reflect(k);
            swap
        })
        .collect();
    let (mut x, rcond) = system.substituted();
    for (k, swap) in swaps.iter().enumerate().rev() {
        exchange(&mut x, k, swap);
    }
    (x.iter().map(|x| x.node()).collect(), rcond.node())
}

struct System<'g> {
    graph: &'g Graph,
    a: Vec<Vec<Expr<'g>>>,
    b: Vec<Expr<'g>>,
}

/// Entry k against the one of those after it whose truth value holds.
fn exchange<'g>(row: &mut [Expr<'g>], k: usize, chosen: &[Expr<'g>]) {
    let own = row[k];
    for (j, &is_chosen) in chosen.iter().enumerate() {
        let j = k + 1 + j;
        let other = row[j];
        row[k] = is_chosen.select(other, row[k]);
        row[j] = is_chosen.select(own, other);
    }
}

fn sum<'g>(graph: &'g Graph, terms: impl Iterator<Item = Expr<'g>>) -> Expr<'g> {
    let total = terms.reduce(|sum, term| sum + term);
    total.unwrap_or_else(|| graph.constant(0.0))
}

impl<'g> System<'g> {
    fn constant(&self, value: f64) -> Expr<'g> {
        self.graph.constant(value)
    }

    fn norm(&self, k: usize, j: usize) -> Expr<'g> {
        sum(self.graph, self.a[k..].iter().map(|row| row[j].powi(2)))
    }

    /// Brings the column of the remaining block with the largest norm to place k; tells by truth
    /// values which of those after k it was.
    fn pivot(&mut self, k: usize) -> Vec<Expr<'g>> {
        let mut best = self.norm(k, k);
        let mut is_better = vec![];
        for j in k + 1..self.b.len() {
            let norm = self.norm(k, j);
            let better = best.less(norm);
            best = better.select(norm, best);
            is_better.push(better);
        }
        // the last one that is better is the best
        let mut later: Option<Expr<'g>> = None;
        for better in is_better.iter_mut().rev() {
            let own = *better;
            *better = later.map_or(own, |later| own.and(!later));
            later = Some(later.map_or(own, |later| own.or(later)));
        }
        for row in &mut self.a {
            exchange(row, k, &is_better);
        }
        is_better
    }

    /// Householder reflection that zeroes column k below the diagonal.
    fn reflect(&mut self, k: usize) {
        let n = self.b.len();
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let column: Vec<Expr<'g>> = (k..n).map(|i| self.a[i][k]).collect();
        let sizes = column.iter().map(|entry| entry.abs());
        let largest = sizes.reduce(Expr::max).unwrap_or(zero);
        // a column of zeros has v = 0 and stays
        let is_zero = largest.equal(zero);
        let scale = is_zero.select(one, largest);
        let squares = sum(
            self.graph,
            column.iter().map(|&entry| (entry / scale).powi(2)),
        );
        let norm = largest * is_zero.select(one, squares).sqrt();
        let corner = column[0];
        let alpha = zero.less(corner).select(-norm, norm);
        let mut v: Vec<Expr<'g>> = column.iter().map(|&entry| entry / scale).collect();
        v[0] = corner / scale - alpha / scale;
        let vv = sum(self.graph, v.iter().map(|v| v.powi(2)));
        let vv = vv.equal(zero).select(one, vv);
        for j in k..n {
            let below: Vec<Expr<'g>> = (k..n).map(|i| self.a[i][j]).collect();
            for (i, entry) in reflected(self.graph, &v, vv, &below)
                .into_iter()
                .enumerate()
            {
                self.a[k + i][j] = entry;
            }
        }
        let b = reflected(self.graph, &v, vv, &self.b[k..]);
        self.b.splice(k.., b);
    }

    /// (x before columns are put back, reciprocal condition): what is lost is zero, what is NaN
    /// stays NaN.
    fn substituted(&self) -> (Vec<Expr<'g>>, Expr<'g>) {
        let n = self.b.len();
        let (zero, one) = (self.constant(0.0), self.constant(1.0));
        let Some(largest) = self.a.first().map(|row| row[0].abs()) else {
            return (vec![], one);
        };
        let mut alive: Vec<Expr<'g>> = vec![];
        for k in 0..n {
            let own = (RANK_TOLERANCE * largest).less(self.a[k][k].abs());
            alive.push(alive.last().map_or(own, |&before| before.and(own)));
        }
        let mut x = vec![zero; n];
        for k in (0..n).rev() {
            let (b, pivot) = (self.b[k], self.a[k][k]);
            let tail = (k + 1..n).map(|j| self.a[k][j] * x[j]);
            let rest = tail.fold(b, |rest, term| rest - term);
            let is_number = b.equal(b).and(pivot.equal(pivot));
            let lost = is_number.select(zero, self.constant(f64::NAN));
            x[k] = alive[k].select(rest / alive[k].select(pivot, one), lost);
        }
        let smallest = self.a[n - 1][n - 1].abs();
        let is_zero = largest.equal(zero);
        let ratio = (smallest / is_zero.select(one, largest)).min(one);
        (x, is_zero.select(zero, ratio))
    }
}

/// y − 2 (v·y)/(v·v) v
fn reflected<'g>(graph: &'g Graph, v: &[Expr<'g>], vv: Expr<'g>, y: &[Expr<'g>]) -> Vec<Expr<'g>> {
    let dot = sum(graph, v.iter().zip(y).map(|(&v, &y)| v * y));
    let factor = 2.0 * dot / vv;
    y.iter().zip(v).map(|(&y, &v)| y - factor * v).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use lynkeus_expr::{Algebra, Reals, Tape};
    use lynkeus_expr::{ImplicitUnknown, Interval};
    use proptest::prelude::*;

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

    fn spelled(n: usize) -> Tape {
        let graph = Graph::new();
        let symbols: Vec<Node> = (0..n * n + n)
            .map(|i| graph.symbol(&format!("s{i}")).node())
            .collect();
        let (mut outputs, rcond) = factorised(&graph, &symbols[..n * n], &symbols[n * n..]);
        outputs.push(rcond);
        Tape::new(&graph, &symbols, &outputs).unwrap()
    }

    fn same(n: usize, numbers: &[f64]) {
        let mut found = vec![0.0; n + 1];
        spelled(n).evaluator().eval(numbers, &mut found);
        let (mut expected, rcond) = Reals.solve(&numbers[..n * n], &numbers[n * n..]);
        let size = expected.iter().fold(1.0, |m: f64, x| m.max(x.abs()));
        expected.push(rcond);
        for (found, expected) in found.iter().zip(&expected) {
            let close = (found - expected).abs() <= 1e-14 * size / rcond.max(1e-13);
            assert!(
                close || found.is_nan() && expected.is_nan(),
                "{found} {expected}"
            );
        }
    }

    #[test]
    fn singular_systems_have_the_same_bounded_answer() {
        same(2, &[1.0, 1.0, 1.0, 1.0, 1.0, 2.0]);
        same(2, &[0.0, 0.0, 0.0, 0.0, 1.0, 2.0]);
        same(1, &[0.0, 3.0]);
        same(
            3,
            &[1.0, 2.0, 3.0, 2.0, 4.0, 6.0, 0.0, 0.0, 1.0, 1.0, 2.0, 3.0],
        );
    }

    #[test]
    fn nan_in_the_data_reaches_the_answer() {
        let mut found = [0.0; 3];
        let data = [f64::NAN, 0.0, 0.0, 1.0, 1.0, 2.0];
        spelled(2).evaluator().eval(&data, &mut found);
        assert!(found[..2].iter().any(|x| x.is_nan()));
    }

    proptest! {
        #[test]
        fn any_system_has_the_same_answer(numbers in prop::array::uniform20(-2.0..2.0)) {
            same(4, &numbers);
            same(1, &numbers[..2]);
        }
    }
}
