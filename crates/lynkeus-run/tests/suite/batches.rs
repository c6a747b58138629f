//! Many runs at once give what each gives alone.

use std::collections::BTreeMap;
use std::sync::atomic::{AtomicUsize, Ordering};

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::Limits;
use lynkeus_run::{
    Backend, Batch, Column, Error, Level, Member, Method, Noise, Role, Simulation, Step, System,
};

fn named(name: &str, e: Expr<'_>) -> (String, lynkeus_expr::Node) {
    (name.to_string(), e.node())
}

/// x'' = −x − ¼ x' (1 + bend(x)) + u with a switching u, the position measured, and an observer of
/// it with two states.
fn simulation(bend: Bend) -> Simulation {
    let g = Graph::new();
    let [time, x, v, u, y, x̂, v̂] =
        ["time", "x", "v", "u", "y", "x_hat", "v_hat"].map(|name| g.symbol(name));
    let states = [("x", x, 1.0), ("v", v, 0.0)];
    let states = states.map(|(name, e, start)| (name.to_string(), e.node(), start));
    let dv = |x, v| force(u, x, v, bend);
    let dx = [v.node(), dv(x, v).node()];
    let plant = System::new(
        &g,
        time.node(),
        &states,
        &[named("u", u)],
        &dx,
        &[named("y", x)],
    );
    let on = time
        .less(g.constant(0.55))
        .select(g.constant(1.0), bend(time) - 0.5);
    let inputs = System::new(&g, time.node(), &[], &[], &[], &[named("u", on)]);
    let states = [("x_hat", x̂, 0.0), ("v_hat", v̂, 0.0)];
    let states = states.map(|(name, e, start)| (name.to_string(), e.node(), start));
    let error = y - x̂;
    let dx = [v̂ + error * 2.0, dv(x̂, v̂) + error * 1.5].map(|e| e.node());
    let signals = [named("u", u), named("y", y)];
    let observer = System::new(&g, time.node(), &states, &signals, &dx, &[]);
    Simulation {
        observer: Some(observer.unwrap()),
        method: Method::Rk4(Step::AtMost(0.03)),
        noise: Noise {
            sample_step: Some(0.07),
            levels: BTreeMap::from([("y".to_string(), Level::Absolute(0.1))]),
            process: BTreeMap::from([("v".to_string(), 0.01)]),
            limits: BTreeMap::from([("y".to_string(), SHOWN)]),
            ..Noise::default()
        },
        record_outputs: true,
        ..Simulation::new(plant.unwrap(), inputs.unwrap(), 2.0, 0.1)
    }
}

fn force<'g>(u: Expr<'g>, x: Expr<'g>, v: Expr<'g>, bend: Bend) -> Expr<'g> {
    u - x - v * 0.25 * (1.0 + bend(x))
}

