//! Snapshots of estimators whose equations jump with the state, and of large filters.

use lynkeus_expr::{Expr, Graph};
use lynkeus_run::filter::{
    FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Particles, Sensor, SigmaPoints,
};
use lynkeus_run::{
    BetweenSamples, Blueprint, Estimator, EstimatorSettings, Level, Method, Step, System,
    Tolerances,
};

fn settings(method: Method) -> EstimatorSettings {
    EstimatorSettings {
        between: BetweenSamples::Linear,
        method,
    }
}

fn tolerances() -> Tolerances {
    Tolerances {
        relative: 1e-8,
        absolute: 1e-10,
        budget: 2000,
    }
}

fn methods() -> [Method; 4] {
    [
        Method::Adaptive(tolerances()),
        Method::Explicit(tolerances()),
        Method::Stiff(tolerances()),
        Method::Rk4(Step::Auto),
    ]
}

/// w' = y − sign(w): slides along w = 0 while |y| < 1; p' = w √(2 − y).
fn friction(method: Method) -> Estimator {
    let g = Graph::new();
    let [time, w, p, y] = ["time", "w", "p", "y"].map(|name| g.symbol(name));
    let states = [
        ("w".to_string(), w.node(), 0.4),
        ("p".to_string(), p.node(), 0.0),
    ];
    let signals = [("y".to_string(), y.node())];
    let dx = [(y - w.sign()).node(), (w * (2.0 - y).sqrt()).node()];
    let system = System::new(&g, time.node(), &states, &signals, &dx, &[]).unwrap();
    Estimator::new(&system, settings(method)).unwrap()
}

/// x_i' from its neighbours with a bend, the first fed by u, the last measured.
fn chain(n: usize, kind: FilterKind, method: Method, keep_history: bool) -> Estimator {
    let g = Graph::new();
    let (time, u) = (g.symbol("time"), g.symbol("u"));
    let x: Vec<Expr<'_>> = (0..n).map(|i| g.symbol(&format!("x{i}"))).collect();
    let left = |i: usize| if i == 0 { u } else { x[i - 1] };
    let f = (0..n).map(|i| (left(i) - x[i] + (x[i] - 0.45).abs() * 0.5).node());
    let plant = NoisyPlant {
        graph: &g,
        time: time.node(),
        states: (0..n)
            .map(|i| (format!("x{i}"), x[i].node(), 0.3 + 0.1 * (i % 5) as f64))
            .collect(),
        derivatives: f.collect(),
        inputs: vec![("u".into(), u.node())],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x[n - 1].node(),
            noise: Level::Absolute(0.05),
            limits: None,
        }],
        process_noise: (0..n).map(|i| 0.01 * (i % 2) as f64).collect(),
        initial_variance: vec![0.04; n],
        ranges: vec![
            Limits {
                low: 0.0,
                high: 3.0,
            };
            n
        ],
        confined: None,
        whens: Default::default(),
    };
    let of_filter = FilterSettings {
        keep_history,
        ..FilterSettings::of(kind)
    };
    let model = NoisyModel::new(&plant).unwrap();
    Blueprint::filter(model.clone(), of_filter, settings(method))
        .estimator()
        .unwrap()
}

fn particles(looks_ahead: bool) -> FilterKind {
    FilterKind::Particles(Particles {
        count: 300,
        looks_ahead,
        ..Particles::default()
    })
}

fn bits(values: &[f64]) -> Vec<u64> {
    values.iter().map(|x| x.to_bits()).collect()
}

/// One that is restored from a snapshot at any of the samples, and some of which calls fail
/// half-way, after every sample or after some, go the same way to the last bit.
fn goes_on(
    new: impl Fn() -> Estimator,
    samples: &[(f64, Vec<f64>)],
    fail: impl Fn(&mut Estimator, f64) -> bool,
    what: &str,
) {
    let mut whole = new();
    let mut troubled = [1, 5, 19].map(|every| (every, new()));
    let mut snapshots = vec![];
    for (place, (t, signals)) in samples.iter().enumerate() {
        whole.push(*t, signals).unwrap();
        snapshots.push(whole.snapshot());
        for (every, troubled) in &mut troubled {
            troubled.push(*t, signals).unwrap();
            if place % *every == *every - 1 {
                assert!(fail(troubled, *t), "{what} at {t}");
                assert_eq!(snapshots[place], troubled.snapshot(), "{what} at {t}");
            }
        }
    }
    for (_, troubled) in &troubled {
        assert_eq!(snapshots.last(), Some(&troubled.snapshot()), "{what}");
        assert_eq!(
            troubled.smoothed(None, true),
            whole.smoothed(None, true),
            "{what}"
        );
    }
    for (place, snapshot) in snapshots.iter().enumerate() {
        let mut restored = new();
        restored.restore(snapshot).unwrap();
        for (t, signals) in &samples[place + 1..] {
            restored.push(*t, signals).unwrap();
        }
        assert_eq!(
            bits(restored.state()),
            bits(whole.state()),
            "{what} from {place}"
        );
        assert_eq!(
            restored.deviations().map(bits),
            whole.deviations().map(bits)
        );
        assert_eq!(
            restored.smoothed(None, true),
            whole.smoothed(None, true),
            "{what}"
        );
        assert_eq!(restored.snapshot(), whole.snapshot(), "{what} from {place}");
    }
}

