//! Windows against bounded least squares, and against the filter where nothing bounds them.

mod windows;

use lynkeus_expr::Graph;

use crate::filter::tests::{exact, scalar};
use crate::filter::{FilterKind, FilterSettings, Limits, NoisyModel, NoisyPlant, Sensor};
use crate::{Blueprint, Estimator, Level};

/// A level that cannot be below zero, read as −1 again and again: the estimate stays at zero
/// where the filter goes below, and leaves it when the readings do.
#[test]
fn the_moving_horizon_keeps_to_the_bounds() {
    let model = NoisyModel {
        ranges: vec![Limits {
            low: 0.0,
            high: 10.0,
        }],
        ..scalar(0.0, 0.05, 0.1)
    };
    let settings = FilterSettings::of(FilterKind::MovingHorizon(5));
    let mut horizon = Blueprint::filter(model.clone(), settings, exact())
        .estimator()
        .unwrap();
    let mut filter = Blueprint::filter(
        model.clone(),
        FilterSettings::of(FilterKind::Extended),
        exact(),
    )
    .estimator()
    .unwrap();
    for k in 0..60 {
        let y = if k < 40 { -1.0 } else { 2.0 };
        let x = horizon.push(f64::from(k), &[y]).unwrap()[0];
        let free = filter.push(f64::from(k), &[y]).unwrap()[0];
        assert!(x >= 0.0, "{k}: {x}");
        if (20..40).contains(&k) {
            assert!(x < 1e-9 && free < -0.9, "{k}: {x} {free}");
        }
    }
    assert!(
        (horizon.estimate()[0] - 2.0).abs() < 0.05,
        "{:?}",
        horizon.estimate()
    );
}

/// A place, which is measured, and its velocity, both within bounds; a window of 20 samples.
fn bounded_cart(ranges: [(f64, f64); 2]) -> Estimator {
    let g = Graph::new();
    let [time, x, v] = ["time", "x", "v"].map(|name| g.symbol(name));
    let model = NoisyModel::new(&NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.0), ("v".into(), v.node(), 0.2)],
        derivatives: vec![v.node(), (v * -0.2).node()],
        inputs: vec![],
        sensors: vec![Sensor {
            name: "y".into(),
            output: x.node(),
            noise: Level::Absolute(0.2),
            limits: None,
        }],
        process_noise: vec![0.01, 0.3],
        initial_variance: vec![1.0, 0.5],
        ranges: ranges.map(|(low, high)| Limits { low, high }).to_vec(),
        confined: None,
        whens: Default::default(),
    });
    let settings = FilterSettings::of(FilterKind::MovingHorizon(20));
    Blueprint::filter(model.unwrap(), settings, exact())
        .estimator()
        .unwrap()
}

/// The whole log in the window: the last row of the
/// bounded least squares over all rows so far (SciPy's `lsq_linear`, method `bvls`).
#[test]
fn the_moving_horizon_solves_the_bounded_problem() {
    let mut horizon = bounded_cart([(-0.3, 1.5), (0.0, 0.6)]);
    let rows = [
        (0.1, [0.0961538462, 0.2]),
        (0.9, [0.6671166495, 0.6]),
        (1.4, [1.1512251583, 0.6]),
        (1.2, [1.3071660906, 0.3942843598]),
        (2.2, [1.5, 0.3629228087]),
        (2.6, [1.5, 0.0]),
        (1.0, [1.4156113761, 0.0]),
        (0.2, [1.0861276645, 0.0]),
        (-0.5, [0.5394517021, 0.0]),
        (-0.9, [0.0206741737, 0.0]),
        (-0.4, [-0.1312098949, 0.0]),
        (0.3, [0.1127414980, 0.2993984118]),
    ];
    for (k, (y, expected)) in rows.into_iter().enumerate() {
        let found = horizon.push(0.5 * k as f64, &[y]).unwrap();
        for (found, expected) in found.iter().zip(expected) {
            assert!((found - expected).abs() < 1e-8, "{k}: {found} {expected}");
        }
    }
}

