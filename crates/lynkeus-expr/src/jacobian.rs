//! Sparse symbolic Jacobians.

mod implicit;
mod still;
mod sums;

use std::collections::{BTreeMap, HashMap};

use crate::partials::{Variation, variation};
use crate::{Binary, Graph, Node, Op, Unary};

use still::Still;

/// A sparse matrix of expressions ∂(outputs)/∂(inputs).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jacobian {
    /// number of outputs
    pub rows: usize,
    /// number of inputs
    pub columns: usize,
    /// (row, column, expression), sorted; entries left out are zero everywhere
    pub entries: Vec<(usize, usize, Node)>,
}

impl Jacobian {
    /// The entry, where it is not zero everywhere.
    pub fn get(&self, row: usize, column: usize) -> Option<Node> {
        let place = self
            .entries
            .binary_search_by_key(&(row, column), |&(i, j, _)| (i, j));
        place.ok().map(|k| self.entries[k].2)
    }

    /// The entries of one row: (column, expression).
    pub fn row(&self, row: usize) -> impl Iterator<Item = (usize, Node)> + '_ {
        let start = self.entries.partition_point(|&(i, ..)| i < row);
        self.entries[start..]
            .iter()
            .take_while(move |&&(i, ..)| i == row)
            .map(|&(_, j, node)| (j, node))
    }
}

/// Derivative of one node with respect to each input it depends on.
type Tangent = BTreeMap<usize, Node>;

struct Builder<'g> {
    graph: &'g Graph,
}

impl Builder<'_> {
    fn times(&self, a: Node, b: Node) -> Node {
        self.graph.binary(Binary::Mul, a, b)
    }

    fn plus(&self, a: Option<Node>, b: Node) -> Node {
        match a {
            Some(a) => self.graph.binary(Binary::Add, a, b),
            None => b,
        }
    }

    fn minus(&self, a: Option<Node>, b: Node) -> Node {
        match a {
            Some(a) => self.graph.binary(Binary::Sub, a, b),
            None => self.graph.unary(Unary::Neg, b),
        }
    }

    fn add_to<K: Ord>(&self, sums: &mut BTreeMap<K, Node>, key: K, term: Node) {
        let sum = self.plus(sums.get(&key).copied(), term);
        sums.insert(key, sum);
    }

    fn zero(&self) -> Node {
        self.graph.constant(0.0).node()
    }
}

/// The Jacobian by forward accumulation: cheap where each node depends on few
/// inputs, as in a column of trays.
pub fn forward(graph: &Graph, outputs: &[Node], inputs: &[Node]) -> Jacobian {
    let one = graph.constant(1.0).node();
    let seeds = inputs.iter().enumerate();
    let seeds = seeds.map(|(column, &input)| (input, Tangent::from([(column, one)])));
    let tangents = accumulated(graph, outputs, seeds.collect(), None);
    let entries = outputs.iter().enumerate().flat_map(|(row, output)| {
        let tangent = tangents.get(output).cloned().unwrap_or_default();
        tangent
            .into_iter()
            .map(move |(column, node)| (row, column, node))
    });
    Jacobian {
        rows: outputs.len(),
        columns: inputs.len(),
        entries: entries.collect(),
    }
}

/// The product of the Jacobian with a direction, one entry for each input, by forward
/// accumulation: some operations for each of the graph's, however many inputs there are.
/// An entry of the direction that is 0 says nothing, also where a slope is infinite: √x does not
/// move at x = 0 along a direction in which x stays.
pub fn along(graph: &Graph, outputs: &[Node], inputs: &[Node], direction: &[Node]) -> Vec<Node> {
    let seeds = inputs.iter().zip(direction);
    let seeds = seeds.map(|(&input, &part)| (input, Tangent::from([(0, part)])));
    let still = Still::of(graph, inputs, direction);
    let tangents = accumulated(graph, outputs, seeds.collect(), Some(still));
    let of = |output| tangents.get(output)?.get(&0).copied();
    let zero = graph.constant(0.0).node();
    outputs.iter().map(|o| of(o).unwrap_or(zero)).collect()
}

