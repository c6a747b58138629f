//! Small systems for tests.

use lynkeus_expr::{Expr, Graph, Node};
use lynkeus_run::System;

/// A system from (state, start, derivative), signals and outputs, by name.
pub fn system<'g>(
    g: &'g Graph,
    states: &[(&str, f64, Expr<'g>)],
    signals: &[&str],
    outputs: &[(&str, Expr<'g>)],
) -> System {
    let symbol = |name: &str| g.symbol(name).node();
    let named: Vec<(String, Node, f64)> = states
        .iter()
        .map(|(name, start, _)| (name.to_string(), symbol(name), *start))
        .collect();
    let signals: Vec<(String, Node)> = signals
        .iter()
        .map(|name| (name.to_string(), symbol(name)))
        .collect();
    let derivatives: Vec<Node> = states.iter().map(|(.., d)| d.node()).collect();
    let outputs: Vec<(String, Node)> = outputs
        .iter()
        .map(|(name, e)| (name.to_string(), e.node()))
        .collect();
    System::new(g, symbol("time"), &named, &signals, &derivatives, &outputs)
        .expect("the expressions read known symbols")
}