#[test]
fn what_slides_goes_on_sliding() {
    let y = |k: i32| match k {
        0..=20 => 0.3 + 0.02 * f64::from(k),
        21..=26 => 1.4,
        _ => -0.5,
    };
    let samples: Vec<_> = (0..40).map(|k| (0.1 * f64::from(k), vec![y(k)])).collect();
    for method in methods() {
        let mut estimator = friction(method);
        let rows = samples
            .iter()
            .map(|(t, y)| estimator.push(*t, y).unwrap()[0]);
        let rows: Vec<f64> = rows.collect();
        if !matches!(method, Method::Rk4(_)) {
            // at rest from 0.4/0.7 on, and moved by what is more than the friction
            assert!(rows[12..21].iter().all(|w| w.abs() < 1e-9), "{rows:?}");
            assert!(rows[26] > 0.1);
        }
        // no value from y = 2 on, on the way
        let fail = |estimator: &mut Estimator, t: f64| estimator.push(t + 0.1, &[3.0]).is_err();
        goes_on(|| friction(method), &samples, fail, &format!("{method:?}"));
    }
}

/// Few states are integrated with Φ and W, many go by series; smoothers' histories are restored.
#[test]
fn filters_of_every_size_go_on() {
    let samples: Vec<_> = (0..9)
        .map(|k| {
            (
                0.4 * f64::from(k),
                vec![
                    0.4 + 0.1 * f64::from(k).sin(),
                    0.5 + 0.05 * f64::from(k % 4),
                ],
            )
        })
        .collect();
    for n in [3, 11] {
        for kind in [
            FilterKind::Extended,
            FilterKind::Unscented(SigmaPoints::default()),
            FilterKind::MovingHorizon(4),
            particles(false),
            particles(true),
        ] {
            for method in [
                Method::Explicit(tolerances()),
                Method::Rk4(Step::Substeps(8)),
            ] {
                for keep_history in [true, false] {
                    if keep_history && matches!(kind, FilterKind::Particles(_)) {
                        continue;
                    }
                    let new = || chain(n, kind.clone(), method, keep_history);
                    let fail = |estimator: &mut Estimator, t| estimator.predict(t + 1e9).is_err();
                    let what = format!("{n} {kind:?} {method:?}, history: {keep_history}");
                    goes_on(new, &samples, fail, &what);
                }
            }
        }
    }
}

/// Words of live use, and nothing that is different after it.
#[test]
fn a_call_that_is_refused_changes_nothing() {
    for kind in [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        particles(true),
    ] {
        let mut filter = chain(3, kind, Method::Rk4(Step::Auto), false);
        filter.push(1.0, &[0.3, 0.5]).unwrap();
        filter.push(2.0, &[0.4, 0.5]).unwrap();
        let before = filter.snapshot();
        let refusals = [
            filter.push(0.5, &[0.3, 0.5]).map(drop),
            filter.push(f64::NAN, &[0.3, 0.5]).map(drop),
            filter.push(3.0, &[]).map(drop),
            filter.predict(1.5).map(drop),
        ];
        let words: Vec<String> = refusals.map(|r| r.unwrap_err().to_string()).into();
        assert_eq!(
            words[0],
            "the time 0.5 is before 2, where the estimator is: expected samples in the order of their times"
        );
        assert_eq!(words[1], "t: expected a finite number, found NaN");
        assert!(
            words.iter().all(|words| !words.contains("row")),
            "{words:?}"
        );
        assert_eq!(filter.snapshot(), before);
    }
}