type Bend = fn(Expr<'_>) -> Expr<'_>;

fn rational(x: Expr<'_>) -> Expr<'_> {
    x * x / (1.0 + x * x)
}

fn transcendental(x: Expr<'_>) -> Expr<'_> {
    (x * 3.0).sin() * (-(x * x)).exp() + x.tanh()
}

fn members(seeds: impl Iterator<Item = u64>) -> Vec<Member> {
    let member = |seed: u64| Member {
        seed,
        start: vec![1.0 + 0.01 * seed as f64, 0.0],
    };
    seeds.map(member).collect()
}

/// The sensor ends within what the position spans.
const SHOWN: Limits = Limits {
    low: 0.75,
    high: 1.2,
};

const COLUMNS: [Column; 6] = [
    Role::State.at(0),
    Role::State.at(1),
    Role::Input.at(0),
    Role::Output.at(0),
    Role::Measured.at(0),
    Role::Estimate.at(1),
];

/// All recorded values: by run, then row by row.
fn run(simulation: &Simulation, members: &[Member], rows: usize, threads: usize) -> Vec<Vec<f64>> {
    let mut batch = Batch::new(simulation, members, &COLUMNS).unwrap().unwrap();
    let mut found = vec![vec![]; members.len()];
    let mut times = 0;
    while batch.advance(rows, threads, &|| false).unwrap() {
        times += batch.times().len();
        for row in 0..batch.times().len() {
            for column in 0..COLUMNS.len() {
                for (run, value) in batch.values(row, column).enumerate() {
                    found[run].push(value);
                }
            }
        }
    }
    assert_eq!(times, batch.rows());
    assert_eq!(batch.ended().count(), 0);
    found
}

fn alone(simulation: &Simulation, member: &Member) -> Vec<f64> {
    let mut simulation = simulation.clone();
    simulation.noise.seed = member.seed;
    simulation.plant = simulation.plant.with_start(member.start.clone()).unwrap();
    let table = simulation.run().unwrap();
    let of_row = |row: usize| COLUMNS.map(|c| table.column(c).unwrap()[row]);
    (0..table.len()).flat_map(of_row).collect()
}

#[test]
fn without_elementary_functions_a_run_is_that_of_a_simulation_to_the_bit() {
    let simulation = simulation(rational);
    let members = members(3..80);
    let batch = Batch::new(&simulation, &members, &[]).unwrap().unwrap();
    assert!(batch.is_exact());
    let found = run(&simulation, &members, 3, 2);
    for (member, found) in members.iter().zip(&found) {
        assert_eq!(*found, alone(&simulation, member), "seed {}", member.seed);
    }
    // readings at either end of the sensor's range and between, of outputs beyond it
    let rows = found.iter().flat_map(|run| run.chunks_exact(COLUMNS.len()));
    let pairs: Vec<(f64, f64)> = rows.map(|row| (row[3], row[4])).collect();
    let shown = |of: fn(f64) -> bool| pairs.iter().filter(|(_, y)| of(*y)).count();
    assert!(shown(|y| y == SHOWN.low) > 50 && shown(|y| y == SHOWN.high) > 50);
    assert!(shown(|y| SHOWN.low < y && y < SHOWN.high) > 50);
    let is_shown = |y: f64| (SHOWN.low..=SHOWN.high).contains(&y);
    assert!(pairs.iter().all(|(_, y)| is_shown(*y)));
    assert!(pairs.iter().any(|(h, _)| *h > SHOWN.high + 0.1));
}

#[test]
fn with_elementary_functions_it_is_near_and_the_same_however_runs_are_grouped() {
    let simulation = simulation(transcendental);
    let members = members(0..150);
    let batch = Batch::new(&simulation, &members, &[]).unwrap().unwrap();
    assert!(!batch.is_exact());
    let found = run(&simulation, &members, 1, 1);
    for (member, found) in members.iter().zip(&found).take(5) {
        let expected = alone(&simulation, member);
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-12, "{found} {expected}");
        }
    }
    assert_eq!(found, run(&simulation, &members, 100, 3));
    assert_eq!(found[37..], run(&simulation, &members[37..], 4, 2));
    assert_eq!(found[149..], run(&simulation, &members[149..], 4, 2));
    Backend::Interpreter.choose();
    let interpreted = run(&simulation, &members[..40], 7, 2);
    Backend::default().choose();
    assert_eq!(found[..40], interpreted);
}

/// x' = x² ends at 1/x₀.
#[test]
fn a_run_that_ends_is_told_and_the_others_go_on() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    let state = [("x".to_string(), x.node(), 0.1)];
    let plant = System::new(&g, time.node(), &state, &[], &[(x * x).node()], &[]).unwrap();
    let inputs = System::new(&g, time.node(), &[], &[], &[], &[]).unwrap();
    let mut simulation = Simulation::new(plant, inputs, 4.0, 0.5);
    simulation.method = Method::Rk4(Step::Substeps(100));
    let member = |start: f64| Member {
        seed: 1,
        start: vec![start],
    };
    let members = [0.1, 0.5, 0.2, 0.125, 0.4].map(member);
    let column = [Role::State.at(0)];
    let mut batch = Batch::new(&simulation, &members, &column).unwrap().unwrap();
    let mut last = vec![];
    while batch.advance(2, 2, &|| false).unwrap() {
        last = batch.values(batch.times().len() - 1, 0).collect();
    }
    let mut ended: Vec<usize> = batch.ended().map(|e| e.run).collect();
    ended.sort_unstable();
    assert_eq!(ended, [1, 4]);
    for ended in batch.ended() {
        let Error::NotFinite { time, .. } = ended.error else {
            panic!("{}", ended.error);
        };
        let escape = if ended.run == 1 { 2.0 } else { 2.5 };
        assert!((escape..=escape + 1.0).contains(&time), "{time}");
    }
    for (run, start) in [(0, 0.1), (2, 0.2), (3, 0.125)] {
        let expected = start / (1.0 - 4.0 * start);
        assert!(
            (last[run] - expected).abs() < 1e-7,
            "{} {expected}",
            last[run]
        );
    }
}

