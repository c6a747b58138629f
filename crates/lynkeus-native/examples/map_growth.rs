//! How the observability map grows with the number of states.
//!
//! x_i' = x_{i+1} + 0.1 x_1 sin x_i, x_n' = −x_1 − sin(x_n) x_{n−1}, y = x_1: the
//! derivatives y, y', …, y^(n−1) along the flow and their Jacobian Q, as expressions.
//!
//! ```text
//! cargo run --release -p lynkeus-expr --example map_growth
//! ```

use std::error::Error;
use std::io::{self, Write};
use std::time::{Duration, Instant};

use lynkeus_expr::flow::{self, Flow};
use lynkeus_expr::{Graph, Node, Tape, jacobian};

struct Growth {
    map: usize,
    with_jacobian: usize,
    built: Duration,
    evaluated: Duration,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "| n | operations of Φ | of Φ and Q | built in | Q evaluated in |"
    )?;
    writeln!(out, "|---|---|---|---|---|")?;
    let mut last: Option<(usize, usize)> = None;
    let mut exponent = 0.0;
    for n in [4, 6, 8, 12, 16, 20, 24, 28, 32] {
        let found = growth(n)?;
        writeln!(
            out,
            "| {n} | {} | {} | {:.2} ms | {:.1} µs |",
            found.map,
            found.with_jacobian,
            1e3 * found.built.as_secs_f64(),
            1e6 * found.evaluated.as_secs_f64(),
        )?;
        if let Some((n0, before)) = last {
            exponent =
                (found.with_jacobian as f64 / before as f64).ln() / (n as f64 / n0 as f64).ln();
        }
        last = Some((n, found.with_jacobian));
    }
    writeln!(out, "\nlocally like n^{exponent:.2} at the end")?;
    Ok(())
}

fn growth(n: usize) -> Result<Growth, Box<dyn Error>> {
    let start = Instant::now();
    let g = Graph::new();
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
    let mut f: Vec<Node> = (1..n)
        .map(|i| (x[i] + 0.1 * x[0] * x[i - 1].sin()).node())
        .collect();
    f.push((-x[0] - x[n - 1].sin() * x[n - 2]).node());
    let states: Vec<Node> = x.iter().map(|x| x.node()).collect();
    let flow = Flow {
        time: g.symbol("time").node(),
        states: &states,
        derivatives: &f,
        inputs: &[],
    };
    let Φ = flow::derivatives(&g, &flow, &states[..1], n - 1)?.concat();
    let map = Tape::new(&g, &states, &Φ)?.len();
    let Q: Vec<Node> = jacobian::forward(&g, &Φ, &states)
        .entries
        .into_iter()
        .map(|(.., entry)| entry)
        .collect();
    let tape = Tape::new(&g, &states, &[Φ, Q].concat())?;
    let built = start.elapsed();
    let point: Vec<f64> = (0..n).map(|i| 0.3 + 0.01 * i as f64).collect();
    let mut values = vec![0.0; tape.outputs()];
    let mut evaluator = tape.evaluator();
    let start = Instant::now();
    let repetitions = 20;
    for _ in 0..repetitions {
        evaluator.eval(&point, &mut values);
    }
    Ok(Growth {
        map,
        with_jacobian: tape.len(),
        built,
        evaluated: start.elapsed() / repetitions,
    })
}
