//! Sparse symbolic Jacobians.

use std::collections::{BTreeMap, BTreeSet, HashMap};

use crate::partials::{Variation, is_steep, variation};
use crate::{Binary, Call, Graph, Node, Op, Unary};

/// A sparse matrix of expressions ∂(outputs)/∂(inputs).
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Jacobian {
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

fn times(graph: &Graph, a: Node, b: Node) -> Node {
    graph.binary(Binary::Mul, a, b)
}

/// Takes slope·d from a sum; without a slope, which is then −1, d is added.
fn take_from<K: Ord>(
    graph: &Graph,
    sums: &mut BTreeMap<K, Node>,
    key: K,
    slope: Option<Node>,
    d: Node,
) {
    let Some(slope) = slope else {
        return add_to(graph, sums, key, d);
    };
    let term = times(graph, slope, d);
    let less = match sums.get(&key) {
        Some(&sum) => graph.binary(Binary::Sub, sum, term),
        None => graph.unary(Unary::Neg, term),
    };
    sums.insert(key, less);
}

fn add_to<K: Ord>(graph: &Graph, sums: &mut BTreeMap<K, Node>, key: K, term: Node) {
    let sum = match sums.get(&key) {
        Some(&sum) => graph.binary(Binary::Add, sum, term),
        None => term,
    };
    sums.insert(key, sum);
}

fn zero(graph: &Graph) -> Node {
    graph.constant(0.0).node()
}

/// The Jacobian by forward accumulation: cheap where each node depends on few
/// inputs, as in a column of trays.
pub fn forward(graph: &Graph, outputs: &[Node], inputs: &[Node]) -> Jacobian {
    let one = graph.constant(1.0).node();
    let seeds = inputs.iter().enumerate();
    let seeds = seeds.map(|(column, &input)| (input, Tangent::from([(column, one)])));
    let tangents = accumulated(graph, outputs, seeds.collect(), None);
    let entries = outputs.iter().enumerate().flat_map(|(row, output)| {
        let tangent = tangents.get(output).into_iter().flatten();
        tangent.map(move |(&column, &node)| (row, column, node))
    });
    Jacobian {
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
    let mut solved: HashMap<Node, BTreeMap<usize, Vec<Node>>> = HashMap::new();
    for node in graph.reachable(outputs) {
        if let Some(call) = graph.system(node) {
            solved.insert(node, system_tangents(graph, node, &call, &tangents));
            continue;
        }
        let variation = variation(graph, node);
        if let Some(still) = &mut still {
            still.visit(node, &variation);
        }
        let tangent = match variation {
            Variation::Sum(terms) => {
                let op = graph.op(node);
                sum_tangent(graph, op, &terms, &tangents, still.as_ref())
            }
            Variation::Choice(c, a, b) => choice_tangent(graph, c, a, b, &tangents),
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
    graph: &Graph,
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
            let side = |d: &Tangent| d.get(column).copied().unwrap_or_else(|| zero(graph));
            (*column, graph.select(condition, side(da), side(db)))
        })
        .collect()
}

/// Of a system g(z, p) = 0, g_z dz = −g_p dp: dz for each input that p depends on.
fn system_tangents(
    graph: &Graph,
    node: Node,
    call: &Call,
    tangents: &HashMap<Node, Tangent>,
) -> BTreeMap<usize, Vec<Node>> {
    let mut right: BTreeMap<usize, BTreeMap<usize, Node>> = BTreeMap::new();
    if !call.arguments.iter().any(|p| tangents.contains_key(p)) {
        return BTreeMap::new();
    }
    for (row, argument, slope) in call.slopes(graph, node) {
        for (&column, &dp) in tangents.get(&argument).into_iter().flatten() {
            let sums = right.entry(column).or_default();
            take_from(graph, sums, row, slope, dp);
        }
    }
    let matrix = call.matrix(graph, node);
    let solved = |sums| solve(graph, call, &matrix, sums);
    let right = right.iter();
    right
        .map(|(&column, sums)| (column, solved(sums)))
        .collect()
}

/// The inputs that an output depends on, each with the slope by it, by reverse accumulation: cheap
/// however many inputs there are.
pub fn gradient(graph: &Graph, output: Node, inputs: &[Node]) -> Vec<(Node, Node)> {
    let adjoints = adjoints(graph, output, inputs);
    let slopes = inputs
        .iter()
        .map(|&input| Some((input, *adjoints.get(&input)?)));
    slopes.flatten().collect()
}

/// ∂(output)/∂(node) for every node that the output depends on; inputs count as
/// independent, also where they are expressions.
fn adjoints(graph: &Graph, output: Node, inputs: &[Node]) -> BTreeMap<Node, Node> {
    let mut adjoints = BTreeMap::from([(output, graph.constant(1.0).node())]);
    let mut results: HashMap<Node, BTreeMap<usize, Node>> = HashMap::new();
    for node in graph.reachable(&[output]).into_iter().rev() {
        if let Some(call) = graph.system(node) {
            if let Some(entries) = results.get(&node) {
                system_adjoints(graph, node, &call, entries, &mut adjoints);
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
                    add_to(graph, &mut adjoints, argument, times(graph, bar, slope));
                }
            }
            Variation::Choice(c, a, b) => {
                let zero = zero(graph);
                add_to(graph, &mut adjoints, a, graph.select(c, bar, zero));
                add_to(graph, &mut adjoints, b, graph.select(c, zero, bar));
            }
            Variation::Entry { system, entry } => {
                let entries = results.entry(system).or_default();
                entries.insert(entry as usize, bar);
            }
        }
    }
    adjoints
}

/// Of a system g(z, p) = 0, with g_zᵀ λ = z̄: p̄ −= g_pᵀ λ.
fn system_adjoints(
    graph: &Graph,
    node: Node,
    call: &Call,
    results: &BTreeMap<usize, Node>,
    adjoints: &mut BTreeMap<Node, Node>,
) {
    let n = call.size();
    let matrix = call.matrix(graph, node);
    let transposed: Vec<Node> = (0..n * n).map(|k| matrix[k % n * n + k / n]).collect();
    let λ = solve(graph, call, &transposed, results);
    for (row, argument, slope) in call.slopes(graph, node) {
        take_from(graph, adjoints, argument, slope, λ[row]);
    }
}

/// Solves with a matrix of slopes; that of a single unknown of an implicit function needs no
/// factorisation.
fn solve(graph: &Graph, call: &Call, matrix: &[Node], right: &BTreeMap<usize, Node>) -> Vec<Node> {
    let entry = |i| right.get(&i).copied().unwrap_or_else(|| zero(graph));
    let right: Vec<Node> = (0..call.size()).map(entry).collect();
    match (matrix, &right[..]) {
        (&[slope], &[right]) if call.function().is_some() => {
            vec![graph.binary(Binary::Div, right, slope)]
        }
        _ => graph.solve(matrix, &right).x,
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
        let mut row: Vec<usize> = graph
            .symbols_of(&[*output])
            .into_iter()
            .filter_map(|symbol| column.get(&symbol).copied())
            .collect();
        row.sort_unstable();
        row
    };
    outputs.iter().map(row).collect()
}

/// A derivative that is 0 where the guard holds, without that guard.
fn unguarded(graph: &Graph, derivative: Node, guard: Option<Node>) -> Node {
    match graph.op(derivative) {
        Op::Select(condition, zero, moving)
            if guard == Some(condition) && graph.constant_value(zero) == Some(0.0) =>
        {
            moving
        }
        _ => derivative,
    }
}

/// Σ slope·d(argument) of an operation. Where it is known what is still, steep slopes stand behind that
/// guard, and the same guard within is dropped: each question is asked once for all terms.
fn sum_tangent(
    graph: &Graph,
    op: Op,
    terms: &[(Node, Node)],
    tangents: &HashMap<Node, Tangent>,
    still: Option<&Still<'_>>,
) -> Tangent {
    let mut sums: BTreeMap<(usize, Option<Node>), Node> = BTreeMap::new();
    for &(argument, slope) in terms {
        let is_steep = is_steep(op) && graph.constant_value(slope).is_none();
        let guard = still.filter(|_| is_steep);
        let guard = guard.and_then(|still| still.condition(argument));
        for (&column, &d) in tangents.get(&argument).into_iter().flatten() {
            let d = unguarded(graph, d, guard);
            add_to(graph, &mut sums, (column, guard), times(graph, slope, d));
        }
    }
    let mut sum = Tangent::new();
    for ((column, guard), term) in sums {
        let term = guard.map_or(term, |is_still| graph.select(is_still, zero(graph), term));
        add_to(graph, &mut sum, column, term);
    }
    sum
}

/// Along which directions nothing moves: when each node stays what it is along a direction, whatever its slopes: where the direction has
/// no part in anything that the node depends on there. (That a product with a slope is 0 is not
/// enough: √(x²) has no derivative at 0, although that of x² is 0.)
struct Still<'g> {
    graph: &'g Graph,
    /// by node, what has to hold; nodes that are left out never move
    conditions: HashMap<Node, BTreeSet<Node>>,
}