#[test]
fn steps_of_their_own_and_columns_that_are_not_there() {
    let mut simulation = simulation(rational);
    let wrong = Batch::new(&simulation, &members(0..2), &[Role::Estimate.at(7)]);
    assert!(matches!(wrong, Err(Error::Setting { .. })));
    simulation.method = Method::Rk4(Step::Auto);
    assert!(
        Batch::new(&simulation, &members(0..2), &[])
            .unwrap()
            .is_none()
    );
    simulation.method = Method::default();
    assert!(
        Batch::new(&simulation, &members(0..2), &[])
            .unwrap()
            .is_none()
    );
}

/// Asked on the way to the second row, half a million steps away: the batch ends at once, and for good.
#[test]
fn a_batch_that_is_told_to_end_ends_between_two_rows() {
    let mut simulation = simulation(rational);
    simulation.noise.sample_step = Some(2.0);
    simulation.output_step = 2.0;
    simulation.method = Method::Rk4(Step::AtMost(4e-6));
    for count in [1, 300] {
        let mut batch = Batch::new(&simulation, &members(0..count), &COLUMNS)
            .unwrap()
            .unwrap();
        assert!(batch.advance(1, 2, &|| false).unwrap());
        let asked = AtomicUsize::new(0);
        let is_over = || asked.fetch_add(1, Ordering::Relaxed) >= 3;
        let ended = batch.advance(1, 2, &is_over);
        assert_eq!(ended, Err(Error::Cancelled { time: 0.0 }), "{count}");
        assert!(asked.into_inner() <= 5);
        assert_eq!(batch.times(), []);
        let again = batch.advance(1, 2, &|| false);
        assert_eq!(again, Err(Error::Cancelled { time: 0.0 }));
    }
}

/// y = 1/(1 − t) of a system without states has no value at t = 1.
#[test]
fn runs_without_states_are_judged_as_well() {
    let g = Graph::new();
    let [time, u] = ["time", "u"].map(|name| g.symbol(name));
    let plant = System::new(
        &g,
        time.node(),
        &[],
        &[named("u", u)],
        &[],
        &[named("y", 1.0 / (1.0 - u))],
    );
    let inputs = System::new(&g, time.node(), &[], &[], &[], &[named("u", time)]);
    let simulation = Simulation {
        method: Method::Rk4(Step::AtMost(0.5)),
        record_outputs: true,
        ..Simulation::new(plant.unwrap(), inputs.unwrap(), 2.0, 0.5)
    };
    let alone = simulation.run().unwrap_err().error;
    let Error::NotFinite { time: expected, .. } = alone else {
        panic!("{alone}");
    };
    let member = Member {
        seed: 0,
        start: vec![],
    };
    let members = vec![member; 5];
    let mut batch = Batch::new(&simulation, &members, &[]).unwrap().unwrap();
    while batch.advance(1, 1, &|| false).unwrap() {}
    let ended: Vec<usize> = batch.ended().map(|ended| ended.run).collect();
    assert_eq!(ended, [0, 1, 2, 3, 4]);
    for ended in batch.ended() {
        let is_there = matches!(ended.error, Error::NotFinite { time, .. } if time == expected);
        assert!(is_there, "{}", ended.error);
    }
}
