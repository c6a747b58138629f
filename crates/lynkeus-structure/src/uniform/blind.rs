//! Constant inputs for which the outputs do not tell states apart.

use std::collections::{HashMap, HashSet};

use lynkeus_expr::{Graph, MissingInput, Node};

use crate::output_map::jacobian_rows;
use crate::points::inside;
use crate::{Extended, Region, Verdict, vanishes};

/// A constant input that blinds the outputs.
#[derive(Clone, Debug, PartialEq)]
pub struct Blind {
    /// name of the input
    pub input: String,
    /// its value
    pub value: f64,
    /// states that then act on no output, not even through others: two states of the
    /// plant that differ only in these cannot be told apart
    pub hidden: Vec<String>,
    /// two such states, where there is a hidden one: by name, in the box
    pub alike: Option<[Vec<(String, f64)>; 2]>,
}

/// Constant inputs, of zero and the ends and middles of their ranges, for which the
/// determinant is zero whatever the state.
pub(super) fn blind(
    extended: &Extended<'_>,
    node: Node,
    region: &Region,
) -> Result<Vec<Blind>, MissingInput> {
    let graph = extended.graph();
    let mut found = vec![];
    for input in &extended.inputs {
        let ends = [
            0.0,
            input.min,
            input.max,
            match input.integer {
                true => f64::midpoint(input.min, input.max).floor(),
                false => f64::midpoint(input.min, input.max),
            },
        ];
        let inside = |x: &f64| {
            let whole = !input.integer || x.fract() == 0.0;
            x.is_finite() && *x >= input.min && *x <= input.max && whole
        };
        let mut tried: Vec<f64> = vec![];
        for value in ends.into_iter().filter(inside) {
            if tried.contains(&value) {
                continue;
            }
            tried.push(value);
            let fixed = HashMap::from([(input.node, graph.constant(value).node())]);
            let there = graph.substitute(&[node], &fixed)[0];
            if vanishes(graph, there, region)? == Verdict::Proved {
                let hidden = hidden(extended, &fixed, region)?;
                found.push(Blind {
                    input: input.name.clone(),
                    value,
                    alike: (!hidden.is_empty()).then(|| alike(extended, &hidden)),
                    hidden,
                });
            }
        }
    }
    Ok(found)
}

/// Two states that differ in the hidden ones only: a quarter and three quarters up
/// their ranges, the others in the middle.
fn alike(extended: &Extended<'_>, hidden: &[String]) -> [Vec<(String, f64)>; 2] {
    [0.25, 0.75].map(|share| {
        let value = |v: &lynkeus_model::Variable| {
            let share = if hidden.contains(&v.name) { share } else { 0.5 };
            (v.name.clone(), inside(v.min, v.max, share))
        };
        extended.states.iter().map(value).collect()
    })
}

/// States from which no path of dependencies leads to an output.
fn hidden(
    extended: &Extended<'_>,
    fixed: &HashMap<Node, Node>,
    region: &Region,
) -> Result<Vec<String>, MissingInput> {
    let graph = extended.graph();
    let symbols = extended.symbols();
    let outputs = extended.outputs.iter().map(|o| o.variable.node);
    let functions: Vec<Node> = outputs
        .chain(extended.derivatives.iter().copied())
        .collect();
    let partials = jacobian_rows(graph, &functions, &symbols);
    let first = extended.outputs.len();
    let mut seen = vec![false; symbols.len()];
    let mut open: Vec<usize> = (0..first).collect();
    while let Some(row) = open.pop() {
        let function = graph.substitute(&[functions[row]], fixed)[0];
        let jumping = jumping(graph, function);
        for (state, partial) in partials[row].iter().enumerate() {
            if seen[state] {
                continue;
            }
            let there = partial.map(|partial| graph.substitute(&[partial], fixed)[0]);
            let is_still = there.map(|there| vanishes(graph, there, region));
            let moves = is_still
                .transpose()?
                .is_some_and(|verdict| verdict != Verdict::Proved);
            if moves || jumping.contains(&symbols[state]) {
                seen[state] = true;
                open.push(first + state);
            }
        }
    }
    let names = extended.states.iter().zip(&seen);
    Ok(names
        .filter(|(_, seen)| !**seen)
        .map(|(s, _)| s.name.clone())
        .collect())
}

/// The variables with which a function may jump, which its derivatives do not show.
fn jumping(graph: &Graph, function: Node) -> HashSet<Node> {
    let mut jumps = graph.reachable(&graph.with_residuals(&[function]));
    jumps.retain(|&node| graph.jumps(node));
    graph.symbols_of(&jumps).into_iter().collect()
}
