//! Gradients of outputs and their derivatives along the flow.

use super::{Flow, Program};
use crate::{Binary, Graph, MissingInput, Node, jacobian};

/// For each output and k = 0 … order, ∂y^(k)/∂x: one entry per state, none where it is zero
/// everywhere.
///
/// A gradient q along a solution goes on to that of the derivative, q̇ + qF with F = ∂f/∂x: so
/// the series of ∂h/∂x and of F along the flow give all of them, each with one coefficient less
/// than the one before. What a state does not reach costs nothing, and F is as sparse as the
/// plant, so that these are far fewer operations than the derivatives of
/// [`derivatives`](super::derivatives): n⁴/6 against 0.7·n⁴ for a chain of n states.
///
/// # Errors
/// [`MissingInput`] only if symbols of another graph are mixed in.
pub fn gradients(
    graph: &Graph,
    flow: &Flow<'_>,
    outputs: &[Node],
    order: usize,
) -> Result<Vec<Vec<Vec<Option<Node>>>>, MissingInput> {
    let x = super::states(graph, flow, order)?;
    let slopes = Series::new(graph, flow, &x, flow.derivatives, order.saturating_sub(1))?;
    let views = Series::new(graph, flow, &x, outputs, order)?;
    let n = flow.states.len();
    Ok((0..outputs.len())
        .map(|output| {
            let mut q = vec![vec![]; n];
            for (row, column, jet) in &views.entries {
                if *row == output {
                    q[*column].clone_from(jet);
                }
            }
            let mut rows = vec![heads(graph, &q)];
            for k in 0..order {
                if graph.is_spent() {
                    break;
                }
                q = slopes.carried(graph, &q, order - k - 1);
                rows.push(heads(graph, &q));
            }
            rows
        })
        .collect())
}

/// What the series are at the point itself.
fn heads(graph: &Graph, q: &[Vec<Node>]) -> Vec<Option<Node>> {
    let head = |jet: &Vec<Node>| {
        let first = jet.first().copied();
        first.filter(|&node| graph.constant_value(node) != Some(0.0))
    };
    q.iter().map(head).collect()
}

/// A sparse matrix as a series along the flow.
struct Series {
    /// row, column, and coefficients; those left out are zero
    entries: Vec<(usize, usize, Vec<Node>)>,
}

impl Series {
    /// ∂(functions)/∂x.
    fn new(
        graph: &Graph,
        flow: &Flow<'_>,
        x: &[Vec<Node>],
        functions: &[Node],
        order: usize,
    ) -> Result<Self, MissingInput> {
        let entries = jacobian::forward(graph, functions, flow.states).entries;
        let nodes: Vec<Node> = entries.iter().map(|&(.., node)| node).collect();
        let jets = Program::new(graph, flow, &nodes)?.run(graph, flow, x, order);
        let places = entries.into_iter().zip(jets);
        Ok(Self {
            entries: places.map(|((i, j, _), jet)| (i, j, jet)).collect(),
        })
    }

    /// q̇ + qF up to a coefficient.
    fn carried(&self, graph: &Graph, q: &[Vec<Node>], order: usize) -> Vec<Vec<Node>> {
        let mut carried: Vec<Vec<Option<Node>>> = q
            .iter()
            .map(|jet| {
                let rest = jet.iter().enumerate().skip(1).take(order + 1);
                let slope = |(k, &c): (usize, &Node)| (graph.expr(c) * k as f64).node();
                rest.map(|term| Some(slope(term))).collect()
            })
            .collect();
        for (row, column, jet) in &self.entries {
            if !q[*row].is_empty() {
                add_product(graph, &mut carried[*column], &q[*row], jet, order);
            }
        }
        let zero = graph.constant(0.0).node();
        let whole = |jet: Vec<Option<Node>>| jet.into_iter().map(|c| c.unwrap_or(zero)).collect();
        carried.into_iter().map(whole).collect()
    }
}

