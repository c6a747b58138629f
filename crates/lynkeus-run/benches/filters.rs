//! Time per sample of the filters on a chain of n cells, of which the last is measured.

use divan::{Bencher, black_box};
use lynkeus_expr::Graph;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Likelihood, Limits, NoisyModel, NoisyPlant, ParametricLevel,
    ParametricPlant, ParametricSensor, Particles, Row, Sensor, SigmaPoints,
};
use lynkeus_run::{Blueprint, Error, EstimatorSettings, Fleet, Level, Method, Step, Tolerances};

fn main() {
    divan::main();
}

const STEP: f64 = 0.1;

/// x_i' = φ(x_{i−1}) − φ(x_i), φ(x) = 2.5 x/(1 + 1.5 x), fed by a signal.
fn chain(n: usize) -> Result<NoisyModel, Error> {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<_> = (0..n).map(|i| g.symbol(&format!("x[{i}]"))).collect();
    let flow: Vec<_> = x.iter().map(|&x| x * 2.5 / (1.0 + x * 1.5)).collect();
    let dx = (0..n).map(|i| (if i == 0 { u } else { flow[i - 1] } - flow[i]).node());
    let states = x.iter().map(|x| (format!("{x:?}"), x.node(), 0.5));
    NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: states.collect(),
        derivatives: dx.collect(),
        inputs: vec![("u".to_owned(), u.node())],
        sensors: vec![Sensor {
            name: "y".to_owned(),
            output: x[n - 1].node(),
            noise: Level::Absolute(0.02),
            limits: None,
        }],
        process_noise: vec![1e-6; n],
        initial_variance: vec![1e-4; n],
        ranges: vec![
            Limits {
                low: 0.0,
                high: 10.0,
            };
            n
        ],
        confined: None,
        whens: Default::default(),
    })
}

/// Runs a filter for long enough that P has filled and that there is machine code, then measures sample by sample.
fn measure(bencher: Bencher, n: usize, kind: FilterKind) {
    let method = Method::Adaptive(Tolerances {
        relative: 1e-6,
        absolute: 1e-8,
        ..Tolerances::default()
    });
    measure_by(method, 30, bencher, n, kind);
}

fn measure_by(method: Method, before: usize, bencher: Bencher, n: usize, kind: FilterKind) {
    let run = EstimatorSettings {
        method,
        ..EstimatorSettings::default()
    };
    let filter = chain(n).and_then(|model| {
        Blueprint::filter(model.clone(), FilterSettings::of(kind), run).estimator()
    });
    let mut filter = filter.unwrap_or_else(|error| panic!("{error}"));
    let mut k = 0_u32;
    let mut push = || {
        let t = STEP * f64::from(k);
        k += 1;
        let y = 0.5 + 0.1 * t.sin();
        match filter.push(t, &[y, black_box(0.7)]) {
            Ok(x) => x[0],
            Err(error) => panic!("{error}"),
        }
    };
    for _ in 0..before {
        black_box(push());
    }
    bencher.bench_local(push);
}

#[divan::bench(args = [2, 8, 25, 61, 200])]
fn ekf(bencher: Bencher, n: usize) {
    measure(bencher, n, FilterKind::Extended);
}

/// One step of Runge and Kutta between samples.
#[divan::bench(args = [2, 4, 8, 12, 16, 25, 61])]
fn ekf_rk4(bencher: Bencher, n: usize) {
    let method = Method::Rk4(Step::Substeps(1));
    measure_by(method, 10_000, bencher, n, FilterKind::Extended);
}

/// As many as there are lanes, one step of Runge and Kutta between samples.
#[divan::bench(args = [2, 4, 8, 12, 16, 25])]
fn ekf_fleet(bencher: Bencher, n: usize) {
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(1)),
        ..EstimatorSettings::default()
    };
    let model = chain(n).unwrap_or_else(|error| panic!("{error}"));
    let filter = Blueprint::filter(model, FilterSettings::of(FilterKind::Extended), run);
    let filters = vec![filter; Fleet::width()];
    let mut fleet = Fleet::new(&filters).unwrap_or_else(|apart| panic!("{apart}"));
    let mut k = 0_u32;
    bencher.bench_local(|| {
        let t = STEP * f64::from(k);
        k += 1;
        let (readings, inputs) = ([0.5 + 0.1 * t.sin()], [black_box(0.7)]);
        let row = Row {
            t,
            readings: &readings,
            inputs: &inputs,
        };
        let failed = fleet.push(&[Some(row); 8][..filters.len()]);
        assert!(failed.is_empty());
    });
}

