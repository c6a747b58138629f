use lynkeus_expr::Graph;
use nalgebra::{DMatrix, DVector};

use super::*;
use crate::filter::{
    FilterKind, FilterSettings, Likelihood, NoisyModel, ParametricSensor, Row, Sensor, SigmaPoints,
};
use crate::{Blueprint, Estimator, EstimatorSettings, Method, Step};

/// x' = −2x + 1.5u, y = x + 0.3u with noise 0.1; u is read with a deviation of 0.5.
fn decay(settings: &FilterSettings) -> Estimator {
    let g = Graph::new();
    let [time, x, u] = ["time", "x", "u"].map(|name| g.symbol(name));
    let inputs = vec![("u".to_owned(), u.node())];
    let drawn = Drawn::new(&g, &[("u".into(), u.node(), Level::Absolute(0.5))], None);
    let plant = NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.0)],
        derivatives: vec![(u * 1.5 - x * 2.0).node()],
        inputs,
        sensors: vec![Sensor {
            name: "y".into(),
            output: (x + u * 0.3).node(),
            noise: Level::Absolute(0.1),
            limits: None,
        }],
        process_noise: vec![0.0],
        initial_variance: vec![1.0],
        ranges: match settings.is_window() {
            true => vec![FREE],
            false => vec![],
        },
        confined: None,
        whens: lynkeus_model::Whens::default(),
    };
    let model = NoisyModel::new(&plant.drawing(&drawn)).unwrap();
    let run = EstimatorSettings {
        method: Method::Rk4(Step::Substeps(200)),
        ..EstimatorSettings::default()
    };
    let filter = Blueprint::filter(model.drawing(drawn.count()), settings.clone(), run);
    filter.estimator().unwrap()
}

const STEP: f64 = 0.4;
const ROWS: [[f64; 2]; 5] = [[0.7, 0.2], [0.1, 1.0], [0.5, -0.4], [0.3, 0.6], [-0.2, 0.0]];

/// Over an interval Φ = e^{−2h}, Γ = 0.75 (1 − e^{−2h}).
fn interval() -> (f64, f64) {
    let phi = (-2.0 * STEP).exp();
    (phi, 0.75 * (1.0 - phi))
}

/// The estimate at each row given all up to row `last`, by least squares over the start and all errors of u; then
/// its deviation.
fn least_squares(row: usize, last: usize) -> (f64, f64) {
    let (phi, gamma) = interval();
    // unknowns: x at the start, then d of each row; x_k = a·unknowns + b
    let count = last + 2;
    let mut state = DVector::zeros(count);
    state[0] = 1.0;
    let mut known = 0.0;
    let mut lines: Vec<(DVector<f64>, f64)> = vec![];
    for i in 0..count {
        let mut unit = DVector::zeros(count);
        unit[i] = 1.0;
        lines.push((unit, 0.0));
    }
    let mut wanted = (state.clone(), known);
    for (k, [y, u]) in ROWS.iter().enumerate().take(last + 1) {
        if k == row {
            wanted = (state.clone(), known);
        }
        let mut seen = state.clone();
        seen[k + 1] += 0.3 * 0.5;
        lines.push((seen / 0.1, (y - known - 0.3 * u) / 0.1));
        state *= phi;
        state[k + 1] += gamma * 0.5;
        known = phi * known + gamma * u;
    }
    let mut normal = DMatrix::zeros(count, count);
    let mut right = DVector::zeros(count);
    for (line, value) in &lines {
        normal += line * line.transpose();
        right += line * *value;
    }
    let covariance = normal.try_inverse().unwrap();
    let (direction, offset) = wanted;
    let estimate = direction.dot(&(&covariance * right)) + offset;
    (estimate, direction.dot(&(&covariance * &direction)).sqrt())
}

fn close(found: f64, expected: f64, what: &str) {
    assert!(
        (found - expected).abs() < 1e-9,
        "{what}: {found} {expected}"
    );
}

