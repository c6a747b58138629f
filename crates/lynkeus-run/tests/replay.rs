//! Replays against the closed form of a Luenberger observer.

mod common;

use common::system;
use lynkeus_expr::Graph;
use lynkeus_run::{
    BetweenSamples, Error, Estimator, EstimatorSettings, Log, Method, Role, Step, System,
    Tolerances, estimate,
};

const GAIN: f64 = 3.0;

/// x̂' = u + 3(y − x̂), reports x̂ and its double
fn observer(g: &Graph) -> System {
    let [x, u, y] = ["x", "u", "y"].map(|name| g.symbol(name));
    let dx = u + (y - x) * GAIN;
    system(
        g,
        &[("x", 0.25, dx)],
        &["u", "y"],
        &[("x_hat", x), ("twice", x * 2.0)],
    )
}

const TIMES: [f64; 7] = [1.0, 1.1, 1.5, 1.500_1, 2.7, 2.9, 5.0];
const U: [f64; 7] = [0.0, 1.0, -1.0, 2.0, 0.5, 0.0, 1.0];
const Y: [f64; 7] = [1.0, 1.5, 0.3, 0.2, -2.0, 4.0, 1.0];

fn log() -> Log {
    let names = ["spare", "y", "u"].map(String::from).to_vec();
    let columns = vec![vec![f64::NAN; 7], Y.to_vec(), U.to_vec()];
    Log::new(names, TIMES.to_vec(), columns).expect("a good log")
}

/// x' = −3x + (b + c·s) with s from 0 to h.
fn exact(x: f64, b: f64, c: f64, h: f64) -> f64 {
    let particular = |s: f64| (b + c * s) / GAIN - c / (GAIN * GAIN);
    particular(h) + (x - particular(0.0)) * (-GAIN * h).exp()
}

fn closed_form(between: BetweenSamples) -> Vec<f64> {
    let mut x = 0.25;
    let mut all = vec![x];
    for k in 0..TIMES.len() - 1 {
        let h = TIMES[k + 1] - TIMES[k];
        let drive = |k: usize| U[k] + GAIN * Y[k];
        let slope = match between {
            BetweenSamples::Hold => 0.0,
            BetweenSamples::Linear => (drive(k + 1) - drive(k)) / h,
        };
        x = exact(x, drive(k), slope, h);
        all.push(x);
    }
    all
}

#[test]
fn uneven_logs_follow_the_closed_form() {
    let g = Graph::new();
    let tight = Tolerances {
        relative: 1e-12,
        absolute: 1e-13,
        ..Tolerances::default()
    };
    for between in [BetweenSamples::Hold, BetweenSamples::Linear] {
        for (method, tolerance) in [
            (Method::Adaptive(tight), 1e-11),
            (Method::Rk4(Step::AtMost(1e-3)), 1e-11),
            (Method::Rk4(Step::Substeps(2000)), 1e-11),
            (Method::Rk4(Step::Auto), 2e-3),
        ] {
            let settings = EstimatorSettings { between, method };
            let found = estimate(&observer(&g), &log(), settings)
                .unwrap()
                .trajectory;
            let names: Vec<&str> = found.names(Role::Estimate).collect();
            assert_eq!(names, ["x_hat", "twice"]);
            assert_eq!(found.times(), TIMES);
            for ((_, row), x) in found.rows().zip(closed_form(between)) {
                let error = (row[0] - x).abs();
                assert!(error < tolerance, "{between:?} {method:?}: {error:e}");
                assert_eq!(row[1], 2.0 * row[0]);
            }
        }
    }
}

#[test]
fn pushing_samples_is_the_replay() {
    let g = Graph::new();
    let settings = EstimatorSettings::default();
    let replayed = estimate(&observer(&g), &log(), settings)
        .unwrap()
        .trajectory;
    let mut estimator = Estimator::new(&observer(&g), settings).unwrap();
    for (k, (t, row)) in replayed.rows().enumerate() {
        assert_eq!(estimator.push(t, &[U[k], Y[k]]).unwrap(), row);
    }
    assert_eq!(estimator.time(), Some(5.0));
}