/// The derivatives of every node that outputs need, from those of the inputs. Where it is known
/// along which directions a node is still, slopes count along the others only.
fn accumulated(
    graph: &Graph,
    outputs: &[Node],
    mut tangents: HashMap<Node, Tangent>,
    mut still: Option<Still<'_>>,
) -> HashMap<Node, Tangent> {
    let build = Builder { graph };
    let mut solved: HashMap<Node, BTreeMap<usize, Vec<Node>>> = HashMap::new();
    for node in graph.reachable(outputs) {
        let results = match graph.op(node) {
            Op::Solve(_) => Some(solve_tangents(&build, node, &tangents)),
            Op::Implicit(_) => Some(implicit::tangents(&build, node, &tangents)),
            _ => None,
        };
        if let Some(results) = results {
            solved.insert(node, results);
            continue;
        }
        let variation = variation(graph, node);
        if let Some(still) = &mut still {
            still.visit(node, &variation);
        }
        let tangent = match variation {
            Variation::Sum(terms) => {
                let op = graph.op(node);
                sums::tangent(&build, op, &terms, &tangents, still.as_ref())
            }
            Variation::Choice(c, a, b) => choice_tangent(&build, c, a, b, &tangents),
            Variation::Entry { system, entry } => solved[&system]
                .iter()
                .filter_map(|(&column, dx)| Some((column, *dx.get(entry as usize)?)))
                .collect(),
        };
        if !tangent.is_empty() {
            tangents.entry(node).or_insert(tangent);
        }
    }
    tangents
}

fn choice_tangent(
    build: &Builder<'_>,
    condition: Node,
    a: Node,
    b: Node,
    tangents: &HashMap<Node, Tangent>,
) -> Tangent {
    let empty = Tangent::new();
    let (da, db) = (
        tangents.get(&a).unwrap_or(&empty),
        tangents.get(&b).unwrap_or(&empty),
    );
    let columns = da.keys().chain(db.keys());
    columns
        .map(|column| {
            let side = |d: &Tangent| d.get(column).copied().unwrap_or_else(|| build.zero());
            (*column, build.graph.select(condition, side(da), side(db)))
        })
        .collect()
}

/// A dx = db − dA x, for each input that A or b depend on.
fn solve_tangents(
    build: &Builder<'_>,
    node: Node,
    tangents: &HashMap<Node, Tangent>,
) -> BTreeMap<usize, Vec<Node>> {
    let Some(system) = build.graph.system(node) else {
        return BTreeMap::new();
    };
    let (n, a, b) = (system.size(), system.matrix(), system.right());
    let mut right: BTreeMap<usize, BTreeMap<usize, Node>> = BTreeMap::new();
    for (i, b) in b.iter().enumerate() {
        for (&column, &db) in tangents.get(b).into_iter().flatten() {
            right.entry(column).or_default().insert(i, db);
        }
    }
    for (place, entry) in a.iter().enumerate() {
        let x = build.graph.entry(node, (place % n) as u32);
        for (&column, &da) in tangents.get(entry).into_iter().flatten() {
            let row = right.entry(column).or_default();
            let sum = build.minus(row.get(&(place / n)).copied(), build.times(da, x));
            row.insert(place / n, sum);
        }
    }
    let solve = |row: BTreeMap<usize, Node>| {
        let b: Vec<Node> = (0..n)
            .map(|i| row.get(&i).copied().unwrap_or_else(|| build.zero()))
            .collect();
        build.graph.solve(a, &b).x
    };
    right
        .into_iter()
        .map(|(column, row)| (column, solve(row)))
        .collect()
}

/// The Jacobian by reverse accumulation: cheap where outputs are few.
pub fn reverse(graph: &Graph, outputs: &[Node], inputs: &[Node]) -> Jacobian {
    let mut jacobian = Jacobian {
        rows: outputs.len(),
        columns: inputs.len(),
        entries: vec![],
    };
    for (row, &output) in outputs.iter().enumerate() {
        let adjoints = adjoints(graph, output, inputs);
        for (column, input) in inputs.iter().enumerate() {
            if let Some(&adjoint) = adjoints.get(input) {
                jacobian.entries.push((row, column, adjoint));
            }
        }
    }
    jacobian
}

