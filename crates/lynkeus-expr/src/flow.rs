//! Derivatives of outputs along the solutions of x' = f(t, x, u).

mod gradients;

pub use gradients::gradients;

use crate::{Graph, Jets, MissingInput, Node, Nodes, Tape};

/// An input as a function of time, given by the expressions of u, u', u'', …;
/// derivatives beyond the last are zero.
#[derive(Clone, Debug)]
pub struct InputJet {
    /// the input's symbol
    pub symbol: Node,
    /// expressions of the input's derivatives of order 0, 1, 2, …; none for an
    /// input that is constant
    pub derivatives: Vec<Node>,
}

/// A system to differentiate along.
#[derive(Clone, Copy, Debug)]
pub struct Flow<'a> {
    /// symbol of time
    pub time: Node,
    /// symbols of the states
    pub states: &'a [Node],
    /// right-hand side, one expression per state
    pub derivatives: &'a [Node],
    /// inputs that vary; other symbols count as constants
    pub inputs: &'a [InputJet],
}

/// For each output the expressions of y, y', …, y^(order) along the flow. They
/// come from Taylor recurrences over graph nodes, so that their number grows
/// polynomially with the order where nested Lie derivatives swell.
///
/// # Errors
/// [`MissingInput`] only if symbols of another graph are mixed in.
pub fn derivatives(
    graph: &Graph,
    flow: &Flow<'_>,
    outputs: &[Node],
    order: usize,
) -> Result<Vec<Vec<Node>>, MissingInput> {
    let read = Program::new(graph, flow, outputs)?;
    let x = states(graph, flow, order)?;
    let mut y = read.run(graph, flow, &x, order);
    for jet in &mut y {
        let mut factorial = 1.0;
        *jet = (0..=order)
            .map(|k| {
                factorial *= k.max(1) as f64;
                (graph.expr(coefficient(graph, jet, k)) * factorial).node()
            })
            .collect();
    }
    Ok(y)
}

/// The Taylor coefficients of the states along the flow.
fn states(graph: &Graph, flow: &Flow<'_>, order: usize) -> Result<Vec<Vec<Node>>, MissingInput> {
    let right = Program::new(graph, flow, flow.derivatives)?;
    let mut x: Vec<Vec<Node>> = flow.states.iter().map(|&s| vec![s]).collect();
    for k in 0..order {
        if graph.is_spent() {
            break;
        }
        let f = right.run(graph, flow, &x, k);
        for (jet, f) in x.iter_mut().zip(f) {
            let next = coefficient(graph, &f, k);
            jet.push((graph.expr(next) / (k + 1) as f64).node());
        }
    }
    Ok(x)
}

fn coefficient(graph: &Graph, jet: &[Node], k: usize) -> Node {
    jet.get(k)
        .copied()
        .unwrap_or_else(|| graph.constant(0.0).node())
}

/// Expressions as a tape over all the symbols they depend on.
struct Program {
    tape: Tape,
    symbols: Vec<Node>,
}

impl Program {
    fn new(graph: &Graph, flow: &Flow<'_>, outputs: &[Node]) -> Result<Self, MissingInput> {
        let mut symbols = graph.symbols_of(outputs);
        symbols.extend(flow.states);
        symbols.sort_unstable();
        symbols.dedup();
        let tape = Tape::new(graph, &symbols, outputs)?;
        Ok(Self { tape, symbols })
    }