#[test]
fn every_filter_counts_errors_of_inputs_as_least_squares_do() {
    let kinds = [
        FilterKind::Extended,
        FilterKind::Unscented(SigmaPoints::default()),
        FilterKind::MovingHorizon(8),
    ];
    for kind in kinds {
        let settings = FilterSettings {
            keep_history: true,
            ..FilterSettings::of(kind.clone())
        };
        let mut filter = decay(&settings);
        assert_eq!(filter.names(), ["x"]);
        for (k, row) in ROWS.iter().enumerate() {
            let estimate = filter.push(STEP * k as f64, row).unwrap().to_vec();
            let (expected, deviation) = least_squares(k, k);
            assert_eq!(estimate.len(), 1);
            close(estimate[0], expected, &format!("{kind:?} row {k}"));
            close(filter.deviations().unwrap()[0], deviation, "deviation");
        }
        let smoothed = filter.smoothed(None, true).unwrap();
        for (k, row) in smoothed.iter().enumerate() {
            let (expected, deviation) = least_squares(k, ROWS.len() - 1);
            close(row.estimate[0], expected, &format!("{kind:?} smoothed {k}"));
            close(row.deviations[0], deviation, "smoothed deviation");
        }
    }
}

/// A prediction in between is no new reading of the input.
#[test]
fn a_prediction_draws_nothing() {
    let settings = FilterSettings::of(FilterKind::Extended);
    let [mut plain, mut twice] = [decay(&settings), decay(&settings)];
    plain.push(0.0, &ROWS[0]).unwrap();
    twice.push(0.0, &ROWS[0]).unwrap();
    twice.predict(0.5 * STEP).unwrap();
    for filter in [&mut plain, &mut twice] {
        filter.push(STEP, &ROWS[1]).unwrap();
    }
    close(plain.estimate()[0], twice.estimate()[0], "estimate");
    close(
        plain.deviations().unwrap()[0],
        twice.deviations().unwrap()[0],
        "deviation",
    );
}

/// Two sensors of one state whose noises go together by 0.8: by R⁻¹ where both report, by the own variance where one
/// does.
#[test]
fn correlated_noises_are_those_of_the_sensors_that_report() {
    let g = Graph::new();
    let [time, x] = ["time", "x"].map(|name| g.symbol(name));
    let sensor = |name: &str, scale: f64, noise: f64| Sensor {
        name: name.into(),
        output: (x * scale).node(),
        noise: Level::Absolute(noise),
        limits: None,
    };
    let correlation = Correlation::new(2, &[(0, 1, 0.8)]).unwrap();
    let drawn = Drawn::new(&g, &[], Some(correlation));
    let plant = NoisyPlant {
        graph: &g,
        time: time.node(),
        states: vec![("x".into(), x.node(), 0.5)],
        derivatives: vec![g.constant(0.0).node()],
        inputs: vec![],
        sensors: vec![sensor("a", 1.0, 0.2), sensor("b", 2.0, 0.5)],
        process_noise: vec![0.0],
        initial_variance: vec![0.3],
        ranges: vec![],
        confined: None,
        whens: lynkeus_model::Whens::default(),
    };
    let model = NoisyModel::new(&plant.drawing(&drawn)).unwrap();
    let model = model.drawing(drawn.count());
    let r = DMatrix::from_row_slice(2, 2, &[0.04, 0.08, 0.08, 0.25]);
    let h = DVector::from_vec(vec![1.0, 2.0]);
    let points = SigmaPoints::default();
    for kind in [FilterKind::Extended, FilterKind::Unscented(points)] {
        let run = EstimatorSettings::default();
        let filter = Blueprint::filter(model.clone(), FilterSettings::of(kind), run);
        let mut filter = filter.estimator().unwrap();
        let (mut information, mut weighed) = (1.0 / 0.3, 0.5 / 0.3);
        let rows = [[0.9, 1.2], [f64::NAN, 1.6], [0.7, f64::NAN], [1.1, 2.5]];
        for (k, row) in rows.iter().enumerate() {
            filter.push(k as f64, row).unwrap();
            let told: Vec<usize> = (0..2).filter(|i| row[*i].is_finite()).collect();
            let own = |i: usize| h[told[i]];
            let r = DMatrix::from_fn(told.len(), told.len(), |i, j| r[(told[i], told[j])]);
            let weights = r.try_inverse().unwrap();
            for i in 0..told.len() {
                for j in 0..told.len() {
                    information += own(i) * weights[(i, j)] * own(j);
                    weighed += own(i) * weights[(i, j)] * row[told[j]];
                }
            }
            close(filter.estimate()[0], weighed / information, "estimate");
            let deviation = filter.deviations().unwrap()[0];
            close(deviation, information.powf(-0.5), "deviation");
        }
    }
}