/// Adds the product of two series up to a coefficient.
fn add_product(graph: &Graph, sum: &mut Vec<Option<Node>>, a: &[Node], b: &[Node], order: usize) {
    let length = (a.len() + b.len() - 1).min(order + 1);
    sum.resize(sum.len().max(length), None);
    for (k, sum) in sum.iter_mut().enumerate().take(length) {
        for (i, &a) in a.iter().enumerate().take(k + 1) {
            let Some(&b) = b.get(k - i) else { continue };
            let term = graph.binary(Binary::Mul, a, b);
            *sum = Some(match *sum {
                None => term,
                Some(sum) => graph.binary(Binary::Add, sum, term),
            });
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::{InputJet, derivatives};
    use super::*;
    use crate::Tape;

    /// Values of the gradients beside those of the derivatives' own Jacobian, and how many
    /// operations both take.
    fn both(
        g: &Graph,
        flow: &Flow<'_>,
        outputs: &[Node],
        order: usize,
    ) -> ([Vec<f64>; 2], [usize; 2]) {
        let n = flow.states.len();
        let zero = g.constant(0.0).node();
        let found = gradients(g, flow, outputs, order).unwrap();
        let found = found.concat().concat().into_iter();
        let found: Vec<Node> = found.map(|node| node.unwrap_or(zero)).collect();
        let y = derivatives(g, flow, outputs, order).unwrap().concat();
        let slopes = jacobian::forward(g, &y, flow.states);
        let expected: Vec<Node> = (0..y.len() * n)
            .map(|k| slopes.get(k / n, k % n).unwrap_or(zero))
            .collect();
        let symbols = g.symbols_of(&[expected.clone(), found.clone()].concat());
        let point: Vec<f64> = (0..symbols.len())
            .map(|i| 0.4 + 0.3 * (2.3 * i as f64).sin())
            .collect();
        let tapes = [found, expected].map(|nodes| Tape::new(g, &symbols, &nodes).unwrap());
        let values = tapes.each_ref().map(|tape| {
            let mut values = vec![0.0; tape.outputs()];
            tape.evaluator().eval(&point, &mut values);
            values
        });
        (values, tapes.map(|tape| tape.len()))
    }

    fn assert_equal([found, expected]: [Vec<f64>; 2]) {
        assert!(found.iter().any(|v| *v != 0.0));
        for (found, expected) in found.iter().zip(&expected) {
            let off = (found - expected).abs() / expected.abs().max(1.0);
            assert!(off < 1e-12, "{found} against {expected}");
        }
    }

    /// Two outputs that read an input with its derivatives, the time, a quotient and a root.
    #[test]
    fn gradients_are_those_of_the_derivatives() {
        let g = Graph::new();
        let [x, y, z, u, du, t] = ["x", "y", "z", "u", "du", "t"].map(|name| g.symbol(name));
        let flow = Flow {
            time: t.node(),
            states: &[x.node(), y.node(), z.node()],
            derivatives: &[
                (y * z + u * x.sin()).node(),
                (x / (z * z + 1.0) - t * y).node(),
                (u - (x * x + 2.0).sqrt()).node(),
            ],
            inputs: &[InputJet {
                symbol: u.node(),
                derivatives: vec![u.node(), du.node()],
            }],
        };
        let outputs = [(x * y + u).node(), z.node()];
        for order in [0, 1, 2, 5] {
            assert_equal(both(&g, &flow, &outputs, order).0);
        }
    }

    /// The chain of the benchmark: as many operations as counted by hand, up to what Φ and F take.
    #[test]
    fn a_chain_takes_a_fourth_of_the_operations() {
        let n = 16;
        let g = Graph::new();
        let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
        let mut f: Vec<Node> = (1..n)
            .map(|i| (x[i] + 0.1 * x[0] * x[i - 1].sin()).node())
            .collect();
        f.push((-x[0] - x[n - 1].sin() * x[n - 2]).node());
        let states: Vec<Node> = x.iter().map(|x| x.node()).collect();
        let flow = Flow {
            time: g.symbol("t").node(),
            states: &states,
            derivatives: &f,
            inputs: &[],
        };
        let (values, [new, old]) = both(&g, &flow, &states[..1], n - 1);
        assert_equal(values);
        let by_hand = n.pow(4) / 6 + 3 * n.pow(3);
        assert!(new < by_hand && 2 * new < old, "{new}, {old}, {by_hand}");
    }
}
