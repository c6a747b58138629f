//! Replays against the closed form of a Luenberger observer.

use crate::common::system;
use lynkeus_expr::Graph;
use lynkeus_run::{
    BetweenSamples, Error, Estimator, EstimatorSettings, Method, Step, System, Tolerances,
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
            let mut estimator = Estimator::new(&observer(&g), settings).unwrap();
            assert_eq!(estimator.names(), ["x_hat", "twice"]);
            for (k, x) in closed_form(between).into_iter().enumerate() {
                let row = estimator.push(TIMES[k], &[U[k], Y[k]]).unwrap();
                let error = (row[0] - x).abs();
                assert!(error < tolerance, "{between:?} {method:?}: {error:e}");
                assert_eq!(row[1], 2.0 * row[0]);
            }
        }
    }
}

#[test]
fn a_step_that_is_too_large_is_blamed() {
    let g = Graph::new();
    let [x, y] = ["x", "y"].map(|name| g.symbol(name));
    let stiff = system(&g, &[("x", 0.0, (y - x) * 400.0)], &["y"], &[]);
    let replay = |step| {
        let settings = EstimatorSettings {
            method: Method::Rk4(step),
            ..EstimatorSettings::default()
        };
        let mut estimator = Estimator::new(&stiff, settings)?;
        for k in 0..200 {
            estimator.push(0.05 * f64::from(k), &[1.0])?;
        }
        Ok(estimator)
    };
    let error = replay(Step::Substeps(1)).unwrap_err();
    assert!(matches!(error, Error::Diverged { .. }), "{error}");
    let fine = replay(Step::Auto).unwrap();
    let last = fine.estimate()[0];
    assert!((last - 1.0).abs() < 1e-9, "{last}");
    let advice = fine.advice().unwrap();
    assert!((advice.needed * 800.0 - 1.0).abs() < 0.01, "{advice:?}");
}