#[test]
fn bad_logs_are_refused_with_their_row() {
    let names = || vec!["u".to_string(), "y".to_string()];
    let log = |times: &[f64]| {
        let n = times.len();
        Log::new(names(), times.to_vec(), vec![vec![0.0; n], vec![0.0; n]])
    };
    let error = log(&[0.0, 1.0, 1.0]).unwrap_err();
    assert!(
        matches!(error, Error::TimeOrder { row: 3, previous, time } if previous == time),
        "{error}"
    );
    let error = log(&[0.0, f64::NAN]).unwrap_err();
    assert!(matches!(error, Error::NotANumber { row: 2, .. }), "{error}");
    assert!(matches!(log(&[]), Err(Error::Setting { .. })));
    let uneven = Log::new(names(), vec![0.0, 1.0], vec![vec![0.0; 2], vec![0.0]]);
    assert!(uneven.unwrap_err().to_string().contains("'y'"));
    assert!(log(&[3.0]).is_ok());
}

#[test]
fn bad_cells_and_missing_columns_are_named() {
    let g = Graph::new();
    let mut y = Y.to_vec();
    y[4] = f64::NAN;
    let names = vec!["u".to_string(), "y".to_string()];
    let log = Log::new(names, TIMES.to_vec(), vec![U.to_vec(), y]).unwrap();
    let error = estimate(&observer(&g), &log, EstimatorSettings::default()).unwrap_err();
    assert_eq!(error.partial.len(), 4);
    assert!(
        matches!(&error.error, Error::NotANumber { row: 5, column, .. } if column == "y"),
        "{error}"
    );
    let log = Log::new(vec!["Y".into()], vec![0.0], vec![vec![0.0]]).unwrap();
    let error = estimate(&observer(&g), &log, EstimatorSettings::default()).unwrap_err();
    assert!(error.to_string().contains("reads 'u'"), "{error}");
}

/// Of two columns of one name neither is taken; where nobody reads them they may be there.
#[test]
fn a_column_that_is_there_twice_is_refused_where_it_is_read() {
    let g = Graph::new();
    let with = |names: [&str; 4]| {
        let names = names.map(String::from).to_vec();
        let columns = vec![U.to_vec(), Y.to_vec(), U.to_vec(), Y.to_vec()];
        let log = Log::new(names, TIMES.to_vec(), columns).unwrap();
        estimate(&observer(&g), &log, EstimatorSettings::default())
    };
    let error = with(["u", "y", "z", "y"]).unwrap_err();
    assert!(
        matches!(&error.error, Error::Ambiguous { name, .. } if name == "y"),
        "{error}"
    );
    assert!(with(["u", "y", "z", "z"]).is_ok());
}

#[test]
fn a_step_that_is_too_large_is_blamed() {
    let g = Graph::new();
    let [x, y] = ["x", "y"].map(|name| g.symbol(name));
    let stiff = system(&g, &[("x", 0.0, (y - x) * 400.0)], &["y"], &[]);
    let times: Vec<f64> = (0..200).map(|k| 0.05 * f64::from(k)).collect();
    let ones = vec![vec![1.0; times.len()]];
    let log = Log::new(vec!["y".into()], times, ones).unwrap();
    let with = |step| EstimatorSettings {
        method: Method::Rk4(step),
        ..EstimatorSettings::default()
    };
    let error = estimate(&stiff, &log, with(Step::Substeps(1))).unwrap_err();
    assert!(matches!(error.error, Error::Diverged { .. }), "{error}");
    assert!(!error.partial.is_empty());
    let fine = estimate(&stiff, &log, with(Step::Auto)).unwrap();
    let last = *fine
        .trajectory
        .column(Role::Estimate.at(0))
        .unwrap()
        .last()
        .unwrap();
    assert!((last - 1.0).abs() < 1e-9, "{last}");
    let advice = fine.advice.unwrap();
    assert!((advice.needed * 800.0 - 1.0).abs() < 0.01, "{advice:?}");
}