/// The likelihood of the same rows, by the covariance of all readings; and its slope.
#[test]
fn a_likelihood_counts_them_too() {
    let g = Graph::new();
    let [time, x, u, noise] = ["time", "x", "u", "noise"].map(|name| g.symbol(name));
    let number = |value: f64| g.constant(value).node();
    let drawn = Drawn::new(&g, &[("u".into(), u.node(), Level::Absolute(0.5))], None);
    let plant = ParametricPlant {
        graph: &g,
        time: time.node(),
        states: vec![x.node()],
        derivatives: vec![(u * 1.5 - x * 2.0).node()],
        inputs: vec![u.node()],
        sensors: vec![ParametricSensor {
            output: (x + u * 0.3).node(),
            noise: ParametricLevel::Variance(noise.powi(2).node()),
            limits: None,
            is_dial: false,
        }],
        process_noise: vec![number(0.0)],
        ranges: vec![],
        start: vec![(number(0.0), number(1.0))],
        drawn: 0,
        whens: Default::default(),
        parameters: vec![noise.node()],
    };
    let plant = plant.drawing(&drawn);
    let expected = |noise: f64| {
        let ((phi, gamma), n) = (interval(), ROWS.len());
        // y_k = c·(x, d_0, …) + b
        let mut state = DVector::zeros(n + 1);
        state[0] = 1.0;
        let (mut c, mut off) = (DMatrix::zeros(n, n + 1), DVector::zeros(n));
        let mut known = 0.0;
        for (k, [y, u]) in ROWS.iter().enumerate() {
            let mut seen = state.clone();
            seen[k + 1] += 0.15;
            c.set_row(k, &seen.transpose());
            off[k] = y - known - 0.3 * u;
            state *= phi;
            state[k + 1] += gamma * 0.5;
            known = phi * known + gamma * u;
        }
        let s = &c * c.transpose() + DMatrix::identity(n, n) * noise * noise;
        let log_det = (s.clone() * std::f64::consts::TAU).determinant().ln();
        0.5 * (log_det + off.dot(&(s.try_inverse().unwrap() * &off)))
    };
    let slope = (expected(0.1 + 1e-5) - expected(0.1 - 1e-5)) / 2e-5;
    let points = SigmaPoints::default();
    let both = [
        Likelihood::new(&plant).unwrap(),
        Likelihood::unscented(&plant, points).unwrap(),
    ];
    for mut likelihood in both {
        let rows = ROWS.iter().enumerate().map(|(k, [y, u])| Row {
            t: STEP * k as f64,
            inputs: std::slice::from_ref(u),
            readings: std::slice::from_ref(y),
        });
        let found = likelihood.score(&[0.1], rows, Step::Substeps(200)).unwrap();
        close(found.value, expected(0.1), "value");
        assert!(
            (found.gradient[0] - slope).abs() < 1e-5,
            "{:?}",
            found.gradient
        );
    }
}
