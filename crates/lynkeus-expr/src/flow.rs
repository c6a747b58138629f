//! Derivatives of outputs along the solutions of x' = f(t, x, u), and their gradients.

use crate::{Binary, Graph, Jets, MissingInput, Node, Nodes, Tape, jacobian};

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
    let read = along(graph, flow, outputs)?;
    let mut y = read(&states(graph, flow, order)?, order);
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
    let right = along(graph, flow, flow.derivatives)?;
    let mut x: Vec<Vec<Node>> = flow.states.iter().map(|&s| vec![s]).collect();
    for k in 0..order {
        if graph.is_spent() {
            break;
        }
        let f = right(&x, k);
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

/// The Taylor coefficients of some quantities, one list each.
type Coefficients = Vec<Vec<Node>>;

/// Functions along the flow: their Taylor coefficients up to an order, from those of the states.
fn along<'a>(
    graph: &'a Graph,
    flow: &'a Flow<'_>,
    functions: &[Node],
) -> Result<impl Fn(&[Vec<Node>], usize) -> Coefficients + 'a, MissingInput> {
    let mut symbols = graph.symbols_of(functions);
    symbols.extend(flow.states);
    symbols.sort_unstable();
    symbols.dedup();
    let tape = Tape::new(graph, &symbols, functions)?;
    Ok(move |x: &[Vec<Node>], order: usize| {
        let jet = |symbol: &Node| -> Vec<Node> {
            if let Some(i) = flow.states.iter().position(|s| s == symbol) {
                return x[i][..=order.min(x[i].len() - 1)].to_vec();
            }
            let input = flow.inputs.iter().find(|i| i.symbol == *symbol);
            match input.filter(|input| !input.derivatives.is_empty()) {
                Some(input) => input_coefficients(graph, &input.derivatives, order),
                None if *symbol == flow.time && order > 0 => {
                    vec![*symbol, graph.constant(1.0).node()]
                }
                None => vec![*symbol],
            }
        };
        let inputs: Vec<Vec<Node>> = symbols.iter().map(jet).collect();
        let inner = &Nodes(graph);
        tape.eval_in(&Jets { inner, order }, &inputs)
    })
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

/// For each output and k = 0 … order, ∂y^(k)/∂x: one entry per state, none where it is zero
/// everywhere.
///
/// A gradient q along a solution goes on to that of the derivative, q̇ + qF with F = ∂f/∂x: so
/// the series of ∂h/∂x and of F along the flow give all of them, each with one coefficient less
/// than the one before. What a state does not reach costs nothing, and F is as sparse as the
/// plant, so that these are far fewer operations than the derivatives of
/// [`derivatives`]: n⁴/6 against 0.7·n⁴ for a chain of n states.
///
/// # Errors
/// [`MissingInput`] only if symbols of another graph are mixed in.
pub fn gradients(
    graph: &Graph,
    flow: &Flow<'_>,
    outputs: &[Node],
    order: usize,
) -> Result<Vec<Vec<Vec<Option<Node>>>>, MissingInput> {
    let x = states(graph, flow, order)?;
    let F = slopes(graph, flow, &x, flow.derivatives, order.saturating_sub(1))?;
    let views = slopes(graph, flow, &x, outputs, order)?;
    let n = flow.states.len();
    Ok((0..outputs.len())
        .map(|output| {
            let mut q = vec![vec![]; n];
            for (row, column, jet) in &views {
                if *row == output {
                    q[*column].clone_from(jet);
                }
            }
            let mut rows = vec![heads(graph, &q)];
            for k in 0..order {
                if graph.is_spent() {
                    break;
                }
                q = carried(graph, &F, &q, order - k - 1);
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

/// A sparse matrix as a series along the flow: row, column, and coefficients; those left out are zero.
type Series = Vec<(usize, usize, Vec<Node>)>;

/// ∂(functions)/∂x.
fn slopes(
    graph: &Graph,
    flow: &Flow<'_>,
    x: &[Vec<Node>],
    functions: &[Node],
    order: usize,
) -> Result<Series, MissingInput> {
    let entries = jacobian::forward(graph, functions, flow.states).entries;
    let nodes: Vec<Node> = entries.iter().map(|&(.., node)| node).collect();
    let jets = along(graph, flow, &nodes)?(x, order);
    let places = entries.into_iter().zip(jets);
    Ok(places.map(|((i, j, _), jet)| (i, j, jet)).collect())
}

/// q̇ + qF up to a coefficient.
fn carried(graph: &Graph, F: &Series, q: &[Vec<Node>], order: usize) -> Vec<Vec<Node>> {
    let mut carried: Vec<Vec<Option<Node>>> = q
        .iter()
        .map(|jet| {
            let rest = jet.iter().enumerate().skip(1).take(order + 1);
            let slope = |(k, &c): (usize, &Node)| (graph.expr(c) * k as f64).node();
            rest.map(|term| Some(slope(term))).collect()
        })
        .collect();
    for (row, column, jet) in F {
        if !q[*row].is_empty() {
            add_product(graph, &mut carried[*column], &q[*row], jet, order);
        }
    }
    let zero = graph.constant(0.0).node();
    let whole = |jet: Vec<Option<Node>>| jet.into_iter().map(|c| c.unwrap_or(zero)).collect();
    carried.into_iter().map(whole).collect()
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
    use super::*;
    use crate::Tape;

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
