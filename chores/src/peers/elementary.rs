//! Ours among the elementary functions: machine code in lanes that has one of them alone.

use lynkeus::expr::{Expr, Graph, Tape};
use lynkeus_native::{Buffer, Function};
use serde_json::{Map, Value, json};

use super::clock::Clock;

/// As `functions.c` has it.
const COUNT: usize = 4096;
/// So many at a time: processor time is counted in steps of some milliseconds.
const ROUNDS: usize = 40_000;
const TURNS: usize = 3;

/// Its name in C, itself, and the numbers from which to which.
type Row = (&'static str, Of, [f64; 2]);
type Of = for<'g> fn(&'g Graph, Expr<'g>) -> Expr<'g>;

const ROWS: [Row; 7] = [
    ("exp", |_, x| x.exp(), [-20.0, 5.0]),
    ("log", |_, x| x.ln(), [1e-3, 1e3]),
    ("sin", |_, x| x.sin(), [-19.0, 20.0]),
    ("cos", |_, x| x.cos(), [-19.0, 20.0]),
    ("pow", |g, x| x.pow(g.constant(1.7)), [1e-2, 10.0]),
    ("tanh", |_, x| x.tanh(), [-3.0, 4.0]),
    ("atan2", |g, x| x.atan2(g.constant(0.7)), [-3.0, 4.0]),
];

/// Names of the functions, in the order of the table.
pub(super) fn names() -> impl Iterator<Item = &'static str> {
    ROWS.iter().map(|(name, ..)| *name)
}

/// Seconds of a value with so many lanes, and the sum of all values; nothing where there is no such code.
pub(super) fn measure<const L: usize>() -> Value {
    let mut found = Map::new();
    for (name, function, range) in ROWS {
        if let Some((seconds, sum)) = row::<L>(function, range) {
            found.insert(name.to_owned(), json!(seconds));
            found.insert(format!("end of {name}"), json!([sum]));
        }
    }
    Value::Object(found)
}

fn row<const L: usize>(function: Of, [low, high]: [f64; 2]) -> Option<(f64, f64)> {
    let g = Graph::new();
    let x = g.symbol("x");
    let tape = Tape::new(&g, &[x.node()], &[function(&g, x).node()]).ok()?;
    let mut code = Function::<L>::sweeping(&tape, 0, 1)?;
    let (mut x, mut y) = (Buffer::<L>::new(COUNT / L), Buffer::<L>::new(COUNT / L));
    for (i, x) in x.values_mut().as_flattened_mut().iter_mut().enumerate() {
        *x = low + (high - low) * (i as f64 + 0.5) / COUNT as f64;
    }
    let mut least = f64::INFINITY;
    for _ in 0..TURNS {
        let clock = Clock::start();
        for _ in 0..ROUNDS {
            code.sweep(COUNT / L, &[], x.values(), y.values_mut());
        }
        least = least.min(clock.seconds());
    }
    let sum = y.values().as_flattened().iter().sum();
    Some((least / (COUNT * ROUNDS) as f64, sum))
}
