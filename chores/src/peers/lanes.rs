//! Ours in a batch: Lee's example with its observer (8 states), one input for all runs or sin and
//! exp in every run.

use lynkeus::expr::{Expr, Graph, Node};
use lynkeus::run::{Batch, Error, Member, Method, Role, Simulation, Step, System};

use super::clock::Clock;

const STEP: f64 = 1e-3;
const UNTIL: f64 = 5.0;
const RUNS: usize = 6144;

/// Two coupled oscillators under u and their observer; `own` input: one of its own phase in every
/// run, which is a state.
fn simulation(own: bool) -> Result<Simulation, Error> {
    let g = Graph::new();
    let names = [
        "time", "u", "φ", "x1", "x2", "x3", "x4", "z1", "z2", "z3", "z4",
    ];
    let [time, input, phase, x1, x2, x3, x4, z1, z2, z3, z4] = names.map(|name| g.symbol(name));
    let u = match own {
        true => (time * 3.0 + phase).sin() * 2.0,
        false => input,
    };
    let e = u.exp();
    let field = |x1: Expr<'_>, x2: Expr<'_>, x3: Expr<'_>, x4: Expr<'_>| {
        [
            x2 + 0.01 * x1 * u,
            -x1 + (1.0 - x1 * x1) * x2 + x3 * u,
            x4 + 0.01 * x2 * x3 * e,
            -x3 + (1.0 - x3 * x3) * x4 + u,
        ]
        .map(|e| e.node())
    };
    let mut dx = field(x1, x2, x3, x4).to_vec();
    let (a, b) = (u * 0.01, 1.0 - z1 * z1);
    let (c, q) = (z2 * 0.01 * e, 1.0 - z3 * z3);
    let gains = [
        6.0 + (a + b),
        9.0 + (a * a + (z2 * (-2.0 * z1) - 1.0) - a * (a + b)),
        18.0 + (q + c),
        81.0 + (z4 * (-2.0 * z3) - 1.0 + c * c - c * (q + c)),
    ];
    let [i1, i2] = [x1 - z1, x3 - z3];
    let corrections = [
        gains[0] * i1,
        gains[1] * i1 + u * i2,
        gains[2] * i2,
        gains[3] * i2,
    ];
    for (f, correction) in field(z1, z2, z3, z4).into_iter().zip(corrections) {
        dx.push((g.expr(f) + correction).node());
    }
    let starts = [2.0, 1.0, 3.0, 3.5, 0.5, 0.5, 0.5, 0.5, 0.0];
    let symbols = [x1, x2, x3, x4, z1, z2, z3, z4, phase];
    let mut states: Vec<(String, Node, f64)> = symbols
        .iter()
        .zip(starts)
        .enumerate()
        .map(|(k, (x, start))| (format!("x[{k}]"), x.node(), start))
        .collect();
    match own {
        true => dx.push(g.constant(0.0).node()),
        false => states.truncate(8),
    }
    let signals = match own {
        true => vec![],
        false => vec![("u".to_string(), input.node())],
    };
    let plant = System::new(&g, time.node(), &states, &signals, &dx, &[])?;
    let course = ((time * 3.0).sin() * 2.0).node();
    let inputs = System::new(&g, time.node(), &[], &[], &[], &[("u".to_string(), course)])?;
    Ok(Simulation {
        method: Method::Rk4(Step::AtMost(STEP)),
        ..Simulation::new(plant, inputs, UNTIL, 1.0)
    })
}

/// A batch on one thread.
pub(super) struct Run {
    /// seconds of a step of one run
    pub step: f64,
    /// what C prints, too: of every block of its lanes x1 of the first and z1 of the last
    pub end: f64,
}

/// Runs of C, and those of a block of its lanes.
const RUNS_OF_C: usize = 4096;
const BLOCK: usize = 64;

pub(super) fn run(own: bool) -> Result<Run, Error> {
    let simulation = simulation(own)?;
    let member = |k: usize| {
        let mut start = simulation.plant.start().to_vec();
        start[0] += 0.001 * k as f64;
        if own {
            start[8] = 0.01 * k as f64;
        }
        Member { seed: 0, start }
    };
    let members: Vec<Member> = (0..RUNS).map(member).collect();
    let columns = [Role::State.at(0), Role::State.at(4)];
    let Some(mut batch) = Batch::new(&simulation, &members, &columns)? else {
        let [step, end] = [f64::INFINITY, f64::NAN];
        return Ok(Run { step, end });
    };
    let clock = Clock::start();
    for _ in 0..batch.rows() {
        batch.advance(1, 1, &|| false)?;
    }
    let step = clock.seconds() / (RUNS as f64 * (UNTIL / STEP));
    let last = batch.times().len().saturating_sub(1);
    let of = |column: usize, place: usize| -> f64 {
        let runs = batch.values(last, column).take(RUNS_OF_C);
        runs.skip(place).step_by(BLOCK).sum()
    };
    let end = of(0, 0) + of(1, BLOCK - 1);
    Ok(Run { step, end })
}