/// ∂(output)/∂(node) for every node that the output depends on; inputs count as
/// independent, also where they are expressions.
fn adjoints(graph: &Graph, output: Node, inputs: &[Node]) -> BTreeMap<Node, Node> {
    let build = Builder { graph };
    let mut adjoints = BTreeMap::from([(output, graph.constant(1.0).node())]);
    let mut results: HashMap<Node, BTreeMap<u32, Node>> = HashMap::new();
    for node in graph.reachable(&[output]).into_iter().rev() {
        if graph.op(node).is_system() {
            if let Some(entries) = results.get(&node) {
                solve_adjoints(&build, node, entries, &mut adjoints);
                implicit::adjoints(&build, node, entries, &mut adjoints);
            }
            continue;
        }
        let Some(&bar) = adjoints.get(&node) else {
            continue;
        };
        if inputs.contains(&node) {
            continue;
        }
        match variation(graph, node) {
            Variation::Sum(terms) => {
                for (argument, slope) in terms {
                    build.add_to(&mut adjoints, argument, build.times(bar, slope));
                }
            }
            Variation::Choice(c, a, b) => {
                let zero = build.zero();
                build.add_to(&mut adjoints, a, graph.select(c, bar, zero));
                build.add_to(&mut adjoints, b, graph.select(c, zero, bar));
            }
            Variation::Entry { system, entry } => {
                results.entry(system).or_default().insert(entry, bar);
            }
        }
    }
    adjoints
}

/// With Aᵀλ = x̄: b̄ += λ and Ā −= λ xᵀ.
fn solve_adjoints(
    build: &Builder<'_>,
    node: Node,
    results: &BTreeMap<u32, Node>,
    adjoints: &mut BTreeMap<Node, Node>,
) {
    let Some(system) = build.graph.system(node) else {
        return;
    };
    let n = system.size();
    let bar: Vec<Node> = (0..n as u32)
        .map(|i| results.get(&i).copied().unwrap_or_else(|| build.zero()))
        .collect();
    let transposed: Vec<Node> = (0..n * n)
        .map(|k| system.matrix()[k % n * n + k / n])
        .collect();
    let λ = build.graph.solve(&transposed, &bar).x;
    for (i, &λi) in λ.iter().enumerate() {
        build.add_to(adjoints, system.right()[i], λi);
        for j in 0..n {
            let entry = system.matrix()[i * n + j];
            let term = build.times(λi, build.graph.entry(node, j as u32));
            let sum = build.minus(adjoints.get(&entry).copied(), term);
            adjoints.insert(entry, sum);
        }
    }
}

/// How many derivatives [`forward`] writes down: for each operation one for each input that it
/// depends on, and for a linear or an implicit system one for each entry of its matrix. None
/// where there are more than `most`; finding that out takes no more work than that.
pub fn size(graph: &Graph, outputs: &[Node], inputs: &[Node], most: usize) -> Option<usize> {
    let mut columns: HashMap<Node, Vec<usize>> = HashMap::new();
    for (column, &input) in inputs.iter().enumerate() {
        columns.insert(input, vec![column]);
    }
    let mut size: usize = 0;
    for node in graph.reachable(outputs) {
        if columns.contains_key(&node) {
            continue;
        }
        let arguments = graph.arguments(node);
        let below = arguments.iter().filter_map(|a| columns.get(a));
        let mut own: Vec<usize> = below.flatten().copied().collect();
        own.sort_unstable();
        own.dedup();
        let weight = if graph.op(node).is_system() {
            arguments.len()
        } else {
            1
        };
        size = size.saturating_add(weight.saturating_mul(own.len()));
        if size > most {
            return None;
        }
        if !own.is_empty() {
            columns.insert(node, own);
        }
    }
    Some(size)
}

/// Which inputs each output depends on, as a graph, without derivatives: row by
/// row the sorted indices into `inputs`.
pub fn pattern(graph: &Graph, outputs: &[Node], inputs: &[Node]) -> Vec<Vec<usize>> {
    let column: HashMap<Node, usize> = inputs.iter().copied().zip(0..).collect();
    let row = |output: &Node| {
        let mut row: Vec<usize> = local_symbols(graph, *output)
            .into_iter()
            .filter_map(|symbol| column.get(&symbol).copied())
            .collect();
        row.sort_unstable();
        row
    };
    outputs.iter().map(row).collect()
}

/// Symbols below a node by a walk that visits only its own sub-graph.
fn local_symbols(graph: &Graph, root: Node) -> Vec<Node> {
    let mut seen = std::collections::HashSet::from([root]);
    let mut stack = vec![root];
    let mut symbols = vec![];
    while let Some(node) = stack.pop() {
        if let Op::Symbol(_) = graph.op(node) {
            symbols.push(node);
        }
        stack.extend(
            graph
                .arguments(node)
                .into_iter()
                .filter(|&a| seen.insert(a)),
        );
    }
    symbols
}

#[cfg(test)]
mod tests;
