//! Time of one evaluation, of one Runge–Kutta step, and of a stiff run.

use divan::{Bencher, black_box};
use lynkeus_expr::Graph;
use lynkeus_run::{Dynamics, Evaluation, Integrator, Method, Rk4, System, Tolerances};

fn main() {
    divan::main();
}

/// A chain of n cells with a saturating flow, fed by a signal.
fn chain(n: usize) -> Evaluation {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x[{i}]"))).collect();
    let flow: Vec<_> = x.iter().map(|&x| x * 2.5 / (1.0 + x * 1.5)).collect();
    let dx = (0..n).map(|i| (if i == 0 { u } else { flow[i - 1] } - flow[i]).node());
    let dx: Vec<_> = dx.collect();
    let states: Vec<_> = x
        .iter()
        .map(|x| (format!("{x:?}"), x.node(), 0.5))
        .collect();
    let signals = [("u".to_string(), u.node())];
    let system = System::new(&g, time.node(), &states, &signals, &dx, &[]);
    system
        .map(|system| system.evaluation())
        .unwrap_or_else(|error| panic!("{error}"))
}

#[divan::bench(args = [12, 100, 1000])]
fn evaluation(bencher: Bencher, n: usize) {
    let mut chain = chain(n);
    let (x, mut dx) = (vec![0.4; n], vec![0.0; n]);
    bencher.bench_local(|| chain.derivatives(0.0, black_box(&x), &mut dx));
}

#[divan::bench(args = [12, 100, 1000])]
fn rk4_step(bencher: Bencher, n: usize) {
    let mut chain = chain(n);
    let mut rk4 = Rk4::new(n);
    let mut x = vec![0.4; n];
    bencher.bench_local(|| rk4.step(&mut chain, 0.0, 1e-6, black_box(&mut x)));
}

/// From one steady state to another, by implicit steps.
#[divan::bench(args = [12, 100, 1000, 10_000], sample_count = 5)]
fn stiff_run(bencher: Bencher, n: usize) {
    let mut chain = chain(n);
    let method = Method::Stiff(Tolerances::default());
    bencher.bench_local(|| {
        let mut x = vec![0.4; n];
        chain.signals_mut()[0] = black_box(0.5);
        let mut integrator = Integrator::new(method, n).expect("a known method");
        integrator.advance(&mut chain, 0.0, 10.0, &mut x)
    });
}