#[divan::bench(args = [2, 8, 25, 61, 200])]
fn ukf(bencher: Bencher, n: usize) {
    measure(bencher, n, FilterKind::Unscented(SigmaPoints::default()));
}

/// A window of ten samples.
#[divan::bench(args = [2, 8, 25, 61, 200], sample_count = 20)]
fn mhe(bencher: Bencher, n: usize) {
    measure(bencher, n, FilterKind::MovingHorizon(10));
}

/// So many particles of two states, one step of Runge and Kutta between samples.
#[divan::bench(args = [100, 1000, 10_000, 100_000], sample_count = 20)]
fn particles(bencher: Bencher, count: usize) {
    let kind = FilterKind::Particles(Particles {
        count,
        ..Particles::default()
    });
    let method = Method::Rk4(Step::Substeps(1));
    measure_by(method, 100, bencher, 2, kind);
}

/// Cells of the plant whose likelihood is measured, and rows of its log.
const CELLS: usize = 4;
const ROWS: usize = 10_000;

/// The same chain as a function of so many of: a rate for each cell, the noise, and densities.
fn likelihood(count: usize) -> Result<Likelihood, Error> {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<_> = (0..CELLS).map(|i| g.symbol(&format!("x[{i}]"))).collect();
    let parameters: Vec<_> = (0..count).map(|i| g.symbol(&format!("p[{i}]"))).collect();
    let value = |i: usize| match parameters.get(i) {
        Some(parameter) => *parameter,
        None => g.constant(VALUES[i]),
    };
    let cells = x.iter().enumerate();
    let flow: Vec<_> = cells
        .map(|(i, &x)| x * value(i) / (1.0 + x * 1.5))
        .collect();
    let dx = (0..CELLS).map(|i| (if i == 0 { u } else { flow[i - 1] } - flow[i]).node());
    let range = Limits {
        low: 0.0,
        high: 10.0,
    };
    Likelihood::new(&ParametricPlant {
        graph: &g,
        time: time.node(),
        states: x.iter().map(|x| x.node()).collect(),
        derivatives: dx.collect(),
        inputs: vec![u.node()],
        sensors: vec![ParametricSensor {
            output: x[CELLS - 1].node(),
            noise: ParametricLevel::Variance(value(CELLS).powi(2).node()),
            limits: None,
            is_dial: false,
        }],
        process_noise: (0..CELLS).map(|i| value(CELLS + 1 + i).node()).collect(),
        ranges: vec![range; CELLS],
        start: vec![(g.constant(0.5).node(), g.constant(0.01).node()); CELLS],
        drawn: 0,
        whens: Default::default(),
        parameters: parameters.iter().map(|p| p.node()).collect(),
    })
}

/// What they are.
const VALUES: [f64; 2 * CELLS + 1] = [2.5, 2.5, 2.5, 2.5, 0.02, 1e-6, 1e-6, 1e-6, 1e-6];

/// −log L of a whole log, its gradient by so many parameters and Fisher's information; beside it a sample of
/// [`ekf_rk4`] is the same filter without derivatives.
#[divan::bench(args = [0, 1, 4, 8])]
fn gradient(bencher: Bencher, parameters: usize) {
    let mut likelihood = likelihood(parameters).unwrap_or_else(|error| panic!("{error}"));
    let readings: Vec<[f64; 1]> = (0..ROWS)
        .map(|k| [0.5 + 0.1 * (STEP * k as f64).sin()])
        .collect();
    let row = |k: usize| Row {
        t: STEP * k as f64,
        readings: &readings[k],
        inputs: &[0.7],
    };
    bencher.bench_local(|| {
        let score = likelihood.score(
            black_box(&VALUES[..parameters]),
            (0..ROWS).map(row),
            Step::Substeps(1),
        );
        score.unwrap_or_else(|error| panic!("{error}")).value
    });
}
