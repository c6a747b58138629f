//! Time per sample of the filters on a chain of n cells, of which the last is measured.

use divan::{Bencher, black_box};
use lynkeus_expr::Graph;
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Row, Sensor, SigmaPoints,
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
