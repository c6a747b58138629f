//! Derivatives of implicit functions: g_z dz = −g_p dp.

use std::collections::{BTreeMap, HashMap};

use super::{Builder, Tangent};
use crate::{Binary, Node, Nodes};

/// dz for each input that p depends on.
pub(super) fn tangents(
    build: &Builder<'_>,
    node: Node,
    tangents: &HashMap<Node, Tangent>,
) -> BTreeMap<usize, Vec<Node>> {
    let Some(call) = build.graph.implicit_call(node) else {
        return BTreeMap::new();
    };
    if !call.arguments.iter().any(|p| tangents.contains_key(p)) {
        return BTreeMap::new();
    }
    let at = call.at(build.graph, node);
    let mut right: BTreeMap<usize, BTreeMap<usize, Node>> = BTreeMap::new();
    for (row, place, slope) in call.function.sensitivities(build.graph, &at) {
        for (&column, &dp) in tangents.get(&call.arguments[place]).into_iter().flatten() {
            let sums = right.entry(column).or_default();
            let sum = build.minus(sums.get(&row).copied(), build.times(slope, dp));
            sums.insert(row, sum);
        }
    }
    let matrix = call.function.matrix(&Nodes(build.graph), &at);
    let solved = |sums: &BTreeMap<usize, Node>| {
        let right: Vec<Node> = (0..call.function.size())
            .map(|row| sums.get(&row).copied().unwrap_or_else(|| build.zero()))
            .collect();
        solve(build, &matrix, &right)
    };
    right
        .iter()
        .map(|(&column, sums)| (column, solved(sums)))
        .collect()
}

/// With g_zᵀ λ = z̄: p̄ −= g_pᵀ λ.
pub(super) fn adjoints(
    build: &Builder<'_>,
    node: Node,
    results: &BTreeMap<u32, Node>,
    adjoints: &mut BTreeMap<Node, Node>,
) {
    let Some(call) = build.graph.implicit_call(node) else {
        return;
    };
    let (n, at) = (call.function.size(), call.at(build.graph, node));
    let matrix = call.function.matrix(&Nodes(build.graph), &at);
    let transposed: Vec<Node> = (0..n * n).map(|k| matrix[k % n * n + k / n]).collect();
    let bar: Vec<Node> = (0..n as u32)
        .map(|i| results.get(&i).copied().unwrap_or_else(|| build.zero()))
        .collect();
    let λ = solve(build, &transposed, &bar);
    for (row, place, slope) in call.function.sensitivities(build.graph, &at) {
        let argument = call.arguments[place];
        let term = build.times(λ[row], slope);
        let sum = build.minus(adjoints.get(&argument).copied(), term);
        adjoints.insert(argument, sum);
    }
}

/// A single unknown needs no factorisation.
fn solve(build: &Builder<'_>, matrix: &[Node], right: &[Node]) -> Vec<Node> {
    match (matrix, right) {
        (&[slope], &[right]) => vec![build.graph.binary(Binary::Div, right, slope)],
        _ => build.graph.solve(matrix, right).x,
    }
}
