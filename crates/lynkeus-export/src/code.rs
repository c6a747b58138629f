//! Expressions as a list of operations that languages have.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Binary, Call, Expr, Graph, Node, Op, Unary, jacobian};

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

/// What a language's solver of linear systems tells.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Solver {
    /// the solution alone
    Plain,
    /// the reciprocal condition as well, and bounded answers near singularity
    Conditioned,
}

impl Code {
    /// Expressions of a graph as functions of the symbols `inputs`, all that they read, part by part.
    ///
    /// # Errors
    /// [`Refusal::Loop`] and [`Refusal::LargeSystem`].
    pub fn of(
        graph: &Graph,
        inputs: &[Node],
        parts: &[&[Node]],
        solver: Solver,
    ) -> Result<Self, Refusal> {
        let (first, conditions) = Self::lowered(graph, inputs, parts, HashSet::new())?;
        if solver == Solver::Conditioned {
            return Ok(first);
        }
        let needed = first.operations();
        let is_read = |rcond: &Node| needed.binary_search(rcond).is_ok();
        let read = conditions.into_iter().filter(|(_, rcond)| is_read(rcond));
        let read: HashSet<Node> = read.map(|(system, _)| system).collect();
        match read.is_empty() {
            true => Ok(first),
            false => Ok(Self::lowered(graph, inputs, parts, read)?.0),
        }
    }

    /// The code, and the condition of each linear system; those in `spelled` are spelled out.
    fn lowered(
        from: &Graph,
        inputs: &[Node],
        parts: &[&[Node]],
        spelled: HashSet<Node>,
    ) -> Result<(Self, HashMap<Node, Node>), Refusal> {
        let graph = Graph::new();
        let symbol = |i| graph.fresh(format!("input {i}")).node();
        let symbols: Vec<Node> = (0..inputs.len()).map(symbol).collect();
        let mut lowering = Lowering {
            from,
            to: &graph,
            spelled,
            images: inputs
                .iter()
                .copied()
                .zip(symbols.iter().copied())
                .collect(),
            results: HashMap::new(),
            conditions: HashMap::new(),
        };
        let mut outputs = vec![];
        for part in parts {
            outputs.extend(lowering.part(part)?);
        }
        let conditions = lowering.conditions;
        let code = Self {
            graph,
            inputs: symbols,
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

/// Takes expressions to another graph, but for what no language has.
struct Lowering<'g> {
    from: &'g Graph,
    to: &'g Graph,
    /// linear systems that are spelled out
    spelled: HashSet<Node>,
    /// of what was met, but of systems
    images: HashMap<Node, Node>,
    /// of systems: their unknowns, then the reciprocal condition
    results: HashMap<Node, Vec<Node>>,
    /// of linear systems
    conditions: HashMap<Node, Node>,
}

impl Lowering<'_> {
    /// The images of some expressions.
    fn part(&mut self, roots: &[Node]) -> Result<Vec<Node>, Refusal> {
        let (from, to) = (self.from, self.to);
        let mut nodes = from.reachable(roots);
        // a product is of its older factor first: numbers stand before what they multiply
        nodes.sort_by_key(|&node| from.constant_value(node).is_none());
        for node in nodes {
            if self.images.contains_key(&node) {
                continue;
            }
            let image = match from.op(node) {
                Op::System(_) => {
                    if let Some(call) = from.system(node) {
                        self.system(node, &call)?;
                    }
                    continue;
                }
                Op::Entry(system, entry) => Some(self.results[&system][entry as usize]),
                Op::Select(condition, x, y) => {
                    let [condition, x, y] = [condition, x, y].map(|node| self.images[&node]);
                    Some(self.select(condition, x, y))
                }
                _ => to.rebuilt(from, node, |argument| self.images[&argument]),
            };
            self.images.extend(image.map(|image| (node, image)));
        }
        Ok(roots.iter().map(|root| self.images[root]).collect())
    }

    /// A condition that is a number may be NaN: then nobody knows.
    fn select(&self, condition: Node, x: Node, y: Node) -> Node {
        let graph = self.to;
        let chosen = graph.select(condition, x, y);
        let op = graph.op(condition);
        if is_truth(op) || matches!(op, Op::Constant(_)) {
            return chosen;
        }
        let is_known = graph.binary(Binary::Equal, condition, condition);
        graph.select(is_known, chosen, graph.constant(f64::NAN).node())
    }

    fn system(&mut self, node: Node, call: &Call) -> Result<(), Refusal> {
        if self.results.contains_key(&node) {
            return Ok(());
        }
        let Some((a, b)) = call.linear() else {
            let unknowns = call.function().map_or(&[][..], |function| function.names());
            let unknowns = unknowns.to_vec();
            return Err(Refusal::Loop { unknowns });
        };
        let image = |nodes: &[Node]| -> Vec<Node> {
            nodes.iter().map(|argument| self.images[argument]).collect()
        };
        let (a, b) = (image(a), image(b));
        let (x, rcond) = match self.spelled.contains(&node) {
            true if b.len() > LARGEST => {
                let (size, most) = (b.len(), LARGEST);
                return Err(Refusal::LargeSystem { size, most });
            }
            true => factorised(self.to, &a, &b),
            false => {
                let solution = self.to.solve(&a, &b);
                (solution.x, solution.rcond)
            }
        };
        self.conditions.insert(node, rcond);
        self.results.insert(node, [&x[..], &[rcond]].concat());
        Ok(())
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
    use lynkeus_expr::{Implicit, ImplicitUnknown, Interval};
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
        let refusal = Code::of(&g, &[x.node()], &[&[root]], Solver::Plain).unwrap_err();
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
        let of = |outputs: &[Node]| Code::of(&g, &inputs, &[outputs], Solver::Plain).unwrap();
        assert!(of(&solution.x).has_systems());
        let outputs = [solution.x[0], solution.rcond];
        let code = of(&outputs);
        assert!(!code.has_systems());
        let read = Tape::new(&g, &inputs, &outputs).unwrap();
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