/// The velocity has one value alone, which holds it from either side: the last row of the least
/// squares over the places that are left (NumPy's `lstsq`).
#[test]
fn a_range_of_one_value_is_met_from_either_side() {
    let mut horizon = bounded_cart([(-9.0, 9.0), (0.2, 0.2)]);
    let rows = [
        (0.1, 0.096153846154),
        (0.9, 0.574797123327),
        (1.4, 0.983423799648),
        (1.2, 1.128372032979),
        (2.2, 1.58849741932),
    ];
    for (k, (y, expected)) in rows.into_iter().enumerate() {
        let found = horizon.push(0.5 * k as f64, &[y]).unwrap();
        assert!(
            (found[0] - expected).abs() < 1e-8,
            "{k}: {found:?} {expected}"
        );
        assert_eq!(found[1], 0.2);
    }
}

/// Of a linear plant without bounds a window is the filter, and looking back its smoother: as far
/// as the window reaches with a lag, and over everything.
#[test]
fn a_window_looks_back_as_the_smoother_does() {
    let run = |kind: FilterKind| {
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind)
        };
        let mut filter = Blueprint::filter(scalar(-0.3, 0.2, 0.1), settings, exact())
            .estimator()
            .unwrap();
        for k in 0..15 {
            let y = if k % 4 == 2 {
                f64::NAN
            } else {
                f64::from(k).sin()
            };
            filter.push(0.5 * f64::from(k), &[y]).unwrap();
        }
        filter
    };
    let (filter, horizon) = (run(FilterKind::Extended), run(FilterKind::MovingHorizon(4)));
    for lag in [None, Some(0), Some(1), Some(3), Some(4)] {
        let [expected, found] = [&filter, &horizon].map(|f| f.smoothed(lag, true).unwrap());
        assert_eq!(found.len(), 15);
        for (k, (a, b)) in found.iter().zip(expected).enumerate() {
            let off = a.estimate[0] - b.estimate[0];
            let spread = a.deviations[0] - b.deviations[0];
            assert!(
                off.abs() < 1e-9 && spread.abs() < 1e-9,
                "{lag:?}, row {k}: {off} {spread}"
            );
        }
    }
    assert!(horizon.smoothed(Some(5), false).is_none());
}

/// x' = −x/10 seen with little noise at −0.5, where x ≥ 0 was declared: it is at its bound from
/// the first row on, and as sure as the readings make it. A gate lets the next reading in.
#[test]
fn a_bound_says_where_and_not_how_sure() {
    let settings = FilterSettings {
        gate: Some(5.0),
        keep_history: true,
        ..FilterSettings::of(FilterKind::MovingHorizon(3))
    };
    let model = NoisyModel {
        ranges: vec![Limits {
            low: 0.0,
            high: 2.0,
        }],
        ..scalar(-0.1, 1e-3, 0.04)
    };
    let mut filter = Blueprint::filter(model.clone(), settings, exact())
        .estimator()
        .unwrap();
    let mut free = Blueprint::filter(
        model.clone(),
        FilterSettings::of(FilterKind::Extended),
        exact(),
    )
    .estimator()
    .unwrap();
    for k in 0..8 {
        for estimator in [&mut filter, &mut free] {
            estimator.push(0.5 * f64::from(k), &[-0.5]).unwrap();
        }
        let [found, expected] = [&filter, &free].map(|e| e.deviations().unwrap()[0]);
        assert!((found - expected).abs() < 1e-9, "{k}: {found} {expected}");
    }
    assert_eq!(filter.estimate(), [0.0]);
    let rows = filter.smoothed(None, false).unwrap();
    assert!(rows.iter().all(|row| row.estimate[0] >= 0.0), "{rows:?}");
    // then it moves: 0.6 is three deviations of the reading off, and not three million
    filter.push(4.5, &[0.6]).unwrap();
    assert_eq!(filter.health().sensors[0].rejected, 0);
    assert!(filter.estimate()[0] > 0.0);
}
