//! How the observability map grows with the number of states.
//!
//! x_i' = x_{i+1} + 0.1 x_1 sin x_i, x_n' = −x_1 − sin(x_n) x_{n−1}, y = x_1: the
//! derivatives y, y', …, y^(n−1) along the flow and their Jacobian Q, as expressions,
//! evaluated by the interpreter and as machine code.
//!
//! ```text
//! cargo run --release -p lynkeus-native --example map_growth
//! ```

use std::error::Error;
use std::io::{self, Write};
use std::time::{Duration, Instant};

use lynkeus_expr::flow::{self, Flow};
use lynkeus_expr::{Graph, Node, Tape};
use lynkeus_native::Function;

struct Growth {
    map: usize,
    with_jacobian: usize,
    built: Duration,
    interpreted: Duration,
    /// none where no machine code can be made
    native: Option<Native>,
}

struct Native {
    compiled: Duration,
    evaluated: Duration,
}

fn main() -> Result<(), Box<dyn Error>> {
    let mut out = io::stdout().lock();
    writeln!(
        out,
        "| n | operations of Φ | of Φ and Q | built in | evaluated in | compiled in | machine code |"
    )?;
    writeln!(out, "|---|---|---|---|---|---|---|")?;
    let mut last: Option<(usize, usize)> = None;
    let mut exponent = 0.0;
    for n in [4, 6, 8, 12, 16, 20, 24, 28, 32] {
        let found = growth(n)?;
        let native = match &found.native {
            Some(native) => format!(
                "{} | {}",
                milliseconds(native.compiled),
                microseconds(native.evaluated)
            ),
            None => "none | none".to_owned(),
        };
        writeln!(
            out,
            "| {n} | {} | {} | {} | {} | {native} |",
            found.map,
            found.with_jacobian,
            milliseconds(found.built),
            microseconds(found.interpreted),
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

fn milliseconds(time: Duration) -> String {
    format!("{:.2} ms", 1e3 * time.as_secs_f64())
}

fn microseconds(time: Duration) -> String {
    format!("{:.1} µs", 1e6 * time.as_secs_f64())
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
    let derivatives = flow::derivatives(&g, &flow, &states[..1], n - 1)?.concat();
    let map = Tape::new(&g, &states, &derivatives)?.len();
    let Q = flow::gradients(&g, &flow, &states[..1], n - 1)?.concat();
    let Q: Vec<Node> = Q.into_iter().flatten().flatten().collect();
    let tape = Tape::new(&g, &states, &[derivatives, Q].concat())?;
    let built = start.elapsed();
    let point: Vec<[f64; 1]> = (0..n).map(|i| [0.3 + 0.01 * i as f64]).collect();
    let mut values = vec![[0.0]; tape.outputs()];
    let mut interpreter = tape.evaluator();
    let interpreted = timed(|| interpreter.eval(point.as_flattened(), values.as_flattened_mut()));
    let start = Instant::now();
    let native = Function::<1>::compile(&tape).map(|mut function| Native {
        compiled: start.elapsed(),
        evaluated: timed(|| function.eval(&point, &mut values)),
    });
    Ok(Growth {
        map,
        with_jacobian: tape.len(),
        built,
        interpreted,
        native,
    })
}

/// The median of many evaluations.
fn timed(mut evaluate: impl FnMut()) -> Duration {
    let mut times: Vec<Duration> = (0..101)
        .map(|_| {
            let start = Instant::now();
            evaluate();
            start.elapsed()
        })
        .collect();
    times.sort_unstable();
    times[times.len() / 2]
}