impl<'g> Still<'g> {
    /// Inputs are still where their entry of the direction is 0.
    pub fn of(graph: &'g Graph, inputs: &[Node], direction: &[Node]) -> Self {
        let zero = graph.constant(0.0).node();
        let is_zero = |part: Node| BTreeSet::from([graph.binary(Binary::Equal, part, zero)]);
        let pairs = inputs.iter().zip(direction);
        Self {
            graph,
            conditions: pairs
                .map(|(input, part)| (*input, is_zero(*part)))
                .collect(),
        }
    }

    /// The next node, after its arguments. An input stays one, also where it is an expression.
    pub fn visit(&mut self, node: Node, variation: &Variation) {
        let conditions = match variation {
            Variation::Sum(terms) => self.all(terms.iter().map(|(argument, _)| argument)),
            Variation::Choice(condition, a, b) => self.chosen(*condition, *a, *b),
            Variation::Entry { system, .. } => self.all(&self.graph.arguments(*system)),
        };
        if !conditions.is_empty() {
            self.conditions.entry(node).or_insert(conditions);
        }
    }

    /// 1 where the node is still; none where it always is.
    pub fn condition(&self, node: Node) -> Option<Node> {
        let conditions = self.conditions.get(&node)?.iter().copied();
        conditions.reduce(|a, b| self.graph.binary(Binary::And, a, b))
    }

    fn all<'n>(&self, nodes: impl IntoIterator<Item = &'n Node>) -> BTreeSet<Node> {
        let conditions = nodes
            .into_iter()
            .filter_map(|node| self.conditions.get(node));
        conditions.flatten().copied().collect()
    }

    /// Of a branch that is not taken nothing is asked.
    fn chosen(&self, condition: Node, a: Node, b: Node) -> BTreeSet<Node> {
        if self.conditions.get(&a) == self.conditions.get(&b) {
            return self.all([&a]);
        }
        let and = |x, y| self.graph.binary(Binary::And, x, y);
        let not = || self.graph.unary(Unary::Not, condition);
        let (first, second) = match (self.condition(a), self.condition(b)) {
            (Some(a), Some(b)) => (and(condition, a), and(not(), b)),
            (Some(a), None) => (not(), a),
            (None, Some(b)) => (condition, b),
            (None, None) => return BTreeSet::new(),
        };
        BTreeSet::from([self.graph.binary(Binary::Or, first, second)])
    }
}

#[cfg(test)]
mod tests;
