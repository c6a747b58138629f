//! Derivatives along flows whose solutions are known.

use lynkeus_expr::flow::{Flow, InputJet, derivatives};
use lynkeus_expr::{Expr, Graph, Node, Tape};

/// y, y', … of the first state at a point.
fn along(
    graph: &Graph,
    states: &[Expr<'_>],
    f: &[Expr<'_>],
    inputs: &[InputJet],
    point: &[(Expr<'_>, f64)],
) -> [f64; 7] {
    let nodes = |list: &[Expr<'_>]| -> Vec<Node> { list.iter().map(|x| x.node()).collect() };
    let (states, f) = (nodes(states), nodes(f));
    let flow = Flow {
        time: graph.symbol("t").node(),
        states: &states,
        derivatives: &f,
        inputs,
    };
    let y = derivatives(graph, &flow, &states[..1], 6).expect("one graph");
    let symbols: Vec<Node> = point.iter().map(|(x, _)| x.node()).collect();
    let values: Vec<f64> = point.iter().map(|&(_, value)| value).collect();
    let mut out = [0.0; 7];
    let tape = Tape::new(graph, &symbols, &y[0]).expect("all symbols have values");
    tape.evaluator().eval(&values, &mut out);
    out
}

fn close(found: [f64; 7], expected: [f64; 7]) {
    for (found, expected) in found.iter().zip(expected) {
        let off = (found - expected).abs() / expected.abs().max(1.0);
        assert!(off < 1e-13, "{found} for {expected}");
    }
}

/// x' = x² has x = x₀/(1 − x₀t), so x⁽ᵏ⁾ = k! x₀ᵏ⁺¹.
#[test]
fn a_pole_ahead() {
    let graph = Graph::new();
    let x = graph.symbol("x");
    let found = along(&graph, &[x], &[x.powi(2)], &[], &[(x, 0.5)]);
    let mut factorial = 1.0;
    let expected = std::array::from_fn(|k| {
        factorial *= k.max(1) as f64;
        factorial * 0.5_f64.powi(k as i32 + 1)
    });
    close(found, expected);
}

/// An oscillator: x⁽ᵏ⁾ turns by a quarter each time.
#[test]
fn an_oscillator() {
    let graph = Graph::new();
    let [x, v] = ["x", "v"].map(|name| graph.symbol(name));
    let found = along(
        &graph,
        &[x, v],
        &[2.0 * v, -2.0 * x],
        &[],
        &[(x, 0.6), (v, -0.8)],
    );
    close(found, [0.6, -1.6, -2.4, 6.4, 9.6, -25.6, -38.4]);
}

/// x' = u with u = sin t given by its own derivatives.
#[test]
fn an_input_with_derivatives() {
    let graph = Graph::new();
    let [x, u, t] = ["x", "u", "t"].map(|name| graph.symbol(name));
    let input = InputJet {
        symbol: u.node(),
        derivatives: [t.sin(), t.cos(), -t.sin(), -t.cos(), t.sin(), t.cos()]
            .map(|e| e.node())
            .to_vec(),
    };
    let found = along(&graph, &[x], &[u], &[input], &[(x, 0.0), (t, 0.7)]);
    let (s, c) = (0.7_f64.sin(), 0.7_f64.cos());
    close(found, [0.0, s, c, -s, -c, s, c]);
}

/// x' = −x + t has x' = 1 + (x₀' − 1)e⁻ᵗ: explicit time enters once.
#[test]
fn explicit_time() {
    let graph = Graph::new();
    let [x, t] = ["x", "t"].map(|name| graph.symbol(name));
    let found = along(&graph, &[x], &[t - x], &[], &[(x, 2.0), (t, 0.5)]);
    close(found, [2.0, -1.5, 2.5, -2.5, 2.5, -2.5, 2.5]);
}

/// M x'' = b with a constant matrix: x' comes from a linear system.
#[test]
fn a_linear_system_in_the_right_hand_side() {
    let graph = Graph::new();
    let [x, y] = ["x", "y"].map(|name| graph.symbol(name));
    let constant = |value: f64| graph.constant(value).node();
    let matrix = [constant(2.0), constant(1.0), constant(1.0), constant(1.0)];
    // x' = x − y and y' = −x + 2y.
    let rates = graph.solve(&matrix, &[x.node(), y.node()]).x;
    let found = along(
        &graph,
        &[x, y],
        &[graph.expr(rates[0]), graph.expr(rates[1])],
        &[],
        &[(x, 1.0), (y, 0.0)],
    );
    close(found, [1.0, 1.0, 2.0, 5.0, 13.0, 34.0, 89.0]);
}