    /// The outputs' Taylor coefficients up to `order`, from those of the states.
    fn run(&self, graph: &Graph, flow: &Flow<'_>, x: &[Vec<Node>], order: usize) -> Vec<Vec<Node>> {
        let jet = |symbol: &Node| -> Vec<Node> {
            if let Some(i) = flow.states.iter().position(|s| s == symbol) {
                return x[i][..=order.min(x[i].len() - 1)].to_vec();
            }
            if let Some(input) = flow
                .inputs
                .iter()
                .find(|i| i.symbol == *symbol && !i.derivatives.is_empty())
            {
                return input_coefficients(graph, &input.derivatives, order);
            }
            if *symbol == flow.time && order > 0 {
                return vec![*symbol, graph.constant(1.0).node()];
            }
            vec![*symbol]
        };
        let inputs: Vec<Vec<Node>> = self.symbols.iter().map(jet).collect();
        let nodes = Nodes(graph);
        self.tape.eval_in(
            &Jets {
                inner: &nodes,
                order,
            },
            &inputs,
        )
    }
}

/// u^(k)/k!
fn input_coefficients(graph: &Graph, derivatives: &[Node], order: usize) -> Vec<Node> {
    let mut factorial = 1.0;
    let scaled = derivatives
        .iter()
        .take(order + 1)
        .enumerate()
        .map(|(k, &u)| {
            factorial *= k.max(1) as f64;
            (graph.expr(u) / factorial).node()
        });
    scaled.collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A pendulum θ' = ω, ω' = u − sin θ, y = θ: y‴ = u' − ω cos θ.
    #[test]
    fn input_derivatives_enter_the_output_derivatives() {
        let g = Graph::new();
        let [θ, ω, u, du, t] = ["θ", "ω", "u", "du", "t"].map(|name| g.symbol(name));
        let flow = Flow {
            time: t.node(),
            states: &[θ.node(), ω.node()],
            derivatives: &[ω.node(), (u - θ.sin()).node()],
            inputs: &[InputJet {
                symbol: u.node(),
                derivatives: vec![u.node(), du.node()],
            }],
        };
        let y = derivatives(&g, &flow, &[θ.node()], 3).unwrap();
        let inputs = [θ, ω, u, du].map(|e| e.node());
        let tape = Tape::new(&g, &inputs, &y[0]).unwrap();
        let (mut out, point) = ([0.0; 4], [0.3, -0.7, 0.2, 1.1]);
        tape.evaluator().eval(&point, &mut out);
        let expected = [0.3, -0.7, 0.2 - 0.3f64.sin(), 1.1 + 0.7 * 0.3f64.cos()];
        for (found, expected) in out.iter().zip(expected) {
            assert!(
                (found - expected).abs() < 1e-14,
                "{found} against {expected}"
            );
        }
    }

    #[test]
    fn explicit_time_is_differentiated() {
        let g = Graph::new();
        let t = g.symbol("t");
        let flow = Flow {
            time: t.node(),
            states: &[],
            derivatives: &[],
            inputs: &[],
        };
        let y = derivatives(&g, &flow, &[t.powi(3).node()], 3).unwrap();
        let mut out = [0.0; 4];
        Tape::new(&g, &[t.node()], &y[0])
            .unwrap()
            .evaluator()
            .eval(&[2.0], &mut out);
        assert_eq!(out, [8.0, 12.0, 12.0, 6.0]);
    }

    /// Nodes for a chain of n states grow polynomially where Lie derivatives swell.
    #[test]
    fn the_graph_of_the_observability_map_stays_small() {
        let nodes = |n: usize| {
            let g = Graph::new();
            let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
            let mut f: Vec<Node> = (1..n)
                .map(|i| (x[i] + 0.1 * x[0] * x[i - 1].sin()).node())
                .collect();
            f.push((-x[0] - x[n - 1].sin() * x[n.saturating_sub(2)]).node());
            let states: Vec<Node> = x.iter().map(|x| x.node()).collect();
            let time = g.symbol("t").node();
            let flow = Flow {
                time,
                states: &states,
                derivatives: &f,
                inputs: &[],
            };
            derivatives(&g, &flow, &states[..1], n - 1).unwrap();
            g.len() as f64
        };
        let exponent = (nodes(16) / nodes(8)).log2();
        assert!(exponent < 4.0, "grows like n^{exponent}");
    }
}
