//! An estimator that is warm takes no more memory, at no sample: systems, sampled observers and the
//! extended filter of up to eight states, with fixed steps. It is warm when its equations have
//! become machine code, after some hundred evaluations. The other filters, the smoothers, filters
//! of more states and steps under error control take memory at every sample.
#![allow(clippy::unwrap_used)]

use cap::Cap;
use lynkeus_expr::Graph;
use lynkeus_run::filter::{FilterKind, FilterSettings, NoisyModel, NoisyPlant, Sensor};
use lynkeus_run::{
    BetweenSamples, Blueprint, Estimator, EstimatorSettings, Level, Method, Step, System, Updates,
};

#[global_allocator]
static ALLOCATOR: Cap<std::alloc::System> = Cap::new(std::alloc::System, usize::MAX);

const METHOD: Method = Method::Rk4(Step::Substeps(3));

fn settings() -> EstimatorSettings {
    EstimatorSettings {
        between: BetweenSamples::Hold,
        method: METHOD,
    }
}

/// x̂' = u + 2(y − x̂).
fn flow() -> Estimator {
    let g = Graph::new();
    let [time, x, u, y] = ["time", "x", "u", "y"].map(|name| g.symbol(name));
    let states = [("x".to_string(), x.node(), 0.0)];
    let signals = [("y".to_string(), y.node()), ("u".to_string(), u.node())];
    let dx = u + (y - x) * 2.0;
    let system = System::new(&g, time.node(), &states, &signals, &[dx.node()], &[]).unwrap();
    Estimator::new(&system, settings()).unwrap()
}

/// The same with y as a state w that follows the model where no reading is there.
fn sampled() -> Estimator {
    let g = Graph::new();
    let [time, x, w, u, s] = ["time", "x", "w", "u", "s"].map(|name| g.symbol(name));
    let states = [
        ("x".to_string(), x.node(), 0.0),
        ("w".to_string(), w.node(), 0.0),
    ];
    let derivatives = [(u + (w - x) * 2.0).node(), (s * (u - x)).node()];
    let signals = [("u".to_string(), u.node()), ("s".to_string(), s.node())];
    let outputs = [("x".to_string(), x.node()), ("y".to_string(), x.node())];
    let system = System::new(&g, time.node(), &states, &signals, &derivatives, &outputs).unwrap();
    let observer = Blueprint {
        sensors: vec!["y".to_string()],
        updates: Updates::Jumps {
            predict: true,
            errors: None,
            tuned: None,
        },
        ..Blueprint::new(&system, settings())
    };
    observer.estimator().unwrap()
}

/// x1' = x2 + u, x2' = −sin x1, y = x1.
fn filter() -> Estimator {
    let g = Graph::new();
    let [time, a, b, u] = ["time", "a", "b", "u"].map(|name| g.symbol(name));
    let plant = NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("a".into(), a.node(), 0.1), ("b".into(), b.node(), 0.0)],
        derivatives: vec![(b + u).node(), (-a.sin()).node()],
        inputs: vec![("u".into(), u.node())],
        sensors: vec![Sensor {
            name: "y".into(),
            output: a.node(),
            noise: Level::Absolute(0.1),
            limits: None,
        }],
        process_noise: vec![0.0, 0.1],
        initial_variance: vec![1.0; 2],
        ranges: vec![],
        confined: None,
        whens: Default::default(),
    };
    let model = NoisyModel::new(&plant).unwrap();
    let kind = FilterSettings::of(FilterKind::Extended);
    Blueprint::filter(model.clone(), kind, settings())
        .estimator()
        .unwrap()
}

// one test: another thread's memory would count, too; that of the harness counts in one window
// of five at most
#[test]
fn a_warm_estimator_allocates_nothing() {
    for mut estimator in [flow(), sampled(), filter()] {
        let push = |estimator: &mut Estimator, k: i32| {
            let y = if k % 5 == 4 { f64::NAN } else { 0.3 };
            estimator.push(0.1 * f64::from(k), &[y, 0.01]).unwrap();
            estimator.predict(0.1 * f64::from(k) + 0.03).unwrap();
            estimator.update(&[y, 0.02]).unwrap();
        };
        let names = estimator.names().join(", ");
        (0..300).for_each(|k| push(&mut estimator, k));
        let allocated = |window: i32| {
            let before = ALLOCATOR.total_allocated();
            (0..200).for_each(|k| push(&mut estimator, 300 + 200 * window + k));
            ALLOCATOR.total_allocated() - before
        };
        let found: Vec<usize> = (0..5).map(allocated).collect();
        assert!(found.contains(&0), "{names}: {found:?}");
        // and the count counts
        let before = ALLOCATOR.total_allocated();
        drop(estimator.snapshot());
        assert!(ALLOCATOR.total_allocated() > before);
    }
}
